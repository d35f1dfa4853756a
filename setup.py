"""Source archive with the links alphacut/rve -> ../rve, … kept as links; wheels built afresh."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

LINKS = [path for path in Path("alphacut").iterdir() if path.is_symlink()]


class LinkedArchive(sdist):
    """Source archive in which each file stands once."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Write the files, then links in place of the copies that were made through them."""
        super().make_release_tree(base_dir, files)
        for link in LINKS:
            copy = Path(base_dir) / link
            shutil.rmtree(copy)
            copy.symlink_to(link.readlink())


class FreshBuild(build_py):
    """Build without the files of an earlier one, of which some may be gone since."""

    def run(self) -> None:
        """Copy the files into an empty folder."""
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


setup(cmdclass={"sdist": LinkedArchive, "build_py": FreshBuild})
