"""Stiff cycles: van der Pol's relaxation oscillation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus
from saltus.orbits import find_orbit
from saltus.orbits.problem import OrbitProblem
from saltus.system import HybridSystem, Mode, Transition
from selection import guarding

PERIOD_AT_1000 = 1614.40112580834


@pytest.fixture(scope="module")
def relaxation() -> HybridSystem:
    return HybridSystem(("x", "y"), {"mu": 1.0}, {"m": Mode({"x": "y", "y": "mu*(1 - x**2)*y - x"})})


@pytest.mark.parametrize(
    ("mu", "period"),
    [
        (1.0, 6.663286859323193), (5.0, 11.612230667718), (20.0, 34.682323311), (100.0, 162.8370710),
        (1000.0, PERIOD_AT_1000),
    ],
)  # fmt: skip
def test_relaxation_oscillation_has_its_period(relaxation: HybridSystem, mu: float, period: float) -> None:
    """The periods are SciPy's, DOP853 and Radau at 1e-11, at mu = 1000 Radau at 1e-12."""
    orbit = find_orbit(relaxation, {"mu": mu}, x0=[2.0, 0.0])
    assert orbit.period == pytest.approx(period, rel=1e-8)
    assert orbit.rounds == 1


def test_multipliers_that_the_flow_cannot_resolve_are_zero(relaxation: HybridSystem) -> None:
    """Their logarithms, integrals of the divergence, are -34.9 at mu = 3 and below -85 from mu = 5 on."""
    assert find_orbit(relaxation, {"mu": 1.0}, x0=[2.0, 0.0]).multipliers[0] == pytest.approx(8.5969506e-4, rel=1e-7)
    for mu in (3.0, 5.0, 20.0):
        assert find_orbit(relaxation, {"mu": mu}, x0=[2.0, 0.0]).multipliers[0] == 0.0


@pytest.fixture(scope="module")
def branch(relaxation: HybridSystem) -> saltus.results.Branch:
    return saltus.continue_orbit(find_orbit(relaxation, x0=[2.0, 0.0]), "mu", (0.01, 1e4))


def test_one_branch_goes_from_a_sine_to_a_stiff_relaxation(branch) -> None:
    assert branch.stopped == ("mu = 0.01: bound reached", "mu = 10000: bound reached")
    assert len(branch.special_points) == 0
    assert len(branch) < 120
    # the series of the period for large mu; what is left is of order mu^(-5/3)
    mu, period = branch.values[branch.values > 300.0], branch.period[branch.values > 300.0]
    series = (3.0 - 2.0 * np.log(2.0)) * mu + 7.014322 * mu ** (-1 / 3) - (2.0 * np.log(mu) / 3.0 + 1.3246) / mu
    assert np.all(np.abs(period - series) <= 2.0 * mu ** (-5 / 3) + 1e-11 * period)


@pytest.mark.parametrize("mu", [50.0, 1000.0])
def test_points_of_a_stiff_branch_are_the_orbits_found_by_simulation(branch, relaxation, mu) -> None:
    near = branch.solution(int(np.argmin(np.abs(branch.values - mu))))
    own = find_orbit(relaxation, near.parameters, x0=[2.0, 0.0])
    assert near.period == pytest.approx(own.period, rel=1e-11)
    np.testing.assert_allclose(near.highs[:2], own.highs[:2], rtol=1e-9)


@pytest.mark.parametrize("k", [1e2, 1e4, 1e8, 1e12])
def test_a_forced_linear_system_has_its_exact_response(k: float) -> None:
    system = HybridSystem(
        ("x", "v"), {"k": k, "w": 1.0}, {"m": Mode({"x": "v", "v": "-k*(v - cos(s)) - k*x"})}, phase=("s", "w")
    )
    orbit = find_orbit(system, x0=[0.0, 0.0])
    response = k / (k - 1.0 + 1j * k)
    np.testing.assert_allclose(orbit.x0, [response.real, (1j * response).real], atol=1e-12)
    slow = -2.0 * k / (k + np.sqrt(k * k - 4.0 * k))
    np.testing.assert_allclose(
        sorted(abs(orbit.multipliers)), [0.0, np.exp(2.0 * np.pi * slow)], rtol=1e-11, atol=1e-12
    )


