"""Measured modes read in Python: deviations of the file and of the caller, and modes held out."""

import pytest

from alphacut.frame import StoreyFrame, identify, read_modes
from alphacut.fuzzy import Crisp, Interval, RefusedError
from tests.frame.records.samples import uff55
from tests.refused import refuses

MODES = "mode,frequency [Hz],q1,q2\n1,1.5,0.5,1\n1,1.6,0.52,1\n2,4,-1,0.5\n"


def written(folder, text=MODES, name="modes.csv"):
    path = folder / name
    path.write_text(text)
    return path


def test_several_rows_scatter_and_a_single_one_takes_the_given_deviation(tmp_path):
    first, second = read_modes(written(tmp_path))
    assert first.frequency.nominal == pytest.approx(1.55)
    assert isinstance(second.frequency, Crisp)
    _, known = read_modes(str(written(tmp_path)), frequency_deviation=0.01, shape_deviation=0.02)
    low, high = known.frequency.cut(0.05)
    assert (low, high) == pytest.approx((4 - 1.96 * 0.04, 4 + 1.96 * 0.04), abs=2e-4)


@pytest.mark.parametrize(("old", "new"), [("1.5", "x"), ("q1", "u1"), ("2,4", "0,4")])
def test_wrong_modes_are_refused(tmp_path, old, new):
    with pytest.raises(RefusedError):
        read_modes(written(tmp_path, MODES.replace(old, new, 1)))


def test_modes_and_deviations_of_an_operational_analysis_are_read(tmp_path):
    """Columns as the how-to writes them from pyOMA2's arrays Fn, Fn_std, Phi and Phi_std."""
    head = "mode,frequency [Hz],frequency_std [Hz],shape_std,q1,q2"
    rows = "1,1.5,0.015,0.03,0.5,1\n2,4,0.08,0.02,-1,0.5\n"
    first, second = read_modes(written(tmp_path, f"{head}\n{rows}"))
    assert (first.mode, second.mode, first.reference, second.reference) == (1, 2, 2, 1)
    assert second.shape[2].nominal == pytest.approx(-0.5, rel=1e-3)
    # both amplitudes of a ratio scatter
    scatters = [(first.frequency, 0.015), (second.frequency, 0.08)]
    scatters += [(first.shape[1], 0.03 * 1.25**0.5), (second.shape[2], 0.02 * 1.25**0.5)]
    for number, scatter in scatters:
        assert number.cut(0.05).width == pytest.approx(2 * 1.96 * scatter, rel=0.02)


def test_a_deviation_in_the_file_counts_before_the_given_one(tmp_path):
    text = "mode,frequency [Hz],frequency_std [Hz],q1,q2\n1,4,0.08,-1,0.5\n"
    (mode,) = read_modes(written(tmp_path, text), frequency_deviation=0.01, shape_deviation=0.02)
    assert mode.frequency.cut(0.05).width == pytest.approx(2 * 1.96 * 0.08, abs=4e-4)


def test_a_mode_without_scatter_can_be_held_out_and_not_learned_from(tmp_path):
    frame = StoreyFrame([1.0, 1.0], stiffness=[250.0, 250.0])
    inputs = {"k1": Interval(100, 500), "k2": Interval(100, 500)}
    modes = read_modes(written(tmp_path))
    learned = identify(frame, inputs, modes, held_out=[2])
    (prediction,) = learned.predictions().held_out
    assert (prediction.mode, prediction.measured) == (2, 4.0)
    with refuses("mode 2"):
        identify(frame, inputs, modes)


def test_a_universal_file_is_read_by_the_floors_of_its_unknowns(tmp_path):
    path = written(tmp_path, uff55(1, [0.4, 0.8, 1.0, 9.0]), "modes.uff")
    floors = {"11.x": 1, "13.x": 2}
    (mode,) = read_modes(path, floors=floors, frequency_deviation=0.01, shape_deviation=0.02)
    assert (mode.mode, mode.reference) == (1, 2)
    assert mode.shape[1].nominal == pytest.approx(0.4, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "options", "key"),
    [
        ("modes.csv", {"floors": {"1.x": 1}}, "floors"),
        ("modes.uff", {}, "floors"),
        ("modes.csv", {"frequency_deviation": 0}, "frequency_deviation"),
        ("modes.csv", {"shape_deviation": -0.1}, "shape_deviation"),
    ],
)
def test_other_arguments_are_refused(tmp_path, name, options, key):
    with refuses(key):
        read_modes(written(tmp_path, name=name), **options)


