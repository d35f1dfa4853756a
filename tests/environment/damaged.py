"""Damaged files of every format that is read from outside: what reading each does to a process.

    ./enter python -m tests.environment.damaged --count 100

For each format a sound file is written and damaged `count` times: bits flipped, the end cut off,
numbers replaced by huge or negative ones, bytes written over. Each damaged file is read in a process
of its own, which must neither end by a signal, nor raise what is no refusal, nor take more than
1 GB beside what it began with, or 20 s. A table tells the formats, how many files were still read, and the largest figures.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import io
import os
import re
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from zlib import crc32

import numpy as np

from alphacut import main as run_command
from alphacut.frame import read_matrix, read_modes, read_record
from alphacut.fuzzy import FailedError, RefusedError
from alphacut.rve import read_image
from alphacut.stochastic import read_particles
from tests.frame.records import samples

MOST_MEGABYTES, MOST_SECONDS = 1000.0, 20
LIMIT = 4 << 30
"""Bytes of address space beyond which memory is refused, so that no file harms the machine."""
READ, REFUSED, NO_MEMORY, OTHER = 0, 2, 3, 4  # exit statuses of a process
HUGE = [b"-1", b"999999999", b"99999999999999999999", b"1e308", b"0", b"-2147483648", b"nan"]
WORDS = [b"\xff" * 2, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\xff" * 8, b"\0" * 4]
WORDS += [b"\x7f\xff\xff\xff", b"\x40\0\0\0", b"\0\0\0\x40"]


@dataclass(frozen=True)
class Format:
    """A format: writes a sound file into a folder and returns its path; reads a file."""

    name: str
    write: Callable[[Path], Path]
    read: Callable[[Path], object]


@dataclass
class Outcome:
    """What reading the damaged files of a format did."""

    name: str
    n_read: int = 0
    n_refused: int = 0
    seconds: float = 0.0
    megabytes: float = 0.0
    failures: list[str] = field(default_factory=list)

    def row(self) -> str:
        """One line of the table."""
        figures = f"{self.n_read:6} {self.n_refused:8} {self.seconds:8.2f} {self.megabytes:8.0f}"
        return f"{self.name:24} {figures}  {'; '.join(self.failures)}"


COLOURED = ("a.gif", "a.webp")
"""Pictures of formats that have colours alone, which no cell takes."""
HEAD = f"{'format':24} {'read':>6} {'refused':>8} {'s':>8} {'MB':>8}  failures"


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """A content with one kind of damage, mostly near its start, where heads are."""
    end = len(content) if rng.random() < 0.5 else min(len(content), 400)
    match rng.integers(5):
        case 0:
            changed = bytearray(content)
            for place in rng.integers(end, size=int(rng.integers(1, 12))):
                changed[place] ^= 1 << int(rng.integers(8))
            return bytes(changed)
        case 1:
            return content[: int(rng.integers(len(content)))]
        case 2 | 3:
            numbers = [*re.finditer(rb"[-+]?[0-9][0-9.eE+-]*", content[:end])]
            if numbers:
                found = numbers[int(rng.integers(len(numbers)))]
                other = HUGE[int(rng.integers(len(HUGE)))]
                return content[: found.start()] + other + content[found.end() :]
    place, word = int(rng.integers(end)), WORDS[int(rng.integers(len(WORDS)))]
    return content[:place] + word + content[place + len(word) :]


def with_right_checksums(content: bytes) -> bytes:
    """A PNG whose chunks have the checksums of what they hold, so that damage gets as far as it."""
    place, parts = 8, [content[:8]]
    while place + 12 <= len(content):
        length = int.from_bytes(content[place : place + 4], "big")
        body = content[place + 4 : place + 8 + length]
        parts += [content[place : place + 4], body, crc32(body).to_bytes(4, "big")]
        place += 12 + length
    return b"".join(parts)


def outcome_of(form: Format, count: int, rng: np.random.Generator, folder: Path) -> Outcome:
    """Damage a sound file of a format so many times, and read each in a process of its own."""
    folder.mkdir()
    path = form.write(folder)
    files = [x for x in folder.rglob("*") if x.is_file()]
    sound = {file: file.read_bytes() for file in files}
    outcome = Outcome(form.name)
    form.read(path)  # the sound file is read, or the format tells nothing
    for number in range(count):
        file = files[int(rng.integers(len(files)))]
        content = damaged(sound[file], rng)
        if file.suffix == ".png" and number % 2:
            content = with_right_checksums(content)
        file.write_bytes(content)
        failure = _read_apart(form, path, outcome)
        if failure:
            outcome.failures.append(f"{failure} (file {number})")
            if keep := os.environ.get("KEEP_DAMAGED"):
                Path(keep, f"{form.name.replace(' ', '_')}-{number}{file.suffix}").write_bytes(
                    content
                )
        file.write_bytes(sound[file])
    return outcome


def _read_apart(form: Format, path: Path, outcome: Outcome) -> str:
    """Read a file in a forked process; the failure, empty if there is none."""
    start = time.monotonic()
    resident, told = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python warns of forks beside threads; ours sleep
        process = os.fork()
    if process == 0:
        _exit_by_reading(form, path, told)
    os.close(told)
    with open(resident, "rb") as stream:
        kilobytes_before = int(stream.read() or 0)
    _, status, usage = os.wait4(process, 0)
    outcome.seconds = max(outcome.seconds, time.monotonic() - start)
    # A forked process begins with the memory of its parent, which a worker of pytest has gathered
    megabytes = (usage.ru_maxrss - kilobytes_before) / 1e3
    outcome.megabytes = max(outcome.megabytes, megabytes)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        return f"more than {MOST_SECONDS} s" if number == signal.SIGALRM else f"signal {number}"
    code = os.WEXITSTATUS(status)
    outcome.n_read += code == READ
    outcome.n_refused += code == REFUSED
    if megabytes > MOST_MEGABYTES or code == NO_MEMORY:
        return f"{megabytes:.0f} MB"
    return "" if code in (READ, REFUSED) else f"exit status {code}"


def _exit_by_reading(form: Format, path: Path, told: int) -> None:
    """End this process by a status that tells what reading a file did.

    `told` is the end of a pipe to which the kilobytes in memory before the reading are written.
    """
    code = OTHER
    try:
        silent = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silent, 1)
        if "KEEP_DAMAGED" not in os.environ:
            os.dup2(silent, 2)
        pages = [int(x) for x in Path("/proc/self/statm").read_text().split()]
        used = pages[0] * os.sysconf("SC_PAGE_SIZE")
        os.write(told, b"%d" % (pages[1] * os.sysconf("SC_PAGE_SIZE") // 1024))
        os.close(told)
        resource.setrlimit(resource.RLIMIT_AS, (used + LIMIT, used + LIMIT))
        signal.signal(signal.SIGALRM, signal.SIG_DFL)  # a test with a time limit has its own
        signal.alarm(MOST_SECONDS)
        form.read(path)
        code = READ
    except RefusedError:
        code = REFUSED
    except MemoryError:
        code = NO_MEMORY
    except BaseException:
        if "KEEP_DAMAGED" in os.environ:
            import traceback

            traceback.print_exc()
    finally:
        os._exit(code)


def bytes_to(name: str, content: Callable[[], bytes]) -> Callable[[Path], Path]:
    """A writer of a content into a file of a name."""

    def write(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content())
        return path

    return write


def saved_by(name: str, save: Callable[[Path], object]) -> Callable[[Path], Path]:
    """A writer by a function of the path."""

    def write(folder: Path) -> Path:
        path = folder / name
        save(path)
        return path

    return write


def formats() -> list[Format]:
    """All formats that can be written and read with what is installed."""
    return [*_records(), *_modes(), *_matrices(), *_pictures(), *_volumes(), *_texts(), *_meshes()]


def _records() -> list[Format]:
    def variant(name: str) -> bytes:
        return samples.variant(name, 0)[0]

    found = [
        Format(name, bytes_to("record.txt", lambda name=name: variant(name)),
               lambda path, unit=unit: read_record(
                   path, step=samples.STEP if unit else None, unit=unit))
        for name in samples.FORMATS for unit in [samples.variant(name, 0)[1]]
    ]  # fmt: skip
    wave = np.sin(np.arange(400) / 20)
    for order in ("<", ">"):
        write = bytes_to("record.uff", lambda order=order: samples.uff58(wave, order=order))
        found.append(Format(f"UFF 58b {order}", write, read_record))
    if importlib.util.find_spec("obspy"):
        import obspy

        trace = obspy.Trace(wave.astype("float32"), {"delta": samples.STEP, "channel": "HNE"})
        for name in ("MSEED", "SAC"):
            saved = saved_by("record", lambda path, name=name: trace.write(str(path), format=name))
            found.append(Format(name, saved, lambda path: read_record(path, unit="m/s^2")))
    return found


def _modes() -> list[Format]:
    floors = {"11.x": 1, "12.x": 2}
    text = "".join(samples.uff55(k, (1.0, 0.5, 0.2, 0.1), frequency=k) for k in (1, 2))
    write = bytes_to("modes.uff", text.encode)
    return [Format("UFF 55", write, lambda path: read_modes(path, floors=floors))]


def _matrices() -> list[Format]:
    import scipy.io
    import scipy.sparse

    matrix = np.diag(np.arange(1.0, 9.0)) + np.diag(np.ones(7), 1) + np.diag(np.ones(7), -1)
    sparse = scipy.sparse.csr_matrix(matrix)
    savers: dict[str, Callable[[Path], object]] = {
        "k.mtx": lambda p: scipy.io.mmwrite(p, sparse),
        "dense.mtx": lambda p: scipy.io.mmwrite(p, matrix),
        "k.npy": lambda p: np.save(p, matrix),
        "k.npz": lambda p: np.savez_compressed(p, k=matrix),
        "k.csv": lambda p: np.savetxt(p, matrix, delimiter=","),
    }
    for form in ("csr", "csc", "coo"):
        savers[f"{form}.npz"] = lambda p, form=form: scipy.sparse.save_npz(
            p, sparse.asformat(form), compressed=False
        )
    found = [Format(name, saved_by(name, save), read_matrix) for name, save in savers.items()]

    def listed(path: Path, *, is_named: bool) -> None:
        """Entries of the upper triangle; by node and direction, or by number."""
        names = [f"{k // 2 + 1},{k % 2 + 1}," if is_named else f"{k + 1}" for k in range(8)]
        entries = [
            f"{names[j]} {names[i]} {matrix[i, j]:.15e}\n"
            for i in range(8)
            for j in range(8)
            if (matrix[i, j] and j >= i)
        ]
        path.write_text("".join(entries))
        if path.suffix == ".sti":
            names = [f"{k // 2 + 1}.{k % 2 + 1}\n" for k in range(8)]
            path.with_suffix(".dof").write_text("".join(names))

    for name, is_named in (("abaqus.mtx", True), ("coordinate.mtx", False), ("beam.sti", False)):
        save = saved_by(name, lambda p, is_named=is_named: listed(p, is_named=is_named))
        found.append(Format(name, save, read_symmetric))
    return [*found, *_program_files()]


def _program_files() -> list[Format]:
    """Matrices of Nastran and MAPDL, which the packages that read them bring."""
    folders = {}
    for package in ("pyyeti", "ansys.mapdl.reader"):
        with suppress(ModuleNotFoundError):
            folders[package] = Path(importlib.import_module(package).__path__[0])
    files = [("pyyeti", "nastran_dmig_data/matrix_factory.pch", "RANDM")]
    for kind in ("ascii", "le", "be_i64"):
        for layout in ("dense", "bigmat", "nonbigmat"):
            files.append(("pyyeti", f"nastran_op4_data/double_{layout}_{kind}.op4", "rmat"))
    files += [("ansys.mapdl.reader", "file.full", member) for member in "KM"]
    subfolders = {"pyyeti": "tests", "ansys.mapdl.reader": "examples"}
    return [
        Format(f"{path.name} {member}", bytes_to(path.name, path.read_bytes),
               lambda path, member=member: read_matrix(path, name=member))
        for package, name, member in files if package in folders
        for path in [folders[package] / subfolders[package] / name]
    ]  # fmt: skip


def read_symmetric(path: Path) -> None:
    """Read a matrix that its file states as symmetric."""
    matrix = read_matrix(path)
    assert np.array_equal(matrix, matrix.T)


def _pictures() -> list[Format]:
    from PIL import Image

    from alphacut.stochastic.particles.measured import section_picture

    grey = np.random.default_rng(0).integers(0, 250, (40, 50)).astype(np.uint8)
    picture = Image.fromarray(grey)
    names = {"a.png": {}, "a.bmp": {}, "a.jpg": {}, "a.pgm": {}, "a.gif": {}, "a.tif": {}}
    names |= {
        "lzw.tif": {"compression": "tiff_lzw"},
        "deflate.tif": {"compression": "tiff_deflate"},
    }
    names |= {"packbits.tif": {"compression": "packbits"}, "a.webp": {}, "a.jp2": {}}
    found = []
    for name, options in names.items():
        write = saved_by(name, lambda path, options=options: picture.save(path, **options))
        found.append(Format(f"section {name}", write, section_picture))
        if name not in COLOURED:
            found.append(
                Format(f"picture {name}", write, lambda path: read_image(path, spacing=(1.0, 1.0)))
            )
    return found


def _volumes() -> list[Format]:
    import gzip

    import tifffile
    from PIL import Image

    values = np.random.default_rng(0).integers(0, 250, (6, 8, 10)).astype(np.uint8)

    def head(path: Path, text: str, data: bytes, *, beside: str = "") -> None:
        path.write_bytes(text.encode() + (b"" if beside else data))
        if beside:
            (path.parent / beside).write_bytes(data)

    def folder_of_slices(folder: Path) -> Path:
        path = folder / "slices"
        path.mkdir()
        for k, page in enumerate(values):
            Image.fromarray(page).save(path / f"slice{k}.png")
        return path

    meta = "ObjectType = Image\nNDims = 3\nDimSize = 10 8 6\nElementSpacing = 1 1 1\n"
    meta += "ElementType = MET_UCHAR\nElementDataFile = "
    nrrd = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 10 8 6\n"
    nrrd += "space directions: (1,0,0) (0,1,0) (0,0,1)\n"
    raw, packed = values.tobytes(), gzip.compress(values.tobytes())
    savers: dict[str, Callable[[Path], object]] = {
        "a.npy": lambda p: np.save(p, values),
        "raw.tif": lambda p: tifffile.imwrite(p, values, photometric="minisblack"),
        "zlib.tif": lambda p: tifffile.imwrite(p, values, compression="zlib", bigtiff=True),
        "imagej.tif": lambda p: tifffile.imwrite(p, values, imagej=True, metadata={"axes": "ZYX"}),
        "a.ome.tif": lambda p: tifffile.imwrite(p, values, metadata={"axes": "ZYX"}),
        "a.mhd": lambda p: head(p, meta + "a.raw\n", raw, beside="a.raw"),
        "a.mha": lambda p: head(p, meta + "LOCAL\n", raw),
        "a.nhdr": lambda p: head(
            p, nrrd + "encoding: raw\ndata file: a.raw\n", raw, beside="a.raw"
        ),
        "a.nrrd": lambda p: head(p, nrrd + "encoding: gzip\n\n", packed),
    }

    def read(path: Path) -> object:
        return read_image(path, spacing=(1.0, 1.0, 1.0))

    found = [Format(f"volume {x}", saved_by(x, save), read) for x, save in savers.items()]
    return [*found, Format("volume of slices", folder_of_slices, read)]


def _texts() -> list[Format]:
    from alphacut.frame.records.tables import read_force_history

    def read_case(path: Path) -> None:
        told = io.StringIO()
        with redirect_stdout(told), redirect_stderr(told):
            status = run_command(["check", str(path), "--quiet"])
        assert "is an error of this program" not in told.getvalue()
        if status:
            raise RefusedError("case", told.getvalue(), "")

    force = "time [s],force [kN]\n" + "".join(f"{k / 10},{k % 7}\n" for k in range(50))
    circles = "x [mm],y [mm],r [mm]\n10,10,4\n30,12,5\n"
    case = Path("cases/pendulum.toml").read_bytes()
    return [
        Format("force CSV", bytes_to("force.csv", force.encode), read_force_history),
        Format("circles CSV", bytes_to("circles.csv", circles.encode),
               lambda path: read_particles(path, size=(0.04, 0.04))),
        Format("case TOML", bytes_to("case.toml", lambda: case), read_case),
    ]  # fmt: skip


def _meshes() -> list[Format]:
    try:
        from alphacut.rve.mesh import square
        from alphacut.rve.mesh.file import read_grid
    except ImportError:  # without DOLFINx
        return []

    def write(path: Path, version: float, binary: int) -> None:
        with square.open_gmsh() as gmsh:
            gmsh.merge("meshes/paper-coarse.msh")
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(path))

    def read(path: Path) -> object:
        try:
            return read_grid(path)
        except FailedError as error:
            raise RefusedError("mesh", str(error), "") from None

    return [
        Format(f"MSH {version} {'binary' if binary else 'text'}",
               saved_by("a.msh", lambda p, v=version, b=binary: write(p, v, b)), read)
        for version in (2.2, 4.1)
        for binary in (0, 1)
    ]  # fmt: skip


def main() -> int:
    """Print the table; 1 if a file of a format fails."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=100, help="damaged files of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="part of the names of the formats")
    options = parser.parse_args()
    print(HEAD)
    n_failures = 0
    with TemporaryDirectory() as folder:
        for number, form in enumerate(formats()):
            if options.only in form.name:
                rng = np.random.default_rng((options.seed, number))
                outcome = outcome_of(form, options.count, rng, Path(folder, str(number)))
                n_failures += len(outcome.failures)
                print(outcome.row(), flush=True)
    return int(n_failures > 0)


if __name__ == "__main__":
    sys.exit(main())
