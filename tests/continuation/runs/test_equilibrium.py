"""Branches of equilibria: special points against closed forms, test functions, boundaries of modes, options."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import fields
import saltus
from saltus import (
    HybridSystem,
    Mode,
    StepControl,
    Transition,
    continue_equilibrium,
    find_equilibrium,
)
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import InputError

STEPS = (None, StepControl(largest=0.02), StepControl(initial=0.07, largest=0.4, deviation=3e-3))


def _branch(field, parameters, x0, name, bounds, **options) -> EquilibriumBranch:
    return continue_equilibrium(find_equilibrium(fields.system(field, parameters), x0=x0), name, bounds, **options)


# A1: normal forms


@pytest.mark.parametrize("steps", STEPS)
def test_a_fold_turns_the_branch_and_its_eigenvalue_is_the_closed_form(steps):
    branch = _branch({"x": "mu - x**2"}, {"mu": 1.0}, [1.0], "mu", (-1.0, 2.0), steps=steps)
    assert fields.places(branch.special_points, "mu") == [("SN", pytest.approx(0.0, abs=1e-12))]
    assert branch.eigenvalues[:, 0].real == pytest.approx(-2.0 * branch.states[:, 0], abs=1e-12)
    assert np.array_equal(branch.stable, branch.states[:, 0] > 0.0)
    assert branch.stopped == ("mu = 2: bound reached", "mu = 2: bound reached")


@pytest.mark.parametrize("steps", STEPS)
def test_both_folds_of_the_cusp(steps):
    branch = _branch({"x": "r + h*x - x**3"}, {"r": 0.0, "h": 1.5}, [1.2], "r", (-2.0, 2.0), steps=steps)
    fold = 2.0 * 0.5**1.5
    assert sorted(fields.places(branch.special_points, "r")) == [
        ("SN", pytest.approx(-fold, abs=1e-12)),
        ("SN", pytest.approx(fold, abs=1e-12)),
    ]


@pytest.mark.parametrize("start", [-0.5, 0.7])
@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("field", ["mu*x - x**2", "mu*x - x**3"])
def test_the_trivial_branch_meets_another_at_zero(field, start, steps):
    branch = _branch({"x": field}, {"mu": start}, [0.0], "mu", (-1.0, 1.0), steps=steps)
    assert fields.places(branch.special_points, "mu") == [("BP", pytest.approx(0.0, abs=1e-12))]
    assert np.array_equal(branch.stable, branch.values < 0.0)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("place", fields.PLANES)
def test_hopf_points_lie_where_the_closed_form_says(place, steps):
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.HOPF, {"mu": -0.5, "w": 3.0}), x0=plane.to([0.01, 0.0]))
    branch = continue_equilibrium(start, "mu", (-1.0, 1.0), steps=steps)
    assert fields.places(branch.special_points, "mu") == [("HB", pytest.approx(0.0, abs=1e-11))]
    assert np.abs(plane.back(branch.states)).max() < 1e-9
    assert branch["HB1"].equilibrium.eigenvalues == pytest.approx([3.0j, -3.0j], abs=1e-9)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("place", fields.PLANES)
def test_a_fold_and_a_hopf_point_on_one_branch(place, steps):
    """x^2 + b2 x + b1 = 0 folds at b1 = b2^2/4; trace -x and determinant -(b2 + 2x) make the Hopf point x = 0."""
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=plane.to([-1.0, 0.0]))
    branch = continue_equilibrium(start, "b1", (-2.0, 2.0), steps=steps)
    assert fields.places(branch.special_points, "b1") == [
        ("HB", pytest.approx(0.0, abs=1e-10)),
        ("SN", pytest.approx(0.25, abs=1e-11)),
    ]
    x = plane.back(branch.states)[:, 0]
    assert branch.values == pytest.approx(x - x**2, abs=1e-8)


def test_a_neutral_saddle_is_no_hopf_point():
    """With eigenvalues of one modulus and opposite signs the trace vanishes as at a Hopf point."""
    branch = _branch({"x": "x", "y": "-a*y"}, {"a": 0.5}, [0.0, 0.0], "a", (0.2, 2.0))
    assert list(branch.special_points) == []
    assert not branch.stable.any()


def test_an_equilibrium_of_centres_has_no_hopf_points():
    branch = _branch({"x": "y", "y": "-k*x"}, {"k": 1.0}, [0.0, 0.0], "k", (0.5, 2.0))
    assert list(branch.special_points) == []
    assert branch.stopped == ("k = 0.5: bound reached", "k = 2: bound reached")


def test_a_closed_branch_is_traced_once():
    branch = _branch({"x": "x**2 + p**2 - 1"}, {"p": 0.0}, [1.0], "p", (-2.0, 2.0))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert sorted(fields.places(branch.special_points, "p")) == [
        ("SN", pytest.approx(-1.0, abs=1e-12)),
        ("SN", pytest.approx(1.0, abs=1e-12)),
    ]
    assert branch.values[-1] == pytest.approx(branch.values[0], abs=1e-12)
    assert branch.states[-1] == pytest.approx(branch.states[0], abs=1e-12)


# A2 and A4: Lorenz and Bazykin


def test_lorenz_has_its_pitchfork_and_a_hopf_point_on_either_side():
    r, w = 470.0 / 19.0, 9.624530063715756
    lorenz = fields.lorenz()
    trivial = continue_equilibrium(find_equilibrium(lorenz, {"r": 0.5}, x0=[0.0, 0.0, 0.0]), "r", (0.0, 30.0))
    assert fields.places(trivial.special_points, "r") == [("BP", pytest.approx(1.0, abs=1e-12))]
    for sign in (1.0, -1.0):
        branch = continue_equilibrium(find_equilibrium(lorenz, x0=[8.0 * sign, 8.0 * sign, 23.0]), "r", (15.0, 30.0))
        assert fields.places(branch.special_points, "r") == [("HB", pytest.approx(r, abs=1e-10))]
        found = branch["HB1"].equilibrium
        assert found["x"] * sign == pytest.approx(math.sqrt(8.0 / 3.0 * (r - 1.0)), rel=1e-11)
        assert sorted(found.eigenvalues, key=lambda v: (v.real, v.imag)) == pytest.approx(
            [-41.0 / 3.0, -1j * w, 1j * w], abs=1e-9
        )


def test_bazykin_meets_its_axis_at_a_branch_point():
    """x = 100 (no predators) meets the other branch where 100/(1 + 100 al) = 1."""
    branch = _branch(fields.BAZYKIN, {"al": 0.35, "de": 0.01}, [3.0, 3.0], "al", (0.1, 1.1))
    assert [point.type for point in branch.special_points] == ["SN", "SN", "BP"]
    assert branch["BP1"].parameters["al"] == pytest.approx(0.99, abs=1e-11)
    assert branch["BP1"].equilibrium.state == pytest.approx([100.0, 0.0], abs=1e-8)


# test functions


def _determinants(branch) -> tuple[np.ndarray, np.ndarray]:
    """Return determinant and trace of the Jacobian along a branch of a plane field, by NumPy."""
    found = []
    for equilibrium in branch:
        problem = EquilibriumProblem(
            branch.system, 0, branch.system.parameter_vector(equilibrium.parameters), [], np.ones(0)
        )
        A = problem.evaluate(np.array(equilibrium.state))[1]
        found.append((np.linalg.det(A), np.trace(A)))
    return tuple(np.array(found).T)


def test_test_functions_change_sign_once_at_each_point_and_stay_finite():
    """Steps of a thousandth through both points: every one that is not next to a point has the sign of its side."""
    start = find_equilibrium(fields.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=[-1.0, 0.0])
    branch = continue_equilibrium(start, "b1", (-2.0, 2.0), steps=StepControl(initial=1e-3, largest=5e-3))
    determinant, trace = _determinants(branch)
    for values, label in ((determinant, "SN1"), (trace, "HB1")):
        changes = np.flatnonzero(np.diff(np.sign(values)) != 0.0)
        assert np.isfinite(values).all()
        assert [index + 0.5 for index in changes] == [branch[label].position]
    assert all(abs(point.test) < 1e-8 for point in branch.special_points)


@pytest.mark.parametrize("start", np.linspace(-1.9, -0.01, 7))
def test_special_points_do_not_depend_on_the_start(start):
    branch = _branch(fields.TAKENS, {"b1": start, "b2": -1.0}, [-1.5, 0.0], "b1", (-2.0, 2.0))
    wanted = [("HB", pytest.approx(0.0, abs=1e-10)), ("SN", pytest.approx(0.25, abs=1e-11))]
    assert sorted(fields.places(branch.special_points, "b1"), key=lambda item: item[1]) == wanted


# A5: Chua's circuit with a bias


def test_the_inner_equilibrium_of_chua_folds_at_both_surfaces():
    branch = continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0))
    assert [(point.type, point.kind) for point in branch.special_points] == [("BE", "nonsmooth fold")] * 2
    folds = {point.of: point.parameters["d"] for point in branch.special_points}
    assert folds == pytest.approx({"up": -1.0 / 7.0, "down": 1.0 / 7.0}, abs=1e-13)
    assert branch.regular.all()
    for name, slope, rest in (("inner", -7.0, 0.0), ("plus", 3.5, 1.5), ("minus", 3.5, -1.5)):
        own = branch.mode == branch.system.mode_index(name)
        assert own.any()
        assert branch.states[own, 0] == pytest.approx(slope * branch.values[own] + rest, abs=1e-12)
    assert sorted(branch.stopped) == ["d = -1: bound reached", "d = 1: bound reached"]


def test_where_the_determinants_have_one_sign_the_equilibrium_persists():
    start = find_equilibrium(fields.chua(m0=-0.5), mode="inner")
    branch = continue_equilibrium(start, "d", (-1.0, 1.0))
    assert [(point.type, point.kind) for point in branch.special_points] == [("BE", "persistence")] * 2
    assert sorted(point.parameters["d"] for point in branch.special_points) == pytest.approx([-0.5, 0.5], abs=1e-13)
    assert np.all(np.diff(branch.values) >= 0.0) or np.all(np.diff(branch.values) <= 0.0)


def test_the_outer_hopf_point_of_chua():
    start = find_equilibrium(fields.chua(), mode="plus", x0=[1.5, 0.0, -1.5])
    point = continue_equilibrium(start, "be", (15.0, 30.0))["HB1"]
    assert point.parameters["be"] == pytest.approx(1125.0 / 49.0, rel=1e-12)
    assert point.normal_form.frequency**2 == pytest.approx(810.0 / 49.0, rel=1e-11)
    assert point.equilibrium.eigenvalues[-1] == pytest.approx(-25.0 / 7.0, rel=1e-11)


def test_at_a_boundary_the_branch_goes_on_in_its_own_mode_where_that_is_asked_for():
    passed = continue_equilibrium(
        find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0), steps=StepControl(at_grazing="pass")
    )
    assert set(passed.mode.tolist()) == {passed.system.mode_index("inner")}
    assert passed.states[:, 0] == pytest.approx(-7.0 * passed.values, abs=1e-12)
    assert np.array_equal(passed.regular, np.abs(passed.values) <= 1.0 / 7.0)
    assert len(passed.special_points.of_type("BE")) == 2


def test_at_a_boundary_where_the_field_jumps_the_branch_ends():
    system = HybridSystem(
        ("x",),
        {"a": -1.0},
        {"left": Mode({"x": "a - x"}), "right": Mode({"x": "a - x - 1"})},
        [Transition("left", "right", "x", 1, name="over"), Transition("right", "left", "x", -1, name="back")],
    )
    branch = continue_equilibrium(find_equilibrium(system, x0=[-1.0], mode="left"), "a", (-2.0, 2.0))
    assert branch["BE1"].parameters["a"] == pytest.approx(0.0, abs=1e-14)
    assert branch.stopped[1] == "a = 0: boundary equilibrium, the field jumps: what goes on is a pseudo-equilibrium"


# A6: a boundary equilibrium with a cycle


@pytest.mark.parametrize(("m", "mode"), [(-0.5, "left"), (0.5, "right")])
def test_a_focus_persists_at_its_boundary_and_changes_its_stability(m, mode):
    system = fields.two_slopes()
    branch = continue_equilibrium(find_equilibrium(system, {"m": m}, x0=[m, 0.1], mode=mode), "m", (-1.0, 1.0))
    assert fields.places(branch.special_points, "m") == [("BE", pytest.approx(0.0, abs=1e-12))]
    assert branch["BE1"].kind == "persistence"
    slope = np.where(branch.mode == system.mode_index("left"), -0.5, 0.2)
    assert branch.states == pytest.approx(np.stack([branch.values, slope * branch.values], axis=1), abs=1e-12)
    assert np.array_equal(branch.stable, branch.mode == system.mode_index("left"))
    assert branch.regular.all()


# options


def test_directions_say_which_way_the_parameter_goes():
    for direction, end in (("up", 30.0), ("down", 15.0)):
        start = find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
        branch = continue_equilibrium(start, "r", (15.0, 30.0), directions=direction)
        assert branch.values[0] == 24.0
        assert branch.values[-1] == end
        assert branch.stopped == ("the start", f"r = {end:g}: bound reached")


def test_stop_at_ends_the_branch_at_the_first_of_its_kind():
    branch = _branch(fields.TAKENS, {"b1": -1.0, "b2": -1.0}, [-1.0, 0.0], "b1", (-2.0, 2.0), stop_at="SN")
    assert branch.stopped[1] == "b1 = 0.25: SN"
    assert branch.values[-1] == pytest.approx(0.25, abs=1e-11)
    hopf = _branch(
        fields.TAKENS, {"b1": -1.0, "b2": -1.0}, [-1.0, 0.0], "b1", (-2.0, 2.0), stop_at=("SN", "HB"), directions="up"
    )
    assert hopf.stopped[1] == "b1 = 0: HB"


def test_events_record_states_outputs_and_the_parameter():
    system = HybridSystem(
        ("x", "y"),
        {"b1": -1.0, "b2": -1.0},
        {"flow": Mode(fields.TAKENS)},
        outputs={"square": "x**2"},
    )
    start = find_equilibrium(system, x0=[-1.0, 0.0])
    events = {"x": 0.25, "b1": -1.5, "square": 1.0}
    branch = continue_equilibrium(start, "b1", (-2.0, 2.0), events=events)
    (state,) = branch.special_points.of_type("x")
    assert state.equilibrium["x"] == pytest.approx(0.25, abs=1e-12)
    assert state.parameters["b1"] == pytest.approx(0.25 - 0.25**2, abs=1e-12)
    passed = branch.special_points.of_type("b1")
    assert [point.parameters["b1"] for point in passed] == pytest.approx([-1.5, -1.5], abs=1e-12)
    for point in branch.special_points.of_type("square"):
        assert branch.value_at(point, "square") == pytest.approx(1.0, abs=1e-11)
    stopped = continue_equilibrium(start, "b1", (-2.0, 2.0), events={"x": 0.25}, stop_at="x", directions="up")
    assert stopped.stopped[1] == "b1 = 0.1875: x"


def test_columns_and_points_of_a_branch():
    system = HybridSystem(("x",), {"mu": 1.0}, {"flow": Mode({"x": "mu - x**2"})}, outputs={"double": "2*x"})
    branch = continue_equilibrium(find_equilibrium(system, x0=[1.0]), "mu", (-1.0, 2.0))
    assert np.array_equal(branch.column("mu"), branch.values)
    assert np.array_equal(branch.column("x"), branch.states[:, 0])
    assert branch.column("double") == pytest.approx(2.0 * branch.column("x"))
    assert branch.column("arclength")[0] == 0.0
    assert branch.value_at(branch["SN1"], "mu") == pytest.approx(0.0, abs=1e-12)
    assert branch.solution(-1).state[0] == branch.states[-1, 0]
    assert [found.parameters["mu"] for found in branch] == branch.values.tolist()
    with pytest.raises(InputError, match="did you mean 'SN1'"):
        branch["SN2"]
    with pytest.raises(InputError, match="quantity = 'z'"):
        branch.column("z")
    with pytest.raises(InputError, match="quantity = 'z'"):
        branch.value_at(branch["SN1"], "z")
    with pytest.raises(InputError, match="index = "):
        branch.solution(len(branch))


def test_progress_is_told_and_an_interrupt_keeps_what_is_done():
    told = []

    def stop(progress):
        told.append(progress.text)
        if len(told) == 5:
            raise KeyboardInterrupt

    start = find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
    branch = continue_equilibrium(start, "r", (15.0, 30.0), progress=stop)
    assert told[0].startswith("r = ")
    assert branch.stopped[0] == "interrupted" or branch.stopped[1] == "interrupted"
    assert 4 <= len(branch) <= 6


def test_at_most_so_many_points():
    branch = _branch({"x": "mu - x**2"}, {"mu": 1.0}, [1.0], "mu", (-1.0, 2.0), steps=StepControl(max_points=4))
    assert all(reason.endswith("4 points") for reason in branch.stopped)


def test_a_saved_branch_is_loaded_as_it_was(tmp_path):
    branches = [
        continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0)),
        _branch({"x": "mu*x - x**2"}, {"mu": 1.0}, [1.0], "mu", (-1.0, 2.0)),
        continue_equilibrium(find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0]), "r", (15.0, 30.0)),
    ]
    for branch in branches:
        again = saltus.load(branch.save(tmp_path / "branch.nc"))
        assert isinstance(again, EquilibriumBranch)
        assert again == branch
        assert repr(again) == repr(branch)
        for mine, theirs in zip(branch.special_points, again.special_points, strict=True):
            for name in ("label", "of", "kind", "position"):
                assert getattr(mine, name) == getattr(theirs, name)
            assert np.array_equal(mine.scale, theirs.scale)
            assert mine.equilibrium == theirs.equilibrium
        assert json.loads(json.dumps(dict(again.options))) == json.loads(json.dumps(dict(branch.options)))


def test_a_table_of_special_points():
    branch = continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0))
    table = branch.special_points.to_dataframe()
    assert list(table["type"]) == ["BE", "BE"]
    assert {"d", "x", "y", "z", "stable", "mode", "regular"} <= set(table.columns)


# what cannot be used


def test_bad_input_is_told_in_a_line():
    lorenz = find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
    wrong = [
        ({"parameter": "s"}, "parameter = 's'"),
        ({"bounds": (25.0, 30.0)}, "bounds"),
        ({"bounds": (30.0, 15.0)}, "bounds"),
        ({"bounds": (math.nan, 30.0)}, "bounds"),
        ({"directions": "left"}, "directions = 'left'"),
        ({"events": {"q": 1.0}}, "events = 'q': must be one of"),
        ({"events": {"x": "one"}}, "events"),
        ({"events": 3}, "events = 3"),
        ({"stop_at": "HBB"}, "did you mean 'HB'"),
        ({"stop_at": "PD"}, "stop_at = 'PD'"),
        ({"steps": 0.1}, "steps = 0.1"),
        ({"progress": 3}, "progress = 3"),
    ]
    for change, message in wrong:
        options = {"parameter": "r", "bounds": (15.0, 30.0)} | change
        with pytest.raises(InputError) as told:
            continue_equilibrium(lorenz, **options)
        assert message in str(told.value)
        assert "\n" not in str(told.value)
    with pytest.raises(InputError, match="equilibrium = "):
        continue_equilibrium(fields.lorenz(), "r", (15.0, 30.0))


def test_an_orbit_is_no_equilibrium_and_an_equilibrium_no_orbit():
    lorenz = find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0])
    point = continue_equilibrium(lorenz, "r", (15.0, 30.0))["HB1"]
    with pytest.raises(InputError, match=r"use \.equilibrium"):
        _ = point.orbit
    with pytest.raises(InputError, match="orbit = "):
        saltus.continue_orbit(lorenz, "r", (15.0, 30.0))


@pytest.mark.parametrize("directions", ["both", "up", "down"])
def test_a_start_exactly_at_a_saddle_node_is_one(directions):
    system = saltus.HybridSystem.smooth({"x": "mu - x**2", "y": "x - y"}, parameters={"mu": 0.0})
    start = find_equilibrium(system, x0=[0.0, 0.0])
    branch = continue_equilibrium(start, "mu", (-1.0, 1.0), directions=directions)
    assert [(point.label, point.parameters["mu"]) for point in branch.special_points] == [("SN1", 0.0)]


# equilibria at infinity


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("unit", "steps"), [(1.0, None), (1e-9, None), (1e6, None), (1.0, STEPS[1]), (1.0, STEPS[2])])
@pytest.mark.parametrize(
    ("field", "start", "bounds", "limit"),
    [
        ({"x": "p*x - u", "y": "x - y"}, [1.0, 1.0], (-1.0, 2.0), 0.0),
        # a bacterium's respiration: Fairen, Velarde, J. Math. Biol. 8 (1979) 147
        ({"x": "10*u - x - g", "y": "p*u - g"}, [5.0, 13.5], (2.0, 11.0), 10.0),
    ],
)
def test_a_branch_to_infinity_ends_there_without_a_saddle_node(field, start, bounds, limit, unit, steps):
    field = {name: rate.replace("g", "x*y/u/(1 + x**2/u**2/2)") for name, rate in field.items()}
    system = fields.system(field, {"p": 0.5 * sum(bounds) if limit else 1.0, "u": unit})
    branch = continue_equilibrium(find_equilibrium(system, x0=np.array(start) * unit), "p", bounds, steps=steps)
    end = int(limit > 0.0)
    assert branch.stopped[end].endswith("the equilibrium grows without bound")
    assert branch.stopped[1 - end].endswith("bound reached")
    assert branch.values[-end] == pytest.approx(limit, abs=1e-3)
    wanted = (10.0 - branch.values if limit else 1.0 / branch.values) * unit
    assert branch.states[:, 0] == pytest.approx(wanted, rel=1e-6)
    assert len(branch.special_points) == 0


def test_the_way_to_infinity_on_one_side_leaves_the_other_side_as_it_was():
    system = fields.system({"x": "p*x - 1 - h*(p - 3)*x**2/100"}, {"p": 1.0, "h": 0.0})
    rest = find_equilibrium(system, x0=[1.0])
    both = continue_equilibrium(rest, "p", (-1.0, 4.0))
    alone = continue_equilibrium(rest, "p", (-1.0, 4.0), directions="up")
    assert np.array_equal(both.states[-len(alone) :], alone.states)


def test_a_fold_far_from_a_tiny_start_is_no_way_to_infinity():
    branch = _branch({"x": "p - x + x**2/4"}, {"p": 1e-7}, [1e-7], "p", (0.0, 2.0))
    assert fields.places(branch.special_points, "p") == [("SN", pytest.approx(1.0, abs=1e-12))]
    assert [end.split(": ")[1] for end in branch.stopped] == ["bound reached"] * 2


def test_a_parameter_that_rests_on_the_way_to_infinity_does_not_turn():
    branch = _branch({"x": "r*(1 - exp(x/20)) - 0.1", "y": "x - y"}, {"r": 1.0}, [-1.0, -1.0], "r", (-1.0, 2.0))
    assert branch.stopped[0].endswith("the equilibrium grows without bound")
    assert branch.values[0] == pytest.approx(0.1, abs=1e-9)
    assert len(branch.special_points) == 0


@pytest.mark.parametrize("power", [2, 4])
def test_a_flat_fold_is_found_where_the_parameter_rests_for_a_while(power):
    branch = _branch({"x": f"mu - x**{power}"}, {"mu": 1.0}, [1.0], "mu", (-1.0, 2.0))
    assert fields.places(branch.special_points, "mu") == [("SN", pytest.approx(0.0, abs=1e-10))]
