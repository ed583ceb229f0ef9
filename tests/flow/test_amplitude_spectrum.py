"""Amplitude spectra against lines that are known."""

import math

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.system.hybrid import HybridSystem, Mode

TIGHT = {"tolerance": (1e-12, 1e-14)}


@pytest.fixture(scope="module")
def lines():
    """Trajectory of x = cos(t/2) with theta = 2 t, at three periods of theta and a half."""
    system = HybridSystem(("x", "y"), {}, {"free": Mode({"x": "-y/2", "y": "x/2"})}, phase=("theta", "2"))
    return saltus.simulate(system, {}, [1.0, 0.0], t_end=8.5 * math.pi, **TIGHT)


def test_whole_periods_of_a_line_give_its_amplitude_and_nothing_else(lines):
    spectrum = lines.spectrum("3 + 0.5*sin(theta) - 0.2*cos(5*theta) + 0*x")
    assert (spectrum.attrs["window"], spectrum.attrs["samples"]) == ("none", 8 * 256)
    assert (spectrum.attrs["t_start"], spectrum.attrs["t_end"]) == pytest.approx((0.5 * math.pi, 8.5 * math.pi))
    expected = np.zeros(spectrum.size)
    expected[[0, 8, 40]] = 3.0, 0.5, 0.2
    assert spectrum.values == pytest.approx(expected, abs=1e-11)
    assert spectrum["order"].values[[8, 40]].tolist() == [1.0, 5.0]
    assert spectrum["frequency"].values[[8, 40]] == pytest.approx([2.0, 10.0])


def test_a_line_between_the_orders_of_the_phase_is_at_its_frequency(lines):
    spectrum = lines.spectrum("x")  # over 8 pi, in which x runs twice
    assert float(spectrum["order"][np.argmax(spectrum.values)]) == 0.25
    assert float(spectrum["frequency"][np.argmax(spectrum.values)]) == pytest.approx(0.5)
    assert float(spectrum.max()) == pytest.approx(1.0, abs=1e-10)


def test_a_stretch_that_is_no_whole_number_of_periods_goes_through_hann_s_window(lines):
    spectrum = lines.spectrum("sin(theta)", t_start=0.0)
    assert spectrum.attrs["window"] == "hann"
    # between two frequencies Hann's window shows a line at 8/(3 pi) of its height, 1.42 dB less (Harris 1978, table I)
    assert float(spectrum.max()) == pytest.approx(8.0 / (3.0 * math.pi), abs=1e-3)
    bare = lines.spectrum("sin(theta)", t_start=0.0, window="none")
    far = spectrum["order"] > 5.0
    assert float(spectrum[far].max()) < 1e-2 * float(bare[far].max())


def test_a_spectrum_agrees_with_observed_harmonics(afm1):
    orbit = saltus.find_orbit(afm1, {"Omega": 1.05}, x0=[-0.67, 0.75])
    motion = saltus.simulate(afm1, orbit.parameters, orbit.x0, periods=2, **TIGHT)
    spectrum = motion.spectrum("z", samples=4096)
    observed = motion.observe("mean(z)", *(f"amplitude(z, {j})" for j in range(1, 6)))
    # aliases: of harmonics of order 2000 and more, which fall as order^-3, for the acceleration jumps
    assert spectrum.sel(order=np.arange(6.0)).values == pytest.approx(list(observed.values()), abs=1e-9)


def test_energy_is_that_of_the_samples(lines):
    """Parseval: the mean square is a_0^2 + sum a_j^2 / 2, the highest of an even count not halved."""
    spectrum = lines.spectrum("x*sin(theta)**2 + 0.3", samples=64)
    times = spectrum.attrs["t_start"] + 8.0 * math.pi * np.arange(64) / 64
    squares = spectrum.values**2
    energy = squares[0] + 0.5 * squares[1:-1].sum() + squares[-1]
    assert energy == pytest.approx(np.mean(lines.output("x*sin(theta)**2 + 0.3", times) ** 2), rel=1e-12)


def test_without_a_phase_frequencies_are_angular():
    circle = HybridSystem(("x", "y"), {}, {"free": Mode({"x": "-3*y", "y": "3*x"})})
    motion = saltus.simulate(circle, {}, [1.0, 0.0], t_end=40.0)
    spectrum = motion.spectrum("x")
    assert spectrum.dims == ("frequency",)
    assert abs(float(spectrum["frequency"][np.argmax(spectrum.values)]) - 3.0) < 2.0 * math.pi / 40.0
    assert spectrum.attrs["window"] == "hann"


def test_a_spectrum_is_drawn_by_its_own_plot(lines):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    (line,) = lines.spectrum("x").plot(yscale="log")
    assert (line.axes.get_xlabel(), line.axes.get_ylabel()) == ("frequency / rate of theta", "amplitude of x")
    pyplot.close("all")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"window": "han"}, "window = 'han': must be one of none, hann; did you mean 'hann'?"),
        ({"samples": 1}, "samples = 1: must be an integer >= 2"),
        ({"samples": 2.5}, "samples = 2.5: must be an integer >= 2"),
        ({"t_end": -1.0}, "t_end = -1.0: must be between 0 and"),
        ({"expression": "q"}, "expression = 'q': must be in x, y, theta and pi, but 'q' is unknown"),
    ],
)
def test_what_cannot_be_asked_of_a_spectrum_is_told(lines, options, message):
    with pytest.raises(InputError) as caught:
        lines.spectrum(**({"expression": "x"} | options))
    assert message in str(caught.value)
