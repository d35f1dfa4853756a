"""Corrected files of GeoNet, written by the columns of the format."""

import numpy as np
import pytest

from alphacut.frame import read_record
from tests.refused import refuses

N_SAMPLES, STEP = 403, 0.02
WAVES = [k * 250 * np.sin(0.05 * np.arange(N_SAMPLES) + k) for k in (1, 2, 3)]


def block(values, width_format="8.1f"):
    rows = [values[k : k + 10] for k in range(0, len(values), 10)]
    return "".join("".join(format(x, width_format) for x in row) + "\n" for row in rows)


def component(name, wave, *, first="Corrected accelerogram 20161113 GNS Science", peak=None):
    text = [
        first,
        *["text"] * 8,
        f"Number of points  {N_SAMPLES}",
        "at 0.020 sec intervals",
        "text",
        f"Component {name}  Longitudinal",
        *["peak"] * 3,
    ]
    integers = [7] * 40
    integers[33:36] = [len(wave)] * 3
    reals = [1.5] * 60
    reals[23], reals[25] = STEP * (len(wave) - 1), STEP
    reals[35] = np.abs(wave).max() if peak is None else peak
    reals[36] = STEP * np.abs(wave).argmax()
    head = "\n".join(text) + "\n" + block(integers, "8d") + block(reals, "8.3f")
    return head + block(wave) + block(9 * wave) + block(5 * wave)


def saved(folder, *components):
    path = folder / "20161113.V2A"
    path.write_text("".join(components), encoding="ascii")
    return path


def test_each_component_is_read_by_number_and_orientation(tmp_path):
    names = ("S90E", "N00E", "Up")
    path = saved(tmp_path, *map(component, names, WAVES))
    for number, (name, wave) in enumerate(zip(names, WAVES, strict=True), 1):
        for channel in (str(number), name):
            record = read_record(path, channel=channel)
            assert record.step == STEP
            assert record.samples == pytest.approx(1e-3 * wave, abs=6e-5)  # one digit of mm/s²
    assert any("vertical" in doubt for doubt in record.remarks)
    with refuses("20161113.V2A, line 1"):
        read_record(path)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (lambda text: text.replace("Corrected", "Uncorrected", 1), "20161113.V2A, line 1"),
        (lambda text: text[:-9000], "20161113.V2A, line 17"),
        (lambda text: text.replace("points  403", "points  413"), "20161113.V2A, line 20"),
        (lambda text: text.replace("at 0.020", "at 0.010"), "20161113.V2A, line 20"),
        (lambda text: text.replace("   8.040", "   4.020"), "20161113.V2A, line 20"),
        (lambda text: text.replace("text\n", "", 1), "20161113.V2A, line 20"),
    ],
)
def test_a_damaged_file_is_one_line(tmp_path, change, key):
    text = component("S90E", WAVES[0])
    damaged = change(text)
    assert damaged != text
    with refuses(key):
        read_record(saved(tmp_path, damaged))


def test_another_peak_than_the_head_states_is_no_record_without_a_word(tmp_path):
    path = saved(tmp_path, component("S90E", WAVES[0], peak=25.0))
    with refuses("20161113.V2A, line 21"):
        read_record(path)