@pytest.mark.parametrize(
    ("head", "unit", "factor"),
    [
        ("mode,frequency [Hz],q1,q2", "", 1),
        ("Mode No,Freq (Hz),q1,q2", "", 1),
        ("mode;f [Hz];q1;q2", "", 1),
        ("# Natural frequencies (Hz) and mode shapes\nmode,frequency,q1,q2", "", 1),
        ("mode,f_n [Hz],q1,q2", "", 1),
        ("mode,eigenfrequency [rad/s],q1,q2", "", None),
        ("mode,frequency [1/s],q1,q2", "", None),
        ("mode,frequency [cycles/s],q1,q2", "", 1),
        ("mode,frequency [rpm],q1,q2", "", None),
        ("# omega in rad/s\nmode,frequency,q1,q2", "", None),
        ("mode,period,q1,q2", "", None),
        ("mode,T [s],q1,q2", "", None),
        ("# lambda = omega^2\nmode,frequency,q1,q2", "", None),
        ("# all values in hertz\nmode,frequency,q1,q2", "", 1),
        ("#unit_frequency=kHz\nmode,frequency,q1,q2", "", 1000),
        ("# frequencies, x 2 pi\nmode,frequency,q1,q2", "", None),
        ("mode,frequency,q1,q2", "Hz", 1),
        ("# sampled at 200 Hz\nmode,frequency,q1,q2", "", None),
        ("mode,frequency,q1,q2", "", None),
        ("mode,frequency,q1,q2", "rad/s", None),
        ("# frequencies in rad/s\nmode,frequency,q1,q2", "Hz", None),
        ("# in kHz\nmode,frequency [Hz],q1,q2", "", None),
        ("mode,frequency [kHz],q1,q2", "Hz", None),
        ("# values multiplied by 2*pi\nmode,frequency [Hz],q1,q2", "", None),
        ("# f in 10 Hz\nmode,frequency,q1,q2", "Hz", None),
        ("# frequency unit Hz, scaled by 1000\nmode,frequency,q1,q2", "", None),
        ("# frequencies per minute\nmode,frequency,q1,q2", "Hz", None),
        ("# frequencies squared, Hz^2\nmode,frequency,q1,q2", "", None),
        ("# Hz x 0.1\nmode,frequency,q1,q2", "", None),
        ("# unit of f = kilohertz\nmode,frequency,q1,q2", "", 1000),
        ("# values normalised by 1.2 Hz\nmode,frequency,q1,q2", "Hz", None),
        ("# frequencies in 1/s\nmode,frequency,q1,q2", "Hz", None),
        ("# measured with a 4.5 Hz geophone\nmode,frequency,q1,q2", "", None),
        ("mode,frequency [Hz],q1 [mm],q2 [m]", "", None),
        ("# deviation in percent\nmode,frequency [Hz],frequency_std,q1", "", None),
        ("mode,omega,q1,q2", "Hz", None),
        ("# Kreisfrequenz\nmode,frequency,q1,q2", "Hz", None),
        ("# Pulsations propres\nmode,frequency,q1,q2", "Hz", None),
        ("# f/f1\nmode,frequency,q1,q2", "Hz", None),
        ("# log10 of frequencies\nmode,frequency,q1,q2", "Hz", None),
        ("# rad per sec\nmode,frequency,q1,q2", "Hz", None),
        ("# 2 x pi x f\nmode,frequency,q1,q2", "Hz", None),
        ("# deviations are relative\nmode,frequency [Hz],frequency_std,q1", "", None),
        ("# f in mHz\nmode,frequency,q1,q2", "", 1e-3),
        ("# f in MHz\nmode,frequency,q1,q2", "", None),
        ("# damping in %\nmode,frequency [Hz],q1,q2", "", 1),
        ("# unit: Hz (sample rate 200 Hz)\nmode,frequency,q1,q2", "", 1),
        ("# unit: Hz (sample rate 200 Hz)\nmode,frequency,q1,q2", "kHz", None),
        ("# lambda = omega^2\nmode,frequency,q1,q2", "Hz", None),
        ("mode;frequency / Hz;q1;q2", "", 1),
        ("mode,frequency,q1,q2\n-,kHz,-,-", "", 1000),
        ("# Abtastfrequenz 200 Hz, Eigenfrequenzen in Hz\nmode,frequency,q1,q2", "", 1),
        ("# first at 1.5 Hz\nmode,frequency,q1,q2", "Hz", 1),
        ("# mode shapes normalised to 1, frequencies in Hz\nmode,frequency,q1,q2", "", 1),
        ("# frequency: Hz / 2\nmode,frequency,q1,q2", "", None),
        ("# all frequencies times 10\nmode,frequency [Hz],q1,q2", "", None),
        ("# f in s^-1\nmode,frequency,q1,q2", "Hz", None),
        ("# frequencies in dB\nmode,frequency,q1,q2", "Hz", None),
        ("# tenths of Hz\nmode,frequency,q1,q2", "", None),
        ("# percent of 10 Hz\nmode,frequency,q1,q2", "Hz", None),
        ("# first at 1.5 Hz\nmode,frequency,q1,q2", "kHz", None),
        ("# Eigenperioden\nmode,frequency,q1,q2", "Hz", None),
        ("# pulsazioni\nmode,frequency,q1,q2", "Hz", None),
        ("# Kreiseigenfrequenzen\nmode,frequency,q1,q2", "Hz", None),
        ("# Schwingungsdauer\nmode,frequency,q1,q2", "Hz", None),
        ("# f in Mio. Hz\nmode,frequency,q1,q2", "Hz", None),
        ("# a coefficient of variation\nmode,frequency [Hz],frequency_std,q1", "", None),
        ("# écart-type relatif\nmode,frequency [Hz],frequency_std,q1", "", None),
        ("# std in mHz\nmode,frequency [Hz],frequency_std,q1", "", None),
        ("mode,frequency,frequency_std [mHz],q1", "", None),
        ("# by SSI-COV, std in kHz\nmode,frequency [kHz],q1,q2", "", 1000),
    ],
)
def test_the_unit_of_frequencies_is_stated_or_asked_for(tmp_path, head, unit, factor):
    rows = "1,1.5,0.5,1\n2,4,-1,0.5\n"
    path = written(tmp_path, f"{head}\n{rows.replace(',', ';') if ';' in head else rows}")
    if factor is None:
        with pytest.raises(RefusedError):
            read_modes(path, frequency_unit=unit)
    else:
        found = [mode.frequency.nominal for mode in read_modes(path, frequency_unit=unit)]
        assert found == pytest.approx([1.5 * factor, 4 * factor])


