"""Branches of cycles whose period grows without bound: HOM, SNIC, long cycles, and words where neither is located."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import saltus
from saltus.continuation import Branch
from saltus.continuation.problems.ends.homoclinic_problem import saddle_node_near
from saltus.equilibria.problem import EquilibriumProblem
from saltus.system import HybridSystem, Mode
from selection import guarding

LORENZ = {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
TAKENS = {"x": "y", "y": "b1 + b2*x/t**2 + x**2/(l*t**2) - x*y/(l*t)"}
JERK = {"x": "y", "y": "z", "z": "-z - b*y + a*x*(1 - x)"}
SANDSTEDE = {
    "x": "a*x + b*y - a*x**2 + mut*x*(2 - 3*x)",
    "y": "b*x + a*y - 1.5*b*x**2 - 1.5*a*x*y - 2*mut*y",
    "z": "c*z",
}
MEMBRANE = {
    "V": "(I - 2*(V + 60) - 2*(1 + tanh((V + 1.2)/18))*(V - 120) - 8*w*(V + 84))/20",
    "w": "phi*(0.5*(1 + tanh((V - 12)/17.4)) - w)*cosh((V - 12)/34.8)",
}


def branch_of(
    field: Mapping[str, str],
    parameters: dict[str, float],
    parameter: str,
    bounds: tuple[float, float],
    rest: list[float],
) -> Branch:
    """Return the branch of cycles born at the first Hopf point of an equilibrium near `rest`."""
    system = HybridSystem(tuple(field), parameters, {"flow": Mode(dict(field))})
    equilibria = saltus.continue_equilibrium(saltus.find_equilibrium(system, {}, rest), parameter, bounds)
    return saltus.continue_orbit(saltus.switch_branch(equilibria["HB1"]), parameter, bounds)


def takens(time: float = 1.0, length: float = 1.0) -> Branch:
    """Return the cycles of the Bogdanov-Takens normal form in units of time and length."""
    unit = length / time**2
    given = {"b1": -0.1 * unit, "b2": -1.0, "t": time, "l": length}
    return branch_of(TAKENS, given, "b1", (-unit, 0.2 * unit), [-0.1 * length, 0.0])


def bisected(turns_left: Callable[[float], bool], low: float, high: float) -> float:
    """Return the value between two at which an unstable manifold changes the side to which it leaves its saddle."""
    left = turns_left(low)
    assert left != turns_left(high)
    for _ in range(45):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if turns_left(middle) == left else (low, middle)
    return 0.5 * (low + high)


def left_first(
    f: Callable[..., list[float]], start: list[float], left: float, right: float, after: float, longest: float
) -> bool:
    """Return whether, after a time, a motion comes to x = `left` before x = `right`."""

    def out(t: float, x: np.ndarray) -> float:
        return 1.0 if t < after else (x[0] - left) * (right - x[0])

    out.terminal, out.direction = True, -1.0  # type: ignore[attr-defined]
    motion = solve_ivp(f, (0.0, longest), start, "DOP853", rtol=1e-13, atol=1e-15, events=out)
    assert motion.status == 1
    return bool(abs(motion.y[0, -1] - left) < abs(motion.y[0, -1] - right))


@pytest.fixture(scope="module")
def lorenz() -> Branch:
    return branch_of(LORENZ, {"sigma": 10.0, "r": 15.0, "b": 8 / 3}, "r", (0.0, 30.0), [6.0, 6.0, 14.0])


@pytest.fixture(scope="module")
def planar() -> Branch:
    return takens()


@pytest.mark.campaign
def test_lorenz_homoclinic_orbit_is_that_in_print(lorenz: Branch) -> None:
    point = lorenz["HOM1"]
    assert point.parameters["r"] == pytest.approx(13.926557407520, abs=2e-11)
    root = math.sqrt(81.0 + 40.0 * point.parameters["r"])
    known = [0.5 * (root - 11.0), -8 / 3, 0.5 * (-root - 11.0)]
    assert point.homoclinic is not None
    np.testing.assert_allclose(point.homoclinic.eigenvalues, known, rtol=1e-10)
    assert point.homoclinic.saddle_quantity == pytest.approx(known[0] + known[1])
    assert not point.homoclinic.saddle_focus
    assert not point.homoclinic.chaos
    np.testing.assert_allclose(point.equilibrium.state, 0.0, atol=1e-12)
    assert repr(point).startswith("SpecialPoint HOM1, homoclinic orbit, test function")


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["lorenz", "planar"])
def test_cycles_become_a_thousand_times_as_long_with_a_bounded_residual(
    name: str, request: pytest.FixtureRequest
) -> None:
    branch: Branch = request.getfixturevalue(name)
    assert branch.period.max() == pytest.approx(1e3 * branch.period[-1], rel=1e-3)
    assert np.all(np.diff(branch.period[:9]) < 0.0)
    assert np.all(np.diff(branch.arclength) > 0.0)
    sizes = np.abs(branch.highs - branch.lows).max(axis=1)
    assert np.all(branch.residual[:-1] <= 1e-8 * sizes[:-1])  # the last is the Hopf point
    assert branch["HOM1"].orbit.period == pytest.approx(branch.period[0])
    assert branch.stopped[0].endswith(f"the period grows without bound (T = {branch.period[0]:.6g})")


@pytest.mark.campaign
def test_long_cycles_multiplier_grows_like_the_saddle_quantity(planar: Branch) -> None:
    sigma = planar["HOM1"].homoclinic.saddle_quantity  # type: ignore[union-attr]
    first, second = (int(np.flatnonzero(planar.period > T)[-1]) for T in (30.0, 20.0))
    logs = np.log(np.abs(planar.multipliers[[first, second], 0]))
    slope = (logs[0] - logs[1]) / (planar.period[first] - planar.period[second])
    assert slope == pytest.approx(sigma, rel=0.02)
    assert np.all(np.abs(planar.multipliers[:4, 0]) < 1e-30)


@pytest.mark.campaign
def test_planar_homoclinic_orbit_is_where_the_unstable_manifold_closes(planar: Branch) -> None:
    def inwards(b1: float) -> bool:
        saddle = 0.5 + math.sqrt(0.25 - b1)
        rate = 0.5 * (-saddle + math.sqrt(saddle**2 + 4.0 * (2.0 * saddle - 1.0)))
        start = [saddle - 1e-6, -1e-6 * rate]
        return left_first(
            lambda _, x: [x[1], b1 - x[0] + x[0] ** 2 - x[0] * x[1]], start, 0.5, saddle + 0.1, 23.0, 90.0
        )

    known = bisected(inwards, -0.2137, -0.2135)
    assert planar["HOM1"].parameters["b1"] == pytest.approx(known, abs=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize(("time", "length"), [(1e-3, 1e6), (1e4, 1e-5)])
def test_units_of_time_and_length_change_no_homoclinic_orbit(planar: Branch, time: float, length: float) -> None:
    point, known = takens(time, length)["HOM1"], planar["HOM1"]
    assert point.parameters["b1"] * time**2 / length == pytest.approx(known.parameters["b1"], rel=1e-9)
    np.testing.assert_allclose(point.equilibrium.state[0] / length, known.equilibrium.state[0], rtol=1e-9)


def test_sandstede_homoclinic_orbit_is_exact() -> None:
    parameters = {"a": -0.3, "b": 1.0, "c": -2.0, "mut": 0.1}
    point = branch_of(SANDSTEDE, parameters, "mut", (-0.5, 0.5), [0.7, 0.0, 0.0])["HOM1"]
    assert point.parameters["mut"] == pytest.approx(0.0, abs=1e-11)
    np.testing.assert_allclose(sorted(point.equilibrium.eigenvalues.real), [-2.0, -1.3, 0.7], rtol=1e-9)
    x, y = point.orbit.max["x"], point.orbit.max["y"]
    assert x == pytest.approx(1.0, abs=1e-9)  # of the curve x^2 (1 - x) = y^2
    assert y == pytest.approx(2.0 / math.sqrt(27.0), abs=1e-9)


@pytest.mark.campaign
def test_two_unstable_directions_change_neither_the_parameter_nor_the_longest_period() -> None:
    field = SANDSTEDE | {"w": "-3*w"}
    parameters = {"a": -0.3, "b": 1.0, "c": 2.0, "mut": 0.1}
    branch = branch_of(field, parameters, "mut", (-0.5, 0.5), [0.7, 0.0, 0.0, 0.0])
    point = branch["HOM1"]
    assert point.parameters["mut"] == pytest.approx(0.0, abs=1e-11)
    assert point.equilibrium.kind == "saddle (2 unstable)"
    assert point.homoclinic is not None
    assert point.homoclinic.leading == (pytest.approx(0.7), pytest.approx(-1.3))
    assert branch.period.max() == pytest.approx(1e3 * branch.period.min(), rel=1e-3)
    assert branch.residual.max() < 1e-8


@pytest.mark.campaign
@pytest.mark.parametrize(("b", "chaos"), guarding([(1.0, False), (2.5, True)], campaign=1))
def test_saddle_focus_is_homoclinic_where_its_unstable_manifold_comes_back(b: float, chaos: bool) -> None:
    point = branch_of(JERK, {"a": 0.9 * b, "b": b}, "a", (0.2, 9.0), [1.0, 0.0, 0.0])["HOM1"]

    def leaves(a: float) -> bool:
        rate = max(np.roots([1.0, 1.0, b, -a]).real)
        start = [1e-7, 1e-7 * rate, 1e-7 * rate**2]
        return left_first(
            lambda _, x: [x[1], x[2], -x[2] - b * x[1] + a * x[0] * (1.0 - x[0])], start, -0.2, 0.2, passed, 200.0
        )

    # time at which the unstable manifold has come near the saddle again
    a = point.parameters["a"]
    rate = max(np.roots([1.0, 1.0, b, -a]).real)
    passed = math.log(1e7) / rate + 8.0
    known = bisected(leaves, a - 1e-4, a + 1e-4)
    assert a == pytest.approx(known, abs=1e-8)
    assert point.homoclinic is not None
    assert point.homoclinic.saddle_focus
    assert point.homoclinic.chaos is chaos
    assert ("Shilnikov" in repr(point)) is chaos


def membrane(phi: float) -> Branch:
    return branch_of(MEMBRANE, {"I": 60.0, "phi": phi}, "I", (-100.0, 300.0), [0.0, 0.2])


@pytest.mark.campaign
def test_membrane_of_class_one_ends_at_the_saddle_node_on_a_circle() -> None:
    def current(V: float) -> float:
        w = 0.5 * (1.0 + math.tanh((V - 12.0) / 17.4))
        return 2 * (V + 60) + 2 * (1 + math.tanh((V + 1.2) / 18)) * (V - 120) + 8 * w * (V + 84)

    fold = minimize_scalar(lambda V: -current(V), bounds=(-50.0, -20.0), method="bounded", options={"xatol": 1e-9})
    branch = membrane(0.067)
    (point,) = branch.special_points.of_type("SNIC")
    assert not branch.special_points.of_type("HOM")
    assert point.parameters["I"] == pytest.approx(-fold.fun, abs=1e-9)
    assert point.equilibrium.state[0] == pytest.approx(fold.x, abs=1e-5)
    assert "saddle-node on an invariant circle" in repr(point)
    assert any("the period grows without bound" in text for text in branch.stopped)


@pytest.mark.campaign
def test_membrane_that_spikes_slowly_ends_at_a_homoclinic_orbit() -> None:
    point = membrane(0.23)["HOM1"]
    saddle = point.equilibrium

    def field(_: float, x: np.ndarray, current: float) -> list[float]:
        V, w = x
        rise = current - 2 * (V + 60) - 2 * (1 + math.tanh((V + 1.2) / 18)) * (V - 120) - 8 * w * (V + 84)
        return [rise / 20, 0.23 * (0.5 * (1 + math.tanh((V - 12) / 17.4)) - w) * math.cosh((V - 12) / 34.8)]

    def gap(current: float) -> float:
        """Return how far apart both manifolds of the saddle pass V = 5 on the way down."""
        V = brentq(lambda V: field(0.0, [V, 0.5 * (1 + math.tanh((V - 12) / 17.4))], current)[0], -26.0, -19.0)
        x = np.array([V, 0.5 * (1 + math.tanh((V - 12) / 17.4))])
        A = np.column_stack(
            [np.subtract(field(0.0, x + e, current), field(0.0, x - e, current)) for e in np.eye(2) * 1e-5]
        )
        values, vectors = np.linalg.eig(A / 2e-5)
        ends = []
        for k, sign, direction in ((np.argmax(values), 1.0, -1.0), (np.argmin(values), -1.0, 1.0)):
            way = vectors[:, k] * np.sign(vectors[0, k])
            # the unstable manifold leaves towards larger V; the stable one comes from smaller V or from above
            start = x + 1e-5 * way * (1.0 if sign > 0 else -np.sign(way[0]) * (1.0 if way[1] < 0 else -1.0))

            def passes(t: float, y: np.ndarray, *_: float) -> float:
                return y[0] - 5.0

            passes.terminal, passes.direction = True, direction  # type: ignore[attr-defined]
            way_out = solve_ivp(
                field, (0.0, sign * 1e3), start, "DOP853", args=(current,), events=passes, rtol=1e-12, atol=1e-13
            )
            assert way_out.status == 1
            ends.append(way_out.y[1, -1])
        return float(ends[0] - ends[1])

    known = brentq(gap, point.parameters["I"] - 0.01, point.parameters["I"] + 0.01, xtol=1e-12)
    assert point.parameters["I"] == pytest.approx(known, rel=1e-8)
    assert saddle.kind == "saddle (1 unstable)"


@pytest.mark.campaign
def test_end_of_a_branch_of_long_cycles_does_not_hang_on_the_last_bits() -> None:
    branches = [membrane(0.23 * (1.0 + moved)) for moved in (-1e-13, 0.0, 1e-13)]
    known = branches[1]["HOM1"].parameters["I"]
    ends = [(len(branch), branch.stopped) for branch in branches]
    assert ends == ends[:1] * 3
    for branch in branches:
        assert [point.label for point in branch.special_points] == ["HB1", "SN1", "HOM1"]
        assert branch["HOM1"].parameters["I"] == pytest.approx(known, rel=1e-10)
        assert branch.period[-1] == pytest.approx(1e3 * branch.period[0], rel=1e-3)


def test_cycle_with_events_is_told_in_words() -> None:
    crossing = saltus.Transition("m", "m", "y", 1, {}, name="section")
    system = HybridSystem(("x", "y"), {"b1": -0.1}, {"m": Mode({"x": "y", "y": "b1 - x + x**2 - x*y"})}, [crossing])
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[-0.2, 0.0]), "b1", (-1.0, 0.2))
    assert "no homoclinic orbit is located: its cycles have events" in branch.stopped[0]
    assert branch.period.max() > 40.0  # in pieces


def test_heteroclinic_cycle_is_told_in_words() -> None:
    field = {"x": "y", "y": "-x + x**3 + y*(mu - x**2)"}
    branch = branch_of(field, {"mu": -0.1}, "mu", (-0.5, 0.5), [0.0, 0.0])
    (told,) = [text for text in branch.stopped if "without bound" in text]
    assert "no homoclinic orbit is located: the cycle passes near 2 equilibria, as next to a heteroclinic cycle" in told
    assert not branch.special_points.of_type("HOM", "SNIC")


@pytest.mark.campaign
def test_files_keep_the_homoclinic_orbit(planar: Branch, tmp_path: Path) -> None:
    planar.save(tmp_path / "branch.nc")
    again = saltus.load(tmp_path / "branch.nc")
    assert again == planar
    point, known = again["HOM1"], planar["HOM1"]
    assert repr(point) == repr(known)
    assert point.parameters == known.parameters
    assert point.homoclinic.saddle == known.homoclinic.saddle


def test_no_saddle_node_is_near_a_state_whose_rates_are_beyond_all_numbers():
    system = HybridSystem.smooth({"x": "a - exp(x)"}, {"a": 1.0})
    rest = EquilibriumProblem(system, 0, system.parameter_vector({}), (0,), np.ones(1))
    assert saddle_node_near(rest, np.array([1e3]), 1.0, np.ones(1)) is None


@pytest.mark.campaign
def test_orbits_next_to_a_homoclinic_one_are_given():
    cycles = branch_of(LORENZ, {"sigma": 10.0, "b": 8.0 / 3.0, "r": 20.0}, "r", (10.0, 30.0), [7.0, 7.0, 19.0])
    assert [point.type for point in cycles.special_points] == ["HOM", "HB"]
    for index in (0, 1, 2):
        assert np.array_equal(cycles.solution(index).multipliers, cycles.multipliers[index])
