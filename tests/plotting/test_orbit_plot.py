"""Pictures of orbits, and the samples that they are drawn from."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.plotting import style
from sliding import planar, table


@pytest.fixture(scope="module")
def impacting(impact_oscillator) -> PeriodicOrbit:
    return saltus.solve_orbit(impact_oscillator, {}, [("free", "impact", [1.0, -1.3, 0.1], 6.28)])


def test_samples_hold_both_ends_of_every_segment(tapping_orbit):
    sample = tapping_orbit.sample()
    times = sample["t"].values
    ends = np.concatenate([[0.0], np.cumsum(tapping_orbit.durations)])
    assert np.array_equal(times[np.searchsorted(times, ends[1:-1], side="left")], ends[1:-1])
    assert (times == ends[1]).sum() == 2
    assert times[-1] == ends[-1]
    assert np.all(np.diff(times) >= 0.0)
    touch = np.searchsorted(times, ends[1], side="right")
    assert sample["mode"].values[[touch - 2, touch - 1]].tolist() == [0, 1]
    assert sample["z"].values[[0, touch - 1, -1]] == pytest.approx(1.0 / 300.0, abs=1e-11)


def test_samples_agree_with_an_event_driven_simulation(tapping_orbit):
    """The oracle is the other flow: Runge-Kutta of free step with events, at a tolerance of 1e-10."""
    sample = tapping_orbit.sample(200)
    start = tapping_orbit.states[0]
    motion = saltus.simulate(
        tapping_orbit.system, dict(tapping_orbit.parameters), start, mode="flight", t_end=tapping_orbit.period
    )
    times = np.minimum(sample["t"].values, motion.t_end)
    states = np.column_stack([sample[name].values for name in ("q1", "v1")])
    assert states == pytest.approx(motion(times)[:, :2], abs=1e-7)


def test_samples_have_every_state_and_output_and_a_phase_on_the_circle(tapping_orbit):
    sample = tapping_orbit.sample()
    assert set(sample.data_vars) == {"q1", "v1", "theta", "z", "v", "force", "mode"}
    assert sample["theta"].values.min() >= 0.0
    assert sample["theta"].values.max() <= 2.0 * math.pi
    gap = 1.0 - sample["q1"] - tapping_orbit.parameters["ybar"] * np.sin(sample["theta"])
    assert sample["z"].values == pytest.approx(gap.values, abs=1e-14)
    # the dip of 0.0636 in 25 steps: a parabola's half step of 1.5/25, squared
    assert tapping_orbit.min["z"] <= sample["z"].values.min() < tapping_orbit.min["z"] + 0.0636 * (1.5 / 25.0) ** 2


def test_samples_close_up_to_the_reset(impacting):
    sample = impacting.sample()
    assert sample["x"].values[[0, -1]] == pytest.approx(1.0, abs=1e-11)
    assert sample["v"].values[0] == pytest.approx(-0.8 * sample["v"].values[-1], abs=1e-10)


@pytest.mark.parametrize("points", [1, 2.5, "many", True])
def test_a_count_of_samples_that_cannot_be_is_told(impacting, points):
    with pytest.raises(InputError, match="must be an integer >= 2"):
        impacting.sample(points)


def test_a_saved_orbit_is_equal(tapping_orbit, tmp_path):
    assert saltus.load(tapping_orbit.save(tmp_path / "orbit.nc")) == tapping_orbit


def test_the_curve_is_closed_and_coloured_by_mode(tapping_orbit):
    ax = tapping_orbit.plot("z", "v1")
    flight, contact, ends = ax.lines
    assert [line.get_label() for line in ax.lines] == ["flight", "contact", "segment ends"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["flight", "contact", "segment ends"]
    assert (flight.get_color(), contact.get_color()) == (style.colour_of_mode(0), style.colour_of_mode(1))
    for line, other in ((flight, contact), (contact, flight)):
        place, begin = line.get_xydata()[-1], other.get_xydata()[0]
        assert place == pytest.approx(begin, abs=1e-10)
    assert ends.get_xydata() == pytest.approx(np.array([flight.get_xydata()[-1], contact.get_xydata()[-1]]))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$z$", "$v_{1}$")


def test_the_two_sides_of_a_reset_are_joined_by_a_dotted_line(impacting):
    ax = impacting.plot()
    (jump,) = (line for line in ax.lines if line.get_linestyle() == ":")
    (before, after) = jump.get_ydata()
    assert after == pytest.approx(-0.8 * before, abs=1e-10)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$v$")


def test_the_phase_s_wrap_cuts_the_curve_at_two_pi(tapping_orbit):
    ax = tapping_orbit.plot("theta", "z")
    curves = [line.get_xdata() for line in ax.lines if line.get_marker() == "None"]
    assert all(np.abs(np.diff(curve)).max() < 1.0 for curve in curves)
    assert max(curve.max() for curve in curves) == 2.0 * math.pi
    assert min(curve.min() for curve in curves) == 0.0


def test_expressions_are_drawn_like_outputs(tapping_orbit):
    named = tapping_orbit.plot("z", "v").lines
    written = tapping_orbit.plot("1 - q1 - ybar*sin(theta)", "-v1 - ybar*Omega*cos(theta)").lines
    assert len(named) == len(written) == 3
    for one, other in zip(named, written, strict=True):
        assert one.get_xydata() == pytest.approx(other.get_xydata(), abs=1e-14)


def test_sliding_segments_are_thick_and_named():
    orbit = saltus.find_orbit(planar(), {"mu": 1.2}, [1.0, 0.2])
    above, sliding, _ = orbit.plot().lines
    assert [line.get_label() for line in (above, sliding)] == ["above", "sliding"]
    assert sliding.get_linewidth() > 2.0 * above.get_linewidth()
    assert sliding.get_ydata() == pytest.approx(-1.0, abs=1e-12)


def test_a_mode_that_slides_under_another_name_is_told_from_others():
    motion = saltus.simulate(table(), {}, [0.0, 1.2], periods=2)
    labels = {line.get_label(): line for line in motion.plot().lines}
    assert {"flight", "rest (sliding)"} <= set(labels)
    assert labels["rest (sliding)"].get_linewidth() > 2.0 * labels["flight"].get_linewidth()


def test_an_orbit_without_events_is_one_curve(impact_oscillator):
    orbit = saltus.solve_orbit(impact_oscillator, {"A": 0.05}, [("free", "theta", [0.0, 0.5], 2.0 * math.pi)])
    ax = orbit.plot("x", "v", legend=False)
    (line,) = ax.lines
    assert line.get_xydata()[0] == pytest.approx(line.get_xydata()[-1], abs=1e-10)
    assert ax.get_legend() is None


def test_a_wrong_name_is_answered_with_the_nearest_one(tapping_orbit):
    allowed = r"in q1, v1, theta, Omega, .*, z, v, force and pi, but 'forse' is unknown; did you mean 'force'\?"
    with pytest.raises(InputError, match=rf"expression = 'forse': must be {allowed}"):
        tapping_orbit.plot("t", "forse")