@pytest.mark.parametrize(("count", "unit"), guarding([(8, 1.0), (12, 1.0), (10, 1e-6), (10, 1e9)], (8, 1.0)))
def test_a_chain_with_rates_over_seven_decades_has_its_exact_response(count: int, unit: float) -> None:
    rates, names = np.logspace(0.0, 7.0, count) / unit, [f"x{i}" for i in range(count)]
    field = {
        name: f"{float(rate)!r}*({before} - {name})"
        for name, before, rate in zip(names, ["cos(s)", *names[:-1]], rates, strict=True)
    }
    system = HybridSystem(tuple(names), {"w": 1.0 / unit}, {"m": Mode(field)}, phase=("s", "w"))
    orbit = find_orbit(system, x0=np.zeros(count))
    np.testing.assert_allclose(orbit.x0, np.cumprod(rates / (rates + 1j / unit)).real, atol=1e-13)
    assert np.abs(orbit.multipliers).max() == pytest.approx(np.exp(-2.0 * np.pi), rel=1e-10)
    branch = saltus.continue_orbit(orbit, "w", (0.5 / unit, 2.0 / unit))
    assert all("bound reached" in stop for stop in branch.stopped)
    assert len(branch.special_points) == 0


@pytest.mark.parametrize("lag", [1e-2, 1e-5, 1e-8])
def test_a_relay_with_a_fast_sensor_switches_where_closed_forms_say(lag: float) -> None:
    system = HybridSystem(
        ("x", "y"), {"lag": lag, "h": 0.5},
        {"up": Mode({"x": "1 - x", "y": "(x - y)/lag"}), "down": Mode({"x": "-1 - x", "y": "(x - y)/lag"})},
        [Transition("up", "down", "y - h", 1), Transition("down", "up", "y + h", -1)],
    )  # fmt: skip
    orbit = find_orbit(system, x0=[0.0, 0.0])

    def height(period: float) -> float:
        return 1.0 - (1.0 + np.tanh(period / 4.0)) * np.exp(-period / 2.0) / (1.0 - lag) - 0.5

    assert orbit.period == pytest.approx(brentq(height, 0.1, 20.0, xtol=1e-15), abs=1e-12)
    branch = saltus.continue_orbit(orbit, "h", (0.2, 0.9))
    assert branch.stopped == ("h = 0.2: bound reached", "h = 0.9: bound reached")
    assert all(solution.admissible for solution in branch)


@pytest.mark.parametrize("name", guarding(["impact_oscillator", "two_fields"], "two_fields"))
def test_implicit_steps_give_the_equations_and_derivatives_of_explicit_ones(name, request) -> None:
    orbit = find_orbit(request.getfixturevalue(name), x0=[0.3, 0.1])
    active = (0, 1)
    values = []
    for stiff in (False, True):
        problem = OrbitProblem(orbit.system, orbit.form, orbit.problem().p, active, np.ones(2))
        u = np.concatenate([orbit.unknowns, problem.p[list(active)]])
        problem.start(u)
        if stiff:
            problem.stiff = True
            problem.prepare(u)
        moved = u * (1.0 + 1e-3 * np.cos(np.arange(u.size)))
        values.append(problem.evaluate(moved))
        lows, highs = problem.survey(u).lows, problem.survey(u).highs
        values[-1] += (lows, highs, problem.second(u, np.sin(1.0 + np.arange(u.size))))
    for explicit, implicit in zip(*values, strict=True):
        np.testing.assert_allclose(implicit, explicit, rtol=1e-8, atol=1e-9)


def test_derivatives_of_a_stiff_orbit_are_differences(relaxation: HybridSystem) -> None:
    names = ["period", "max_y", "mean(x**2)"]
    found = find_orbit(relaxation, {"mu": 500.0}, x0=[2.0, 0.0]).sensitivity(names, ["mu"])
    ends = [find_orbit(relaxation, {"mu": mu}, x0=[2.0, 0.0]) for mu in (499.95, 500.05)]
    for name in names:
        known = [{"period": end.period, "max_y": end.highs[1]} for end in ends]
        low, high = (own.get(name) or end.observe(name)[name] for own, end in zip(known, ends, strict=True))
        assert found[name].item() == pytest.approx((high - low) / 0.1, rel=1e-4, abs=1e-10)


