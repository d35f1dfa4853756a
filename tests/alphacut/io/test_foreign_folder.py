"""A folder of results that comes from elsewhere cannot make a page show other files of the user."""

import json

import numpy as np
import pytest
import xarray

from alphacut.base.kept_files import digest_of
from alphacut.io.results import MANIFEST, ResultsFolder, write_arrays
from tests.alphacut.small import told_by, written


@pytest.fixture
def finished(tmp_path):
    """The folder of a run with an envelope."""
    out = tmp_path / "out"
    case = written(tmp_path)
    told_by("run", case, "--quiet", "--no-figures", "--out", out)
    return out


def replace_arrays(folder, path):
    """Put a file in the place of the arrays of the envelope, and list it as a run would."""
    results = ResultsFolder.read(folder)
    name = "envelope_all.nc"
    (folder / name).write_bytes(path.read_bytes())
    listed = results.files[name]._replace(digest=digest_of(path.read_bytes()))
    results.add_to_list({name: listed})


def test_arrays_without_entries_come_back(tmp_path, rng):
    sizes = {"a": 3, "b": 0, "c": 2}
    data = xarray.Dataset({"x": (tuple(sizes), rng.random(tuple(sizes.values())))})
    data["y"] = (("a",), rng.random(3))
    data["z"] = (("b",), np.array([]))
    data["text"] = (("c",), ["one", ""])
    data.attrs = {"phases": ["pore", "µ"], "one": ["alone"], "title": "a", "number": 2.5}
    path = tmp_path / "arrays" / "a.nc"
    path.parent.mkdir()
    write_arrays(data, path)
    folder = ResultsFolder(tmp_path / "out")
    folder.put_files("1", path.parent)
    read = folder.dataset("a.nc")
    assert read.equals(data)
    assert read.attrs == data.attrs


def linked_file(folder, secret, kind):
    """An HDF5 file of an envelope whose lower bounds are the bytes of another file of the user."""
    h5py = pytest.importorskip("h5py")
    path = folder / "hostile.nc"
    with h5py.File(path, "w") as file:
        if kind == "external storage":
            place = [(str(secret), 0, 8)]
            file.create_dataset("lower", shape=(1,), dtype="f8", external=place)
        else:
            with h5py.File(folder / "other.h5", "w") as other:
                other["lower"] = np.frombuffer(secret.read_bytes()[:8])
            file["lower"] = h5py.ExternalLink(str(folder / "other.h5"), "lower")
    return path


@pytest.mark.parametrize("command", ["report", "verify"])
@pytest.mark.parametrize("kind", ["external storage", "external link"])
def test_values_of_other_files_are_refused(finished, tmp_path, command, kind):
    secret = tmp_path / "id_rsa"
    secret.write_bytes(b"password of the user")
    replace_arrays(finished, linked_file(tmp_path, secret, kind))
    words = ["--csv", tmp_path / "csv"] if command == "report" else []
    told = told_by(command, finished, *words, status=2)
    assert len(told.splitlines()) == 1
    assert "envelope_all.nc is no file in the classic format of NetCDF" in told
    assert not list((tmp_path / "csv").glob("*.csv"))


@pytest.mark.parametrize("place", [3, 5, 9, 40, 200, 1000])
def test_damaged_arrays_in_a_list_that_vouches_for_them_are_one_line(
    finished, tmp_path, place, rng
):
    content = bytearray((finished / "envelope_all.nc").read_bytes())
    content[place : place + 8] = rng.bytes(8)
    damaged = tmp_path / "damaged.nc"
    damaged.write_bytes(content[: rng.integers(place + 8, len(content))])
    replace_arrays(finished, damaged)
    assert len(told_by("report", finished, status=2).splitlines()) == 1


def test_results_of_the_former_format_are_named(finished):
    document = json.loads((finished / MANIFEST).read_text())
    document["format_version"] = 4
    (finished / MANIFEST).write_text(json.dumps(document))
    assert "manifest.json is of format 4; allowed: files of format 5" in told_by(
        "report", finished, status=2
    )


def test_arrays_are_what_any_reader_of_netcdf_reads(finished):
    ours = ResultsFolder.read(finished).dataset("envelope_all.nc")
    with xarray.open_dataset(finished / "envelope_all.nc", engine="netcdf4") as theirs:
        for name, values in theirs.variables.items():
            assert values.equals(ours[name].variable)
    assert ours["motion_forces"].shape[1:] == (1, 0)
    assert ours["lower"].dtype == np.float64
    assert [str(x) for x in ours["output"].values] == ["q1"]