def test_decimal_commas_beside_semicolons_and_units_beside_signs_are_read(tmp_path):
    text = "mode;Freq (Hz);q1;q2\n1;1,5;0,25;1\n2;4;-1;0,5\n"
    assert [x.frequency.nominal for x in read_modes(written(tmp_path, text))] == [1.5, 4]
    text = "# 频率的单位是kHz\nmode,frequency,q1,q2\n1,1.5,0.5,1\n"
    path = tmp_path / "modes.csv"
    for unit in ("kHz", "ｋＨｚ", "㎑"):
        path.write_text(text.replace("kHz", unit), encoding="utf-8")
        assert read_modes(path)[0].frequency.nominal == 1500
        with pytest.raises(RefusedError, match="frequency_unit Hz"):
            read_modes(path, frequency_unit="Hz")
    # A unit that is not known may be any.
    path.write_text(text.replace("kHz", "千赫"), encoding="utf-8")
    for unit in ("Hz", "kHz"):
        with pytest.raises(RefusedError, match="override"):
            read_modes(path, frequency_unit=unit)


def test_deviations_in_a_unit_of_their_own_and_comments_behind_numbers_are_read(tmp_path):
    text = "mode,frequency%s,frequency_std [%sHz],q1,q2\n1,4,%s,-1,0.5%s\n"
    expected = read_modes(written(tmp_path, text % (" [Hz]", "", "0.004", "")))[0].frequency
    for mark in ("  # in Hz", " ; in Hz"):
        [mode] = read_modes(written(tmp_path, text % ("", "m", "4", mark)))
        assert mode.frequency.cut(0.5) == pytest.approx(expected.cut(0.5))


def test_the_cure_of_periods_is_their_reciprocal(tmp_path):
    with pytest.raises(RefusedError, match="write 1/T") as caught:
        read_modes(written(tmp_path, "mode,frequency [s],q1,q2\n1,1.5,0.5,1\n"))
    assert "π" not in str(caught.value)


def test_a_wrong_unit_of_a_file_is_overridden(tmp_path):
    path = written(tmp_path, "mode,frequency [kHz],q1,q2\n1,1.5,0.5,1\n2,4,-1,0.5\n")
    with pytest.warns(UserWarning, match="of modes.csv what it states of its frequency_unit"):
        modes = read_modes(path, frequency_unit="Hz", override=["frequency_unit"])
    assert modes[0].frequency.nominal == 1.5
