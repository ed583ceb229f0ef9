"""What branches off at equilibria: cycles at Hopf points and back, other equilibria at branch points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fields
from saltus import (
    HybridSystem,
    StepControl,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    switch_branch,
)
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.results import PeriodicOrbit

LORENZ = (
    (24.5, 0.661109342451, 8.924846307502, 9.802971773161, 1.00964121, 1.18008e-4),
    (24.0, 0.679336764198, 9.576665810221, 11.116220849943, 1.03208832, 8.99862e-5),
    (23.0, 0.719189479743, 10.249323538721, 12.539661971298, 1.08727241, 4.95467e-5),
)  # r, period, x and y where z = r - 1 and x is larger than at rest, multipliers


def _lorenz_branch() -> EquilibriumBranch:
    return continue_equilibrium(find_equilibrium(fields.lorenz(), x0=[8.0, 8.0, 23.0]), "r", (15.0, 30.0))


@pytest.fixture(scope="module")
def hopf() -> EquilibriumBranch:
    return _lorenz_branch()


def _through_the_level(orbit: PeriodicOrbit, r: float) -> np.ndarray:
    """Return the orbit's point with z = r - 1 and the larger x, by SciPy's Runge-Kutta of order 8."""
    b, sigma = 8.0 / 3.0, 10.0

    def field(t, s):
        x, y, z = s
        return [sigma * (y - x), x * (r - z) - y, x * y - b * z]

    motion = solve_ivp(field, (0.0, orbit.period), orbit.x0, "DOP853", dense_output=True, rtol=1e-13, atol=1e-13)
    assert motion.y[:, -1] == pytest.approx(orbit.x0, abs=1e-9)
    times = np.linspace(0.0, orbit.period, 400)
    heights = motion.sol(times)[2] - (r - 1.0)
    places = [
        motion.sol(brentq(lambda t: motion.sol(t)[2] - (r - 1.0), times[i], times[i + 1], xtol=1e-15))
        for i in np.flatnonzero(heights[:-1] * heights[1:] < 0.0)
    ]
    return max(places, key=lambda s: s[0])


@pytest.mark.parametrize(("r", "period", "x", "y", "unstable", "weak"), LORENZ)
def test_the_cycles_of_lorenz_are_reached_from_its_hopf_point(hopf, r, period, x, y, unstable, weak):
    cycles = continue_orbit(switch_branch(hopf["HB1"]), "r", (r, 26.0))
    assert cycles["HB1"].parameters["r"] == pytest.approx(470.0 / 19.0, abs=1e-9)
    assert cycles.values.max() < 470.0 / 19.0 + 1e-9  # subcritical: cycles exist below only
    orbit = cycles.solution(0)
    assert orbit.parameters["r"] == r
    assert orbit.period == pytest.approx(period, abs=2e-12)
    multipliers = sorted(orbit.multipliers.real)
    assert multipliers == pytest.approx([weak, 1.0, unstable], abs=3e-8)
    assert np.prod(orbit.multipliers).real == pytest.approx(math.exp(-41.0 / 3.0 * orbit.period), rel=1e-7)
    place = _through_the_level(orbit, r)
    assert place[:2] == pytest.approx([x, y], abs=2e-10)
    assert not orbit.stable
    assert cycles.special_points.of_type("TR") == []  # the multiplier next to 1 is real


def test_a_cycle_leads_back_to_its_hopf_point(hopf):
    cycles = continue_orbit(switch_branch(hopf["HB1"]), "r", (24.0, 26.0))
    found = switch_branch(cycles["HB1"])
    assert isinstance(found, Equilibrium)
    assert found.state == pytest.approx(hopf["HB1"].equilibrium.state, abs=1e-8)
    again = continue_equilibrium(found, "r", (15.0, 30.0))
    assert again["HB1"].parameters["r"] == pytest.approx(470.0 / 19.0, abs=1e-9)


@pytest.mark.parametrize("place", fields.PLANES)
def test_cycles_of_the_hopf_normal_form_are_circles(place):
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.HOPF, {"mu": -0.5, "w": 3.0}), x0=plane.to([0.01, 0.0]))
    orbit = switch_branch(continue_equilibrium(start, "mu", (-1.0, 1.0))["HB1"])
    assert 0.0 < orbit.parameters["mu"] < 0.01
    cycles = continue_orbit(orbit, "mu", (-1.0, 1.0))
    assert cycles["HB1"].parameters["mu"] == pytest.approx(0.0, abs=1e-11)
    assert cycles.period == pytest.approx(2.0 * math.pi / 3.0, rel=1e-10)
    radius = np.linalg.norm(plane.back(cycles.x0), axis=1)
    assert radius**2 == pytest.approx(cycles.values, abs=1e-10)
    other = np.abs(cycles.multipliers).min(axis=1)
    assert other == pytest.approx(np.exp(-4.0 * math.pi * cycles.values / 3.0), rel=1e-7)


@pytest.mark.campaign
@pytest.mark.parametrize("place", fields.PLANES)
def test_cycles_of_the_bautin_form_fold_where_the_closed_form_says(place):
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.BAUTIN, {"b1": -0.5, "b2": 0.3}), x0=plane.to([0.01, 0.0]))
    cycles = continue_orbit(switch_branch(continue_equilibrium(start, "b1", (-1.0, 1.0))["HB1"]), "b1", (-0.2, 0.2))
    fold = cycles["SN1"]
    assert fold.parameters["b1"] == pytest.approx(-0.0225, abs=1e-9)
    assert np.linalg.norm(plane.back(fold.orbit.x0)) == pytest.approx(math.sqrt(0.15), rel=1e-5)
    last = cycles.solution(int(np.argmax(cycles.values)))
    b2, b1 = 0.3, last.parameters["b1"]
    square = (b2 + math.sqrt(b2**2 + 4.0 * b1)) / 2.0
    assert np.linalg.norm(plane.back(last.x0)) == pytest.approx(math.sqrt(square), rel=1e-9)
    wanted = math.exp(2.0 * math.pi * (2.0 * b2 * square - 4.0 * square**2))
    assert np.abs(last.multipliers).min() == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize(
    ("B", "period", "multiplier"), [(2.1, 6.322065669429, 0.529882904391), (3.0, 7.156919921180, 2.5163758e-4)]
)
@pytest.mark.parametrize("place", ["as printed", "rotated and shifted", "nanometres"])
def test_cycles_of_the_brusselator(place, B, period, multiplier):
    plane = fields.PLANES[place]
    start = find_equilibrium(plane.system(fields.BRUSSELATOR, {"A": 1.0, "B": 1.5}), x0=plane.to([1.0, 1.5]))
    branch = continue_equilibrium(start, "B", (1.0, 3.0))
    assert branch["HB1"].parameters["B"] == pytest.approx(2.0, abs=1e-10)
    orbit = continue_orbit(switch_branch(branch["HB1"]), "B", (1.0, B)).solution(-1)
    assert orbit.parameters["B"] == B
    assert orbit.period == pytest.approx(period, abs=5e-12)
    assert np.abs(orbit.multipliers).min() == pytest.approx(multiplier, rel=2e-8)


def test_van_der_pol_grows_from_its_centre():
    """At mu = 0 all circles are closed; that of amplitude 2 goes on."""
    system = fields.system({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": -0.5})
    branch = continue_equilibrium(find_equilibrium(system), "mu", (-1.0, 1.0))
    assert branch["HB1"].parameters["mu"] == pytest.approx(0.0, abs=1e-12)
    orbit = find_orbit(system, {"mu": 1.0}, x0=[2.0, 0.0])
    assert orbit.period == pytest.approx(6.663286859323, abs=1e-11)
    assert np.abs(orbit.multipliers).min() == pytest.approx(8.596950636e-4, rel=1e-8)
    assert orbit.max["x"] == pytest.approx(2.00861986, abs=1e-8)


def test_the_linear_cycles_of_chua_are_vertical_and_end_where_one_touches_the_surface():
    start = find_equilibrium(fields.chua(), mode="plus", x0=[1.5, 0.0, -1.5])
    point = continue_equilibrium(start, "be", (15.0, 30.0))["HB1"]
    cycles = continue_orbit(switch_branch(point), "be", (15.0, 30.0))
    assert cycles["HB1"].parameters["be"] == pytest.approx(1125.0 / 49.0, rel=1e-11)
    ends = {line.partition(": ")[2].partition(",")[0] for line in cycles.stopped}
    assert "the cycle shrinks to an equilibrium" in ends
    linear = np.array([len(cycles.signature(i)) == 1 for i in range(len(cycles))])
    assert cycles.values[linear] == pytest.approx(1125.0 / 49.0, rel=1e-9)
    touch = cycles["GR1"]
    assert touch.parameters["be"] == pytest.approx(1125.0 / 49.0, rel=1e-9)
    assert touch.orbit.min["x"] == pytest.approx(1.0, abs=1e-9)


# A6


def test_a_cycle_of_two_slopes_scales_with_the_parameter_and_ends_as_a_point():
    system = fields.two_slopes()
    orbit = find_orbit(system, {"m": 1.0}, x0=[0.0, -2.0])
    assert orbit.period == pytest.approx(6.355799581032402, abs=1e-11)
    assert sorted(orbit.durations) == pytest.approx([2.485605901477673, 3.87019367955473], abs=1e-11)
    assert np.abs(orbit.multipliers).min() == pytest.approx(0.625775114255821, abs=1e-11)
    assert orbit.x0 == pytest.approx([0.0, -2.097006765998952], abs=1e-11)
    cycles = continue_orbit(orbit, "m", (-0.5, 1.0))
    assert cycles.values.min() < 1e-6
    assert cycles.stopped[0].startswith("m = 0: ")
    size = cycles.values > 1e-9
    assert cycles.period[size] == pytest.approx(6.355799581032402, rel=1e-9)
    assert np.abs(cycles.multipliers[size]).min(axis=1) == pytest.approx(0.625775114255821, rel=1e-8)
    assert cycles.column("max_y")[size] / cycles.values[size] == pytest.approx(
        cycles.column("max_y")[-1] / cycles.values[-1], rel=1e-8
    )


# other equilibria


@pytest.mark.parametrize("steps", [None, StepControl(largest=0.02)])
def test_at_a_transcritical_point_the_other_branch_is_the_closed_form(steps):
    system = fields.system({"x": "mu*x - x**2"}, {"mu": 1.0})
    for x0 in ([1.0], [0.0]):
        branch = continue_equilibrium(find_equilibrium(system, x0=x0), "mu", (-1.0, 2.0), steps=steps)
        found = switch_branch(branch["BP1"])
        assert isinstance(found, Equilibrium)
        other = continue_equilibrium(found, "mu", (-1.0, 2.0))
        line = 0.0 if x0 == [1.0] else other.values
        assert other.states[:, 0] == pytest.approx(line, abs=1e-12)
        assert other["BP1"].parameters["mu"] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("place", ["as printed", "rotated and shifted", "nanometres"])
def test_at_a_pitchfork_the_other_branch_is_the_parabola(place):
    plane = fields.PLANES[place]
    system = plane.system({"x": "mu*x - x**3", "y": "-y"}, {"mu": -1.0})
    branch = continue_equilibrium(find_equilibrium(system, x0=plane.to([0.0, 0.0])), "mu", (-1.0, 2.0))
    assert fields.places(branch.special_points, "mu") == [("BP", pytest.approx(0.0, abs=1e-10))]
    found = switch_branch(branch["BP1"])
    assert found.parameters["mu"] > 0.0
    other = continue_equilibrium(found, "mu", (-1.0, 2.0))
    assert plane.back(other.states)[:, 0] ** 2 == pytest.approx(other.values, abs=1e-7)
    assert other.values.min() > -1e-10


def test_lorenz_has_both_sides_of_its_pitchfork_and_their_hopf_points():
    lorenz = fields.lorenz()
    trivial = continue_equilibrium(find_equilibrium(lorenz, {"r": 0.5}, x0=[0.0, 0.0, 0.0]), "r", (0.0, 30.0))
    both = continue_equilibrium(switch_branch(trivial["BP1"]), "r", (0.0, 30.0))
    r = [point.parameters["r"] for point in both.special_points.of_type("HB")]
    assert r == pytest.approx([470.0 / 19.0, 470.0 / 19.0], abs=1e-9)
    assert sorted(np.sign([point.equilibrium["x"] for point in both.special_points.of_type("HB")])) == [-1.0, 1.0]


def test_where_no_other_branch_meets_that_is_told(hopf):
    system = fields.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0})
    branch = continue_equilibrium(find_equilibrium(system, x0=[-1.0, 0.0]), "b1", (-2.0, 2.0))
    with pytest.raises(InputError, match="point = 'SN': must be of type HB, BP or BE; no other branch meets there"):
        switch_branch(branch["SN1"])
    locus = continue_locus(branch["SN1"], ("b1", "b2"), {"b1": (-1.0, 2.0), "b2": (-2.0, 2.0)})
    with pytest.raises(InputError, match="point = 'BT'"):
        switch_branch(locus["BT1"])
    with pytest.raises(InputError, match="point = "):
        switch_branch(hopf["HB1"].equilibrium)


@pytest.mark.campaign
@pytest.mark.parametrize("time", [1e-9, 1e9])
@pytest.mark.parametrize("place", fields.PLANES)
def test_units_of_time_change_nothing(place, time):
    """Equilibria, Hopf and Bautin points are where they are; periods are in the unit."""
    plane = fields.PLANES[place]
    field = {name: f"({text})/t" for name, text in fields.BAUTIN.items()}
    start = find_equilibrium(plane.system(field, {"b1": -0.5, "b2": 0.3, "t": time}), x0=plane.to([0.01, 0.0]))
    branch = continue_equilibrium(start, "b1", (-1.0, 1.0))
    assert fields.places(branch.special_points, "b1") == [("HB", pytest.approx(0.0, abs=1e-11))]
    locus = continue_locus(branch["HB1"], ("b1", "b2"), {"b1": (-1.0, 1.0), "b2": (-1.0, 1.0)})
    assert locus["GH1"].parameters["b2"] == pytest.approx(0.0, abs=1e-9)
    assert locus.frequency == pytest.approx(1.0 / time, rel=1e-9)
    cycles = continue_orbit(switch_branch(branch["HB1"]), "b1", (-0.2, 0.2))
    assert cycles["SN1"].parameters["b1"] == pytest.approx(-0.0225, abs=1e-9)
    assert cycles.period == pytest.approx(2.0 * math.pi * time, rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("growth", [0.5, 1.5, 6.0])
def test_cycles_are_born_beside_a_direction_that_grows_however_fast(growth):
    field = {"x": "m*x - w*y - x*(x**2 + y**2)", "y": "m*y + w*x - y*(x**2 + y**2)", "z": "g*z + x**2 - y**2"}
    system = HybridSystem.smooth(field, {"m": -0.1, "w": 0.5, "g": growth})
    rests = continue_equilibrium(find_equilibrium(system, {}, [0.0] * 3), "m", (-0.2, 0.2))
    cycle = switch_branch(rests["HB1"])
    radius, period = math.sqrt(cycle.parameters["m"]), 4.0 * math.pi
    assert cycle.period == pytest.approx(period, rel=1e-9)
    assert math.hypot(*cycle.x0[:2]) == pytest.approx(radius, rel=1e-6)
    largest = max(abs(cycle.multipliers))
    assert math.log(largest) == pytest.approx(growth * period, rel=1e-8)
    branch = continue_orbit(cycle, "m", (0.0, 0.2))
    assert math.hypot(*branch.x0[-1][:2]) == pytest.approx(math.sqrt(0.2), rel=1e-9)
    # z' = g z + r^2 cos 2a with a = w t: the only bounded solution
    angle, orbit = math.atan2(branch.x0[-1][1], branch.x0[-1][0]), branch.x0[-1]
    w = system.parameters["w"]
    z = 0.2 * (2.0 * w * math.sin(2.0 * angle) - growth * math.cos(2.0 * angle)) / (growth**2 + 4.0 * w**2)
    assert orbit[2] == pytest.approx(z, abs=1e-9)
