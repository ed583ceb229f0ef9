"""Special points of branches against closed forms: carried maps, impact oscillator, ball on a table."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy.optimize import brentq

import systems
from oracles.closed_forms import (
    CIRCLE,
    CUSP,
    DELAYED,
    HENON,
    LOGISTIC,
    ImpactOrbit,
    TableJump,
    henon_fixed_point,
    henon_two_cycle,
    logistic_cycle,
)
from saltus import HybridSystem, Mode, StepControl, continue_orbit, solve_orbit

MAP = 1e-10
"""Maps are carried without error of integration: simple zeros are located to rounding, grown by conditioning."""

STEPS = [StepControl(largest=0.05), None, StepControl(largest=0.2)]


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    """The orbit through the given points of a carried map."""
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


def found(branch, *types):
    """(type, parameter) of the special points of the given types (of all), in order along the branch."""
    return [(p.type, p.parameters[branch.parameter]) for p in branch.special_points if not types or p.type in types]


def values(branch, kind):
    return sorted(value for _, value in found(branch, kind))


def assert_points(branch, expected, tolerance):
    """The branch has exactly the expected special points, {type: parameters}."""
    kinds = {kind for kind, _ in found(branch)} | set(expected)
    for kind in kinds:
        got, wanted = values(branch, kind), sorted(expected.get(kind, []))
        assert len(got) == len(wanted), f"{kind}: {got}, not {wanted}"
        np.testing.assert_allclose(got, wanted, rtol=0.0, atol=tolerance, err_msg=kind)


# maps


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("b", [0.3, -0.4, 0.0])
def test_henon_fold_and_doubling(b, steps):
    system = carried(HENON, a=0.2, b=b)
    x = henon_fixed_point(0.2, b)
    branch = continue_orbit(cycle(system, [(x, x)]), "a", (-1.0, 1.5), steps=steps)
    assert_points(branch, {"SN": [-((1 - b) ** 2) / 4], "PD": [3 * (1 - b) ** 2 / 4]}, MAP)
    assert branch.stopped == ("a = 1.5: bound reached", "a = 1.5: bound reached")
    upper = branch.x0[:, 0] > -(1 - b) / 2
    np.testing.assert_array_equal(branch.stable, upper & (branch.values < 3 * (1 - b) ** 2 / 4))


@pytest.mark.parametrize("b", [0.3, -0.2])
def test_doubling_of_henons_two_cycle(b):
    start = 3 * (1 - b) ** 2 / 4 + 0.1
    x, y = henon_two_cycle(start, b)
    orbit = cycle(carried(HENON, a=start, b=b), [(x, y), (y, x)])
    branch = continue_orbit(orbit, "a", (3 * (1 - b) ** 2 / 4 + 0.02, 2.0))
    assert_points(branch, {"PD": [(1 - b) ** 2 + (1 + b) ** 2 / 4]}, MAP)


def test_logistic_three_cycle_folds_at_one_plus_root_eight():
    branch = continue_orbit(cycle(carried(LOGISTIC, a=3.835), logistic_cycle(3.835, 3)), "a", (3.8, 3.9))
    np.testing.assert_allclose(values(branch, "SN"), [1.0 + math.sqrt(8.0)], atol=MAP)
    assert [kind for kind, _ in found(branch)] in (["SN", "PD"], ["PD", "SN"])


@pytest.mark.parametrize("period", [2, 4])
def test_a_cycle_that_shrinks_onto_its_parent_meets_a_branch_point_and_no_fold(period):
    parent = {2: 3.0, 4: 1.0 + math.sqrt(6.0)}[period]
    a = parent + 0.05
    branch = continue_orbit(cycle(carried(LOGISTIC, a=a), logistic_cycle(a, period)), "a", (parent - 0.3, a + 0.01))
    np.testing.assert_allclose(values(branch, "BP"), [parent], atol=1e-9)
    assert not found(branch, "SN")


@pytest.mark.parametrize("c", [-0.5, 0.0, 0.5, 1.2, 1.5, 2.5])
def test_torus_doubling_and_transcritical_points_of_the_delayed_map(c):
    orbit = cycle(carried(DELAYED, a=1.5, c=c), [(1 / 3, 1 / 3)])
    branch = continue_orbit(orbit, "a", (0.5, 6.0))
    expected = {"BP": [1.0], "TR": [2.0 + c]}
    if 2 * c - 1 > 0.5:
        expected["PD"] = [2 * c - 1]
    assert_points(branch, expected, 1e-9)
    pair = branch["TR1"].orbit.multipliers
    assert pair[0].real == pytest.approx((1 - c) / 2, abs=1e-8)
    assert abs(pair[0]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(("c", "bounds"), [(-0.9, (1.02, 1.5)), (2.9, (4.82, 6.0))])
def test_torus_points_near_the_strong_resonances(c, bounds):
    """Close to R1 (angle 0) and to R2 (angle pi), where the pair is about to meet."""
    a = bounds[0] + 0.01
    x = 1.0 - 1.0 / a
    branch = continue_orbit(cycle(carried(DELAYED, a=a, c=c), [(x, x)], a=a), "a", bounds)
    assert_points(branch, {"TR": [2.0 + c]}, 1e-9)


@pytest.mark.parametrize("steps", STEPS)
def test_cusp_family_folds_and_nothing_else(steps):
    branch = continue_orbit(cycle(carried(CUSP, r=0.0, h=1.5), [math.sqrt(0.5)]), "r", (-0.2, 0.2), steps=steps)
    fold = 2 * (0.5 / 3) ** 1.5
    assert fold == pytest.approx(0.136082763488, abs=5e-13)
    assert_points(branch, {"SN": [-fold, fold]}, MAP)


@pytest.mark.campaign
@pytest.mark.parametrize("k", [0.5, 2.0])
@pytest.mark.parametrize("start", [0.0, 0.6, -0.9])
@pytest.mark.parametrize("directions", ["both", "up", "down"])
def test_an_isola_is_traced_once_and_closed(k, start, directions):
    x = math.sqrt(1 - start**2)
    orbit = cycle(carried(CIRCLE, p=start, k=k), [x], p=start)
    branch = continue_orbit(orbit, "p", (-3.0, 3.0), directions=directions)
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    expected = {"SN": [-1.0, 1.0]}
    if k == 2.0:  # multiplier 1 - 2 k x = -1 at x = 1/k
        expected["PD"] = [-math.sqrt(0.75), math.sqrt(0.75)]
    assert_points(branch, expected, MAP)
    angle = np.unwrap(np.arctan2(branch.x0[:, 0], branch.values))
    assert np.ptp(angle) == pytest.approx(2 * math.pi, abs=1e-9)
    assert (np.diff(angle) > 0).all() or (np.diff(angle) < 0).all()


def test_an_isola_of_a_forced_system_is_traced_once():
    """The motion x = R + sin s of a field made for it, R^2 + p^2 = 1."""
    inner = "(x - sin(s)/w)"
    system = HybridSystem(
        ("x",), {"p": 0.0, "w": 1.0}, {"m": Mode({"x": f"0.2*(1 - {inner}**2 - p**2) + cos(s)"})}, phase=("s", "w")
    )
    orbit = solve_orbit(system, {}, [("m", "s", [0.9], 6.28)])
    assert orbit.x0[0] == pytest.approx(1.0, abs=1e-10)
    branch = continue_orbit(orbit, "p", (-3.0, 3.0))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert_points(branch, {"SN": [-1.0, 1.0]}, 1e-9)
    np.testing.assert_allclose(np.hypot(branch.x0[:, 0], branch.values), 1.0, atol=1e-9)
    np.testing.assert_allclose(branch.multipliers[:, 0].real, np.exp(-0.8 * math.pi * branch.x0[:, 0]), rtol=1e-7)


# impact oscillator

TABLE = [
    (0.7, 1, 0.5147815070, None, 0.5268502150),
    (1.1, 1, 0.2370653918, 0.1164430069, 4.2445655745),
    (1.4, 1, 0.9701546269, 0.2817865778, None),
    (2.2, 1, 3.8462969204, None, 4.2698557270),
    (2.5, 2, 5.2559490104, 0.8324886906, 2.1363797554),
    (1.4, 2, 0.9701546269, None, 1.0676593232),
]


def impact_orbit(w, m, U):
    form = ImpactOrbit(w, m)
    parameters = {"w": w, "A": form.amplitude(U)}
    return solve_orbit(systems.impact_oscillator(), parameters, [("free", "impact", form.after_impact(U), form.period)])


def primary(branch):
    """Special points of the orbit with one impact: later grazings add impacts, for which there is no closed form."""
    return [p for p in branch.special_points if len(p.orbit.signature) == 1]


def test_the_table_is_the_closed_form():
    for w, m, grazing, fold, doubling in TABLE:
        form = ImpactOrbit(w, m)
        assert form.A_grazing == pytest.approx(grazing, abs=5.1e-11)
        if fold:
            assert form.amplitude(form.U_fold) == pytest.approx(fold, abs=5.1e-11)
        if doubling:
            assert form.amplitude(form.U_doubling) == pytest.approx(doubling, abs=5.1e-11)
        assert (form.U_fold > 0) == bool(fold)
        assert (form.U_doubling > 0) == bool(doubling)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize(("w", "m", "grazing", "fold", "doubling"), TABLE)
def test_impact_branch_has_the_points_of_the_table(w, m, grazing, fold, doubling, steps):
    form = ImpactOrbit(w, m)
    start = impact_orbit(w, m, 1.5 * max(0.3, form.U_fold))
    branch = continue_orbit(start, "A", (0.01, 1.1 * max(doubling or 0.0, grazing)), steps=steps)
    points = primary(branch)
    for kind, value in (
        ("SN", form.amplitude(form.U_fold) if fold else None),
        ("PD", form.amplitude(form.U_doubling) if doubling else None),
    ):
        got = [p.parameters["A"] for p in points if p.type == kind]
        np.testing.assert_allclose(got, [value] if value else [], atol=1e-9, rtol=0.0, err_msg=kind)
    touching = [p for p in points if p.type == "GR" and abs(p.orbit.max["x"] - 1.0) < 1e-6]
    assert min(abs(p.parameters["A"] - form.A_grazing) for p in touching) < 1e-9


def test_past_the_grazing_equations_have_solutions_that_are_no_motion():
    form = ImpactOrbit(1.0)
    branch = continue_orbit(
        impact_orbit(1.0, 1, 0.5), "A", (0.05, 1.0), steps=StepControl(at_grazing="pass"), directions="down"
    )
    speed = np.array([-u[1] / 0.8 for u in branch.unknowns])
    np.testing.assert_allclose([form.amplitude(U) for U in speed], branch.values, atol=1e-9)
    assert (speed < -1e-3).any()
    np.testing.assert_array_equal(branch.admissible[np.abs(speed) > 1e-9], (speed > 0)[np.abs(speed) > 1e-9])
    assert all(len(branch.signature(i)) == 1 for i in range(len(branch)))


@pytest.mark.parametrize(("w", "m"), [(1.0, 1), (1.1, 1), (1.4, 1), (2.5, 1)])
def test_beyond_the_grazing_the_motion_is_the_linear_response(w, m):
    form = ImpactOrbit(w, m)
    branch = continue_orbit(impact_orbit(w, m, 0.4), "A", (0.01, 1.2 * max(form.A_grazing, form.amplitude(0.4))))
    free = [i for i in range(len(branch)) if branch.signature(i) == (("free", "theta"),)]
    assert len(free) > 2
    for i in free:
        peak, x0 = form.linear_response(branch.values[i])
        np.testing.assert_allclose(branch.x0[i], x0, atol=1e-9)
        assert branch.column("max_x")[i] == pytest.approx(peak, abs=1e-9)
        np.testing.assert_allclose(np.abs(branch.multipliers[i]), math.exp(-0.05 * form.period), atol=1e-9)
    assert branch.stopped[0] == "A = 0.01: bound reached" or branch.stopped[1] == "A = 0.01: bound reached"


@pytest.mark.parametrize("w", [1.0, 1.1, 1.4])
def test_from_a_motion_without_impacts_the_branch_goes_through_the_grazing_to_the_impact_orbit(w):
    form = ImpactOrbit(w)
    A = 0.5 * form.A_grazing
    free = solve_orbit(
        systems.impact_oscillator(),
        {"w": w, "A": A},
        [("free", "theta", form.linear_response(A)[1] * 1.2, form.period)],
    )
    assert free.max["x"] == pytest.approx(0.5, abs=1e-10)
    branch = continue_orbit(free, "A", (0.2 * form.A_grazing, 2.0), directions="up")
    assert branch["GR1"].parameters["A"] == pytest.approx(form.A_grazing, abs=1e-9)
    assert branch["SN1"].parameters["A"] == pytest.approx(form.amplitude(form.U_fold), abs=1e-9)
    assert branch.stopped[1] == "A = 2: bound reached"
    hit = [i for i in range(len(branch)) if branch.signature(i) == (("free", "impact"),)]
    for i in hit:
        U = -branch.unknowns[i][1] / 0.8
        assert form.amplitude(U) == pytest.approx(branch.values[i], abs=1e-9)


def roots(function, low, high):
    grid = np.linspace(low, high, 400)
    known = [function(x) for x in grid]
    ends = [i for i in range(len(grid) - 1) if known[i] * known[i + 1] < 0.0 and abs(known[i] - known[i + 1]) < 1.0]
    return [brentq(function, grid[i], grid[i + 1], xtol=1e-14) for i in ends]


@pytest.mark.parametrize(
    ("w", "A", "bounds"), [(1.1, 0.18, (1.02, 1.3)), (2.2, 4.5, (2.05, 2.6)), (0.7, 0.53, (0.68, 0.75))]
)
def test_branch_in_frequency_has_the_points_of_the_closed_form(w, A, bounds):
    branch = continue_orbit(impact_orbit(w, 1, ImpactOrbit(w).speeds(A)[1]), "w", bounds)
    closed = {
        "SN": roots(lambda x: ImpactOrbit(x).amplitude(ImpactOrbit(x).U_fold) - A, *bounds),
        "PD": roots(lambda x: ImpactOrbit(x).amplitude(ImpactOrbit(x).U_doubling) - A, *bounds),
        "GR": roots(lambda x: ImpactOrbit(x).A_grazing - A, *bounds),
    }
    points = [p for p in primary(branch) if p.type != "GR" or abs(p.orbit.segments[0].state[1]) < 1e-6]
    assert points
    for p in points:
        assert min(abs(p.parameters["w"] - x) for x in closed[p.type]) < 1e-8, (
            p.type,
            p.parameters["w"],
            closed[p.type],
        )


# ball on a table


@pytest.mark.parametrize("saddle", [False, True])
@pytest.mark.parametrize(
    ("e", "n", "fold", "doubling"), [(0.5, 1, 1.047197551197, 1.526823700519), (0.8, 2, 0.698131700798, 1.229728281156)]
)
def test_table_jumps_fold_and_double_where_the_closed_form_says(e, n, fold, doubling, saddle):
    form = TableJump(e, n)
    a = 1.1 * form.fold
    x = form.after_impact(a, saddle)
    orbit = solve_orbit(systems.ball_on_table(), {"e": e, "a": a}, [("flight", "impact", x, 2 * math.pi * n)])
    branch = continue_orbit(orbit, "a", (0.5 * fold, 1.2 * doubling))
    assert_points(branch, {"SN": [fold], "PD": [doubling]}, 1e-10 + 5e-13)


# what a call can ask for


def test_bounds_are_hit_exactly():
    branch = continue_orbit(cycle(carried(LOGISTIC, a=2.5), [0.6]), "a", (2.1, 2.9))
    assert branch.values[0] == pytest.approx(2.1, abs=1e-14)
    assert branch.values[-1] == pytest.approx(2.9, abs=1e-14)
    assert branch.stopped == ("a = 2.1: bound reached", "a = 2.9: bound reached")
    assert (np.diff(branch.values) > 0).all()
    assert (np.diff(branch.arclength) > 0).all()


def test_a_start_on_a_bound_goes_inwards_only():
    orbit = cycle(carried(LOGISTIC, a=2.5), [0.6])
    branch = continue_orbit(orbit, "a", (2.5, 2.9))
    assert branch.values.min() == pytest.approx(2.5, abs=1e-12)
    assert branch.values.max() == pytest.approx(2.9, abs=1e-14)
    branch = continue_orbit(orbit, "a", (2.1, 2.5))
    assert branch.values.max() == pytest.approx(2.5, abs=1e-12)
    assert branch.values.min() == pytest.approx(2.1, abs=1e-14)


@pytest.mark.parametrize(("directions", "low", "high"), [("up", 2.5, 2.9), ("down", 2.1, 2.5), ("both", 2.1, 2.9)])
def test_directions(directions, low, high):
    branch = continue_orbit(cycle(carried(LOGISTIC, a=2.5), [0.6]), "a", (2.1, 2.9), directions=directions)
    assert branch.values.min() == pytest.approx(low, abs=1e-14)
    assert branch.values.max() == pytest.approx(high, abs=1e-14)
    if directions != "both":
        assert branch.values[0] == 2.5
        assert branch.stopped[0] == "the start"


def test_events_on_extremes_and_parameter_are_located():
    form = ImpactOrbit(1.4)
    free = solve_orbit(
        systems.impact_oscillator(),
        {"w": 1.4, "A": 0.3},
        [("free", "theta", form.linear_response(0.3)[1], form.period)],
    )
    events = {"max_x": 0.5, "min_v": -0.35, "A": 0.77, "x": 0.6}
    branch = continue_orbit(free, "A", (0.1, 0.9), events=events)
    Z = form.impedance
    assert values(branch, "max_x") == pytest.approx([0.5 * Z], abs=1e-9)
    assert values(branch, "min_v") == pytest.approx([0.25 * Z], abs=1e-9)
    assert values(branch, "A") == pytest.approx([0.77], abs=1e-9)
    assert values(branch, "x") == pytest.approx([0.6 * Z], abs=1e-9)


def test_stop_at_ends_the_branch_there():
    x = henon_fixed_point(0.2, 0.3)
    orbit = cycle(carried(HENON, a=0.2, b=0.3), [(x, x)])
    branch = continue_orbit(orbit, "a", (-1.0, 1.0), stop_at="PD", directions="up")
    assert branch.values[-1] == pytest.approx(0.3675, abs=MAP)
    assert branch.stopped[1] == "a = 0.3675: PD"
    both = continue_orbit(orbit, "a", (-1.0, 1.0), stop_at=("PD", "SN"))
    assert both.stopped == ("a = -0.1225: SN", "a = 0.3675: PD")
    at_event = continue_orbit(orbit, "a", (-1.0, 1.0), events={"a": 0.3}, stop_at="a", directions="up")
    assert at_event.values[-1] == pytest.approx(0.3, abs=1e-9)


def test_rejected_steps_say_why():
    x = henon_fixed_point(0.2, 0.3)
    orbit = cycle(carried(HENON, a=0.2, b=0.3), [(x, x)])
    branch = continue_orbit(orbit, "a", (-1.0, 1.0), steps=StepControl(initial=0.8, largest=0.8, deviation=1e-4))
    assert branch.rejected
    reasons = "(Newton|angle|deviation|folds|events|location|stability|not admissible)"
    for line in branch.rejected:
        assert re.fullmatch(r"a = [-+.e\d]+, step [-+.e\d]+: " + reasons + r"\b.+", line)
    assert_points(branch, {"SN": [-0.1225], "PD": [0.3675]}, MAP)


def test_rejected_steps_name_the_parameter_in_its_own_units():
    orbit = cycle(carried(LOGISTIC, a=2.5), [0.6])
    branch = continue_orbit(orbit, "a", (2.0, 3.9), steps=StepControl(initial=1.0, largest=1.0, deviation=1e-5))
    where = [float(re.search(r"a = ([-+.e\d]+),", line)[1]) for line in branch.rejected]
    assert where
    assert all(2.0 <= value <= 3.9 for value in where)


def test_the_residual_of_a_branch_is_that_of_its_points():
    branch = continue_orbit(impact_orbit(2.2, 1, 0.5), "A", (1.0, 6.0))
    own = [branch.solution(i).residual for i in range(0, len(branch), 7)]
    np.testing.assert_array_less(branch.residual, 1e-10)
    np.testing.assert_array_less(own, 1e-10)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 1.0])
def test_any_orbit_of_a_branch_leads_to_the_same_special_points(share):
    start = impact_orbit(1.1, 1, 0.5)
    bounds = (0.1, 5.0)
    whole = continue_orbit(start, "A", bounds)
    again = continue_orbit(whole.solution(round(share * (len(whole) - 1))), "A", bounds)
    for kind in ("SN", "PD", "GR"):
        np.testing.assert_allclose(values(again, kind), values(whole, kind), atol=1e-8)
    form = ImpactOrbit(1.1)
    expected = {"GR": [form.A_grazing], "SN": [form.amplitude(form.U_fold)], "PD": [form.amplitude(form.U_doubling)]}
    assert_points(whole, expected, 1e-8)


@pytest.mark.parametrize("label", ["SN1", "PD1", "GR1"])
def test_special_points_orbits_lead_to_the_same_special_points(label):
    bounds = (0.1, 5.0)
    whole = continue_orbit(impact_orbit(1.1, 1, 0.5), "A", bounds)
    again = continue_orbit(whole[label].orbit, "A", bounds)
    others = {kind: values(whole, kind) for kind in ("SN", "PD", "GR") if kind != label[:2]}
    for kind, expected in others.items():
        np.testing.assert_allclose(values(again, kind), expected, atol=1e-8)
    low, high = again.values.min(), again.values.max()
    assert (low, high) == pytest.approx((0.1, 5.0))


@pytest.mark.parametrize("bounds", [(0.01, 10.0), (0.01, 15.0), (0.01, 20.0)])
def test_special_points_do_not_depend_on_bounds_or_steps(bounds):
    form = ImpactOrbit(2.5, 2)
    start = impact_orbit(2.5, 2, 1.2)
    for steps in STEPS:
        branch = continue_orbit(start, "A", bounds, steps=steps)
        points = [p for p in primary(branch) if p.type in ("SN", "PD")]
        got = {p.type: p.parameters["A"] for p in points}
        assert got["SN"] == pytest.approx(form.amplitude(form.U_fold), abs=1e-10)
        assert got["PD"] == pytest.approx(form.amplitude(form.U_doubling), abs=1e-10)


@pytest.mark.parametrize("top", [15.0, 20.0])
def test_a_branch_that_comes_back_to_a_grazing_goes_through_it(top):
    """Two impacts become equal where the period halves; the other way one fades, and the other is once more halved."""
    branch = continue_orbit(impact_orbit(2.5, 2, 1.2), "A", (0.01, top))
    once = ImpactOrbit(2.5)
    birth = once.amplitude(once.U_doubling)
    assert values(branch, "BP") == pytest.approx([birth], abs=1e-10)
    assert min(abs(value - birth) for value in values(branch, "PD")) < 1e-10
    assert set(branch.stopped) == {f"A = {top:.9g}: bound reached", f"A = {birth:.9g}: the period halves"}
    grazings = [p for p in branch.special_points if p.type == "GR"]
    assert grazings
    assert all(min(-s.state[1] for s in p.orbit.segments) < 1e-5 or abs(p.orbit.max["x"] - 1) < 1e-8 for p in grazings)


def test_multipliers_at_a_doubling_hold_minus_one_however_many_impacts():
    form = TableJump(0.5)
    x = form.after_impact(1.15)
    orbit = solve_orbit(systems.ball_on_table(), {"a": 1.15}, [("flight", "impact", x, 2 * math.pi)])
    branch = continue_orbit(orbit, "a", (1.0, 3.0), directions="up", steps=StepControl(max_points=150))
    for point in branch.special_points:
        wanted = {"PD": -1.0, "SN": 1.0}.get(point.type)
        if wanted:
            assert np.abs(point.orbit.multipliers - wanted).min() < 1e-8, point
            assert abs(point.test) < 1e-8, point
            # the determinant is e^2 at each impact: volume is lost there and nowhere else
            assert abs(np.prod(point.orbit.multipliers)) == pytest.approx(0.25 ** len(point.orbit.segments), rel=1e-3)
