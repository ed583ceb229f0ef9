"""Cycles that slide end at a pseudo-saddle on which they land, or at a pseudo-saddle-node over which they slide."""

import cmath
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import saltus
from selection import guarding

SPIRAL = saltus.filippov(
    ("x", "y"), {"mu": 1.2, "c": 5.0, "k": 0.0}, surface="y + 1",
    above={"x": "x*(mu - x*x - y*y) - y", "y": "y*(mu - x*x - y*y) + x"}, below={"x": "c + k*x", "y": "1"},
)  # fmt: skip


def above(mu, x, y):
    return x * (mu - x * x - y * y) - y, y * (mu - x * x - y * y) + x


def landing(field, start, height, side):
    """Where a motion that leaves a surface y = height without speed, to a side of it, comes back to it, by SciPy."""

    def met(t, z):
        return z[1] - height if t > 1e-3 else side

    met.terminal = True
    run = solve_ivp(lambda _, z: field(*z), (0.0, 200.0), [start, height], "DOP853", events=met, rtol=1e-12, atol=1e-14)
    return float(run.y[0, -1])


def end_by_scipy(mu: float, k: float) -> tuple[str, float]:
    """Where sliding from the landing to the tangency stops: the least c at which nothing on the way rests."""
    leaves = 0.5 * (-1.0 + math.sqrt(4.0 * mu - 3.0))
    lands = landing(lambda x, y: above(mu, x, y), leaves, -1.0, 1.0)

    def stops(x):
        """The c at which x is a pseudo-equilibrium."""
        along, rise = above(mu, x, -1.0)
        return along / rise - k * x

    places = np.linspace(lands, leaves, 4001)[:-1]
    values = [stops(x) for x in places]
    i = int(np.argmax(values))
    if i == 0:
        return "HOM", stops(lands)
    found = minimize_scalar(lambda x: -stops(x), bounds=(places[i - 1], places[i + 1]), options={"xatol": 1e-12})
    return "SNIC", -float(found.fun)


def drawn(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng(seed)
    return rng.uniform(1.05, 1.5), rng.uniform(-6.0, 6.0)


@pytest.mark.parametrize("seed", guarding(range(200), 0, 1, 2, 3, campaign=16))
def test_sliding_cycles_end_where_scipy_has_them_rest(seed):
    mu, k = drawn(seed)
    kind, value = end_by_scipy(mu, k)
    start = saltus.find_orbit(SPIRAL, {"mu": mu, "k": k, "c": value + 3.0}, x0=[1.0, 0.0])
    branch = saltus.continue_orbit(start, "c", (value - 1.0, value + 4.0))
    (point,) = branch.special_points
    assert (point.type, point.parameters["c"]) == (kind, pytest.approx(value, abs=1e-9)), f"mu = {mu}, k = {k}"
    assert point.homoclinic.slides
    assert "the period grows without bound" in branch.stopped[0]
    assert not branch.audit.breaches
    if kind == "HOM":
        assert "pseudo-saddle" in repr(point)
        assert point.homoclinic.leading[0].real > 0.0
        assert cmath.isnan(point.homoclinic.leading[1])


PREY = saltus.filippov(  # Kuznetsov, Rinaldi, Gragnani 2003: predators are harvested above a threshold P
    ("x", "y"), {"P": 1.3, "a": 0.3556, "b": 0.33, "d": 0.0444, "h": 0.2067}, surface="y - P",
    above={"x": "x*(1 - x) - a*x*y/(b + x)", "y": "a*x*y/(b + x) - d*y - h*y"},
    below={"x": "x*(1 - x) - a*x*y/(b + x)", "y": "a*x*y/(b + x) - d*y"},
)  # fmt: skip


def prey_lands_off_the_saddle(P: float) -> float:
    a, b, d = 0.3556, 0.33, 0.0444
    lands = landing(
        lambda x, y: (x * (1 - x) - a * x * y / (b + x), a * x * y / (b + x) - d * y), b * d / (a - d), P, -1.0
    )
    return lands - 0.5 * (1.0 - b - math.sqrt((1.0 + b) ** 2 - 4.0 * a * P))


def test_cycle_from_a_boundary_focus_to_a_pseudo_saddle(tmp_path):
    rest = saltus.find_equilibrium(PREY, {"P": 1.2}, x0=[0.047, 1.01], mode="below")
    born = saltus.continue_equilibrium(rest, "P", (0.9, 1.3)).special_points[-1]
    assert (born.type, born.kind) == ("BE", "nonsmooth fold")
    branch = saltus.continue_orbit(saltus.switch_branch(born), "P", (1.0, 1.3))
    assert [point.type for point in branch.special_points] == ["BE", "HOM"]
    assert branch["BE1"].kind == "nonsmooth fold"
    assert branch["BE1"].parameters["P"] == pytest.approx(born.parameters["P"], abs=1e-9)
    np.testing.assert_allclose(saltus.switch_branch(branch["BE1"]).state, born.equilibrium.state, atol=1e-9)
    end = brentq(prey_lands_off_the_saddle, 1.02, 1.04, xtol=1e-13)
    assert branch["HOM1"].parameters["P"] == pytest.approx(end, abs=1e-10)
    assert saltus.verify(branch).passed
    branch.save(tmp_path / "branch.nc")
    kept = saltus.load(tmp_path / "branch.nc")
    assert [(p.kind, p.of, p.homoclinic.slides) for p in kept.special_points] == [
        (p.kind, p.of, p.homoclinic.slides) for p in branch.special_points
    ]


@pytest.mark.campaign
@pytest.mark.parametrize(
    "steps", [{"smallest": 1e-5}, {"initial": 1e-4}, {"initial": 1e-6}, {"initial": 0.05}], ids=str
)
def test_a_cycle_shrinks_to_its_boundary_focus_whatever_stops_its_steps(steps):
    rest = saltus.find_equilibrium(PREY, {"P": 1.2}, x0=[0.047, 1.01], mode="below")
    born = saltus.continue_equilibrium(rest, "P", (0.9, 1.3)).special_points[-1]
    start, control = saltus.switch_branch(born), saltus.StepControl(**steps)
    branch = saltus.continue_orbit(start, "P", (1.0, 1.02), steps=control)
    assert branch["BE1"].parameters["P"] == pytest.approx(born.parameters["P"], abs=1e-9)
    assert "shrinks to a boundary equilibrium" in branch.stopped[0]
    assert branch.audit.passed


def test_upper_cycle_ends_at_the_pseudo_saddle_too():
    start = saltus.find_orbit(PREY, {"P": 1.3}, x0=[0.1, 0.9])
    branch = saltus.continue_orbit(start, "P", (1.0, 1.35), directions="down")
    end = brentq(prey_lands_off_the_saddle, 1.2, 1.24, xtol=1e-13)
    assert branch["HOM1"].parameters["P"] == pytest.approx(end, abs=1e-10)
