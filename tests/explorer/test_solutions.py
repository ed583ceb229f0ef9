"""What the page shows of an orbit, an equilibrium and a motion: numbers, curves, what goes on from them."""

import math

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.solutions import observable_of, path_of, quantity_of, readings_of, traits_of


def nothing(orbit) -> dict[str, float]:
    """Return that no instrument shows an orbit."""
    return {}


def test_an_orbit_is_judged_by_multipliers_and_looked_at_each_period(results):
    orbit = results["orbit1"]
    traits = traits_of(orbit)
    assert (traits.what, traits.spectrum) == ("orbit", "Floquet multipliers")
    assert np.array_equal(traits.values, orbit.multipliers)
    assert traits.interval == pytest.approx(2.0 * math.pi)  # the drive has frequency 1


def test_an_equilibrium_is_judged_by_eigenvalues_and_looked_at_each_turn_about_it(rests):
    rest = rests[1]["equilibrium1"]
    traits = traits_of(rest)
    assert (traits.what, traits.spectrum) == ("equilibrium", "Eigenvalues")
    assert np.sum(traits.values) == pytest.approx(1.5 - 1.0 - 1.0)  # trace B - 1 - A^2
    assert traits.interval == pytest.approx(2.0 * math.pi)  # determinant A^2: complex eigenvalues of modulus 1


@pytest.mark.parametrize("name", ["motion1", "sweep1", "branch1"])
def test_nothing_goes_on_from_what_solves_no_equation(results, name):
    traits = traits_of(results[name])
    assert (traits.what, traits.spectrum, len(traits.values)) == ("", "", 0)


def test_paths_are_cut_at_events(results, ball_on_table):
    path = path_of(results["branch1"].solution(0), ("t", "z - a*sin(theta)"))
    assert len(path.events) == 1
    assert path.events[0, 1] == pytest.approx(0.0, abs=1e-9)
    motion = results["motion1"]
    path = path_of(motion, ("t", "z - a*sin(theta)"))
    impacts = motion.events[motion.events["kind"] == "event"]
    assert np.array_equal(path.events[:, 0], impacts["time"])
    assert path.events[:, 1] == pytest.approx(np.zeros(len(impacts)), abs=1e-9)


def test_a_path_over_the_phase_never_runs_backwards(results):
    path = path_of(results["motion1"], ("theta", "z"))
    assert len(path.curves) == len(path.modes)
    assert len(path.curves) > len(results["motion1"].events)  # three periods pass 2 pi besides the impacts
    for curve in path.curves:
        assert np.all(np.diff(curve[:, 0]) >= 0.0)
        assert curve[:, 0].min() >= 0.0
        assert curve[:, 0].max() <= 2.0 * math.pi + 1e-12


def test_what_rests_is_one_place_at_time_0(rests):
    path = path_of(rests[1]["equilibrium1"], ("t", "y"))
    assert path.modes == [0] * len(path.curves)
    assert path.events == pytest.approx(np.array([[0.0, 1.5]]))


def test_a_wrong_expression_of_a_path_is_told(results):
    with pytest.raises(InputError, match="nowhere"):
        path_of(results["orbit1"], ("t", "nowhere"))


def test_readings_of_an_orbit_have_the_instrument_first(results, toys):
    orbit = results["orbit1"]
    found = readings_of(orbit, toys.readings)
    assert next(iter(found)) == "beats"
    assert found["beats"] == pytest.approx(1.0 / found["period"])
    assert found["signature"] == "flight:impact"
    assert found["min(z)"] <= found["mean(z)"] <= found["max(z)"]
    assert found["max(z)"] == pytest.approx(orbit.max["z"], rel=1e-9)
    assert found["a"] == 1.2


def test_readings_of_an_equilibrium_are_its_states(rests):
    found = readings_of(rests[1]["equilibrium1"], nothing)
    assert (found["stable"], found["mode"], found["B"]) == (True, "reaction", 1.5)
    assert [found["x"], found["y"]] == pytest.approx([1.0, 1.5])  # A and B/A


def test_readings_of_a_motion_are_its_end(results):
    motion = results["motion1"]
    found = readings_of(motion, nothing)
    assert found["z at the end"] == motion.x_end[0]
    assert found["events"] == len(motion.events)
    assert found["a"] == 1.1


def test_no_instrument_is_asked_about_what_is_no_orbit(results, rests):
    def refused(orbit):
        raise AssertionError("asked")

    for shown in (results["motion1"], rests[1]["equilibrium1"], results["sweep1"], None):
        assert "beats" not in readings_of(shown, refused)


def test_an_axis_names_an_observable(ball_on_table):
    assert observable_of("max_z", ball_on_table) == "max(z)"
    assert observable_of("period", ball_on_table) == "period"
    assert observable_of("max_nothing", ball_on_table) == "max_nothing"
    assert observable_of("mean(z)", ball_on_table) == "mean(z)"


@pytest.mark.parametrize(
    "name", ["a", "e", "z", "v", "period", "min_z", "max_v", "max(z)", "mean(z)", "amplitude(z, 1)"]
)
def test_a_quantity_of_an_orbit_is_that_of_its_branch(results, name):
    branch = results["branch1"]
    known = name in branch.parameters and name not in branch.varied
    expected = branch.parameters[name] if known else branch.column(name)[4]
    assert quantity_of(branch.solution(4), name) == pytest.approx(expected, rel=1e-9)


def test_extremes_of_an_equilibrium_are_its_state(rests):
    rest = rests[1]["equilibrium1"]
    for name in ("y", "min_y", "max_y", "max(y)"):
        assert quantity_of(rest, name) == rest["y"]
    with pytest.raises(InputError, match="axis = 'period'"):
        quantity_of(rest, "period")


def test_a_mean_that_is_rounding_reads_0():
    spring = saltus.HybridSystem.smooth({"x": "v", "v": "cos(s) - 4*x - 0.3*v"}, {"w": 1.0}, phase=("s", "w"))
    told = readings_of(saltus.find_orbit(spring, x0=[0.3, 0.0]), nothing)
    assert told["mean(x)"] == told["mean(v)"] == 0.0
    assert told["max(x)"] == pytest.approx(1.0 / math.hypot(3.0, 0.3), rel=1e-9)
