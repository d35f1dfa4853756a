"""Fields of images and volumes: exact in uniform cells and laminates, read back from .vti."""

import numpy as np
import pytest

from alphacut.rve import GreyImage, image_fields
from tests.refused import refuses

PHASES = [{"modulus": 20e9, "poisson": 0.3}, {"modulus": 60e9, "poisson": 0.2}]


def fields_of(labels, lengths, phases=PHASES):
    return image_fields(GreyImage(labels.astype(float), lengths), phases, labels=[0, 1])


def discs(*shape):
    labels = np.zeros(shape)
    labels[tuple(slice(1, 4) for _ in shape)] = 1
    return labels


@pytest.mark.parametrize("labels", [discs(8, 6), discs(5, 6, 8)], ids=["image", "volume"])
def test_means_over_all_pixels_are_the_loads(labels):
    fields = fields_of(labels, (1e-6,) * labels.ndim)
    size = {2: 3, 3: 6}[labels.ndim]
    for found in (fields.strain, fields.stress):
        assert found.shape == (size, size, *labels.shape)
        means = found.reshape(size, size, -1).mean(axis=-1)
        assert means == pytest.approx(np.eye(size), abs=1e-9)
        assert np.ptp(found[0, 0]) > 0.1  # the phases differ


def test_in_a_laminate_strains_along_and_stresses_across_the_layers_are_uniform():
    labels = np.zeros((8, 6))
    labels[2:5] = 1  # layers across y
    fields = fields_of(labels, (1e-6, 1e-6))
    assert fields.strain[0, 0] == pytest.approx(np.ones((8, 6)), abs=2e-3)
    assert fields.stress[1, 1] == pytest.approx(np.ones((8, 6)), abs=2e-3)
    # of the stress across, strains ε22 = (1 + ν)(1 − ν) σ/E of each layer where ε11 is one mean
    assert np.ptp(fields.strain[1, 1]) > 0.5


def test_a_file_is_read_back_by_pyvista(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    labels = discs(4, 5, 6)
    fields = fields_of(labels, (3e-6, 2e-6, 1e-6))
    fields.write(tmp_path / "fields.vti")
    grid = pyvista.read(tmp_path / "fields.vti")
    assert grid.dimensions == (7, 6, 5)
    assert grid.spacing == pytest.approx((1e-6, 2e-6, 3e-6))
    assert len(grid.cell_data) == 1 + 2 * 36

    def back(name):
        return np.asarray(grid.cell_data[name]).reshape(labels.shape)

    assert np.array_equal(back("phase"), labels)
    assert np.array_equal(back("strain_22_under_12"), fields.strain[5, 1])
    assert np.array_equal(back("stress_13_under_33"), fields.stress[2, 4])


def test_a_picture_is_one_voxel_thick(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    labels = discs(5, 6)
    fields_of(labels, (2e-6, 1e-6)).write(tmp_path / "a.vti")
    grid = pyvista.read(tmp_path / "a.vti")
    assert grid.dimensions == (7, 6, 2)
    assert np.array_equal(grid.cell_data["phase"], labels.ravel())


def test_bounds_that_are_missing_have_no_field(tmp_path):
    pores = [{"modulus": 0.0, "poisson": 0.3}, PHASES[1]]
    labels = np.ones((6, 6))
    labels[:, 2:4] = 0  # percolate
    fields = fields_of(labels, (1e-6, 1e-6), pores)
    assert abs(fields.stress[1, 1, :, [0, 1, 4, 5]] - 1.5).max() < 1e-6  # in the rows beside them
    assert not fields.stress[:, :, :, 2:4].any()
    assert abs(fields.stress[0]).max() < 1e-6  # nothing carries a load across
    fields.write(tmp_path / "a.vti")
    with refuses("file"):
        fields.write(tmp_path / "a.vtk")
