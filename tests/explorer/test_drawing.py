"""What the page draws is what the package's own pictures draw."""

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.drawing import drawn, observable_of, path_of, quantities_of
from saltus.explorer.look import bare_label


@pytest.fixture(scope="module")
def branch(ball_on_table):
    orbit = saltus.find_orbit(ball_on_table, {"a": 1.2}, x0=[0.6, 3.1, 0.5])
    return saltus.continue_orbit(orbit, "a", (0.9, 1.8))


@pytest.mark.parametrize("name", ["max_z", "v", "period", "e", "mean(z)", "-2*amplitude(z, 1)"])
def test_points_and_marks_are_those_of_the_branch(branch, name):
    found = drawn(branch, ("a", name))
    assert np.array_equal(found.points[:, 0], branch.values)
    constant = name in branch.parameters and name not in branch.varied
    expected = np.full(len(branch), branch.parameters[name]) if constant else branch.column(name)
    assert np.array_equal(found.points[:, 1], expected)
    assert [mark.label for mark in found.marks] == [point.label for point in branch.special_points]
    on_curve = np.concatenate([strand.x for strand in found.strands])
    assert np.isin(branch.values, on_curve).all()


def test_an_orbit_alone_lies_where_its_branch_has_it(branch):
    for name in ("max_z", "v", "period", "e", "mean(z)", "min_z"):
        alone = drawn(branch.orbit(5), ("a", name)).points[0, 1]
        assert alone == pytest.approx(drawn(branch, ("a", name)).points[5, 1], rel=1e-9)


def test_the_points_of_a_sweep_are_drawn_against_its_parameter_only(ball_on_table):
    options = saltus.options.SweepOptions(discard=5, keep=4, observables=("max(z)",))
    sweep = saltus.run_sweep(ball_on_table, "a", [1.1, 1.2], x0=[0.6, 3.1], options=options)
    assert drawn(sweep, ("a", "z")).dots.shape == (8, 2)
    assert drawn(sweep, ("a", "max_z")).dots.shape == (2, 2)
    with pytest.raises(InputError, match="with a to the right"):
        drawn(sweep, ("e", "z"))


def test_a_locus_is_drawn_over_its_parameters(branch):
    locus = saltus.continue_locus(branch["SN1"], ("a", "e"), {"a": (0.1, 3.0), "e": (0.3, 0.7)})
    over = drawn(locus, ("a", "e"))
    a, e = (np.concatenate([getattr(strand, axis) for strand in over.strands]) for axis in "xy")
    assert a == pytest.approx(np.pi * (1.0 - e) / (1.0 + e), rel=3e-4)  # between points it is interpolated
    away = np.abs(locus.values[:, None, :] - np.column_stack([a, e])).max(axis=2).min(axis=1)
    assert away.max() < 1e-12
    with pytest.raises(InputError, match="must be with a or e"):
        drawn(locus, ("g", "w"))


def test_an_unknown_quantity_is_told(branch):
    with pytest.raises(InputError, match="must be one of"):
        drawn(branch, ("a", "maximum"))


def test_paths_are_cut_at_events(branch, ball_on_table):
    path = path_of(branch.orbit(0), ("t", "z - a*sin(theta)"))
    assert len(path.events) == 1
    assert path.events[0, 1] == pytest.approx(0.0, abs=1e-9)
    motion = saltus.simulate(ball_on_table, {"a": 1.1}, [0.6, 3.1, 0.5], periods=3)
    path = path_of(motion, ("t", "z - a*sin(theta)"))
    impacts = motion.events[motion.events["kind"] == "event"]
    assert np.array_equal(path.events[:, 0], impacts["time"])
    assert path.events[:, 1] == pytest.approx(np.zeros(len(impacts)), abs=1e-9)


def test_names_of_axes(ball_on_table):
    assert observable_of("max_z", ball_on_table) == "max(z)"
    assert observable_of("period", ball_on_table) == "period"
    assert {"a", "z", "min_z", "max_v", "period"} <= set(quantities_of(ball_on_table))
    assert [bare_label(name) for name in ("z1_nm", "k_N_m", "lambda", "D_rep", "amplitude(x, 1)")] == [
        "z₁ (nm)", "k (N/m)", "λ", "D_rep", "amplitude(x, 1)",
    ]  # fmt: skip