OREGONATOR = HybridSystem.smooth(
    {"x": "q*(y + x*(1 - 8.375e-6*x - y))", "y": "(z - (1 + x)*y)/q", "z": "0.161*(x - z)"}, {"q": 77.27}
)
REACTOR = HybridSystem.smooth(
    {
        "a": "-0.04*a + 1e4*b*c + d*(1 + cos(s)/2)*(1 - a)", "b": "0.04*a - 1e4*b*c - 3e7*b**2 - d*(1 + cos(s)/2)*b",
        "c": "3e7*b**2 - d*(1 + cos(s)/2)*c",
    },
    {"d": 0.01, "w": 0.1}, phase=("s", "w"),
)  # fmt: skip


@pytest.mark.parametrize(
    ("system", "x0"),
    [pytest.param(OREGONATOR, [4.0, 1.1, 4.0], marks=pytest.mark.campaign), (REACTOR, [0.5, 0.0, 0.5])],
)
def test_kinetics_come_back_after_a_period_of_scipys(system, x0) -> None:
    orbit = find_orbit(system, x0=x0)
    p = np.array(list(orbit.parameters.values()))
    full = np.append(orbit.x0, 0.0) if system.phase is not None else orbit.x0

    def field(_, x):
        return system.compiled.field(0, np.ascontiguousarray(x), p)

    found = solve_ivp(field, (0.0, orbit.period), full, method="Radau", rtol=1e-10, atol=1e-13 * np.abs(full).max())
    count = len(system.states)
    np.testing.assert_allclose(found.y[:count, -1], orbit.x0, rtol=2e-6, atol=1e-9)
    assert orbit.stable


def test_the_same_stiff_orbit_is_found_from_any_start(relaxation: HybridSystem) -> None:
    periods = [find_orbit(relaxation, {"mu": 1000.0}, x0=x).period for x in ([2.0, 0.0], [-1.7, 3.0], [0.1, -50.0])]
    np.testing.assert_allclose(periods, periods[0], rtol=1e-12)


def test_a_flow_that_no_steps_follow_is_told(relaxation: HybridSystem, monkeypatch) -> None:
    monkeypatch.setattr("saltus.flow.kernels.segment.MOST_STEPS", 4000)
    monkeypatch.setattr("saltus.orbits.meshes._FEW_STEPS", 40)
    branch = saltus.continue_orbit(find_orbit(relaxation, x0=[2.0, 0.0]), "mu", (0.01, 1000.0))
    assert branch.stopped[0] == "mu = 0.01: bound reached"
    assert "the flow is stiff" in branch.stopped[1]


@pytest.mark.campaign
def test_orbits_and_branches_tell_by_which_steps_they_were_followed(branch, relaxation, tmp_path) -> None:
    assert not branch.implicit[branch.values < 5.0].any()
    assert branch.implicit[branch.values > 100.0].all()
    assert f"stiff: {branch.implicit.sum()} orbits by implicit steps" in repr(branch)
    branch.save(tmp_path / "branch.nc")
    assert np.array_equal(saltus.load(tmp_path / "branch.nc").implicit, branch.implicit)
    for index in (int(np.argmin(branch.values)), int(np.argmax(branch.values))):
        orbit = branch.solution(index)
        assert orbit.implicit == branch.implicit[index] == ("stiff, by implicit steps" in repr(orbit))
        orbit.save(tmp_path / "orbit.nc")
        assert saltus.load(tmp_path / "orbit.nc").implicit == orbit.implicit


def test_slopes_of_multipliers_through_implicit_steps_are_those_of_the_closed_form() -> None:
    """x'' + k x' + k x = k cos s has the multiplier exp(2 pi r), r the slow root of r^2 + k r + k."""
    field = {"x": "v", "v": "-k*(v - cos(s)) - k*x"}
    orbit = find_orbit(HybridSystem.smooth(field, {"k": 1e4, "w": 1.0}, phase=("s", "w")), x0=[1.0, 0.0])
    assert orbit.implicit
    root = np.roots([1.0, 1e4, 1e4]).real.max()
    exact = 2.0 * np.pi * np.exp(2.0 * np.pi * root) * -(root + 1.0) / (2.0 * root + 1e4)
    slope = orbit.sensitivity(["multipliers"], ["k"])["multiplier_re"]
    assert float(slope[0, 0]) == pytest.approx(exact, rel=1e-10)
    assert "note" not in slope.attrs


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_relaxation_oscillation_is_verified_by_another_implicit_method(relaxation) -> None:
    checked = saltus.verify(find_orbit(relaxation, {"mu": 1000.0}, x0=[2.0, 0.0]))
    assert checked.passed, checked
    assert not checked.unchecked
