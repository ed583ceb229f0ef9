"""The cage against the closed forms of the oscillators that it is about, and against simulated motions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, afm, find_orbit, simulate
from saltus.basins.attractors.invariant_set import cage_of

OMEGA = 1.15
LEAST_GAP = 0.4134399805  # of the linear response: 1 - |response of the gap|, below in closed form
DAMPINGS = {
    1: {"D_att_1": 0.025},
    2: {"D_att_1": 0.02, "D_att_2": 0.07},
    3: {"D_att_1": 0.03, "D_att_2": 0.02, "D_att_3": 0.11},
}


def tapping(n, **parameters):
    return afm.tapping_mode(afm.table1(), modes=n, parameters={"Omega": OMEGA, **parameters})


class Oscillators:
    """The modes of the cantilever in flight without the van der Waals force, in closed form."""

    def __init__(self, n, dampings):
        from saltus.afm.paper.galerkin import coefficients

        setup = afm.table1()
        known = coefficients(setup.cantilever, setup.sample, setup.eta, n)
        self.K, self.B, self.C = np.array(known.K), np.array(known.B), known.C
        self.D = np.array([dampings[f"D_att_{i + 1}"] for i in range(n)])
        self.w = np.sqrt(self.K - 0.25 * self.D**2)
        # q = Im(response e^(i theta)) + C/K for a drive B Omega^2 ybar sin(theta)
        self.response = self.B * OMEGA**2 * 0.108 / (self.K - OMEGA**2 + 1j * self.D * OMEGA)

    def deviation(self, states, theta):
        turned = self.response * np.exp(1j * np.asarray(theta)[:, None])
        q, v = turned.imag + self.C / self.K, OMEGA * turned.real
        return states[:, : len(q.T)] - q, states[:, len(q.T) : 2 * len(q.T)] - v

    def amplitudes(self, states, theta):
        q, v = self.deviation(states, theta)
        return np.hypot(q, (v + 0.5 * self.D * q) / self.w)

    def states(self, amplitudes, angles):
        """States at phase 0 with given amplitudes of the deviation."""
        q = amplitudes * np.cos(angles)
        v = amplitudes * np.sin(angles) * self.w - 0.5 * self.D * q
        return np.concatenate([q + self.response.imag + self.C / self.K, v + OMEGA * self.response.real], axis=1)


def random_members(cage, oscillators, rng, count, part=1.0):
    """States of the cage, most of them near its surface."""
    n = len(cage.floors)
    shares = rng.dirichlet(np.ones(n), size=count) * cage.bound * part * rng.uniform(0.8, 1.0, size=(count, 1))
    return oscillators.states(shares, rng.uniform(0.0, 2.0 * math.pi, (count, n)))


def test_the_linear_response_comes_as_near_as_its_closed_form():
    oscillators = Oscillators(2, {"D_att_1": 0.025, "D_att_2": 0.025})
    gap = abs(-oscillators.response.sum() - 0.108)
    assert 1.0 - (oscillators.C / oscillators.K).sum() - gap == pytest.approx(LEAST_GAP, abs=1e-10)


def test_a_motion_that_keeps_0_08_from_the_sample_has_a_third_of_the_gap_to_swing():
    a0 = 0.2 / 60.0
    cage = cage_of(tapping(2), {}, "flight", fraction=(0.08 - a0) / (LEAST_GAP - a0))
    assert cage.bound == pytest.approx(LEAST_GAP - 0.08, abs=1e-9)
    assert cage.distances[0] == pytest.approx(0.08 - a0, abs=1e-9)
    # basins by hand: c_i = 2 |C| / (d^2 w_i D)
    assert cage.floors[0] == pytest.approx(2.0 * 2.35038841e-6 / 0.08**2 / 0.025, rel=1e-3)


@pytest.mark.campaign
@pytest.mark.parametrize("n", [1, 2, 3])
def test_sizes_are_the_amplitudes_of_the_modes(n):
    oscillators, rng = Oscillators(n, DAMPINGS[n]), np.random.default_rng(n)
    cage = cage_of(tapping(n), DAMPINGS[n], "flight")
    states = oscillators.states(rng.uniform(0.4, 1.0, (20, n)), rng.uniform(0.0, 6.0, (20, n)))
    expected = oscillators.amplitudes(states, np.zeros(20))
    moduli = np.sort(np.abs((states - cage.centre) @ cage.rows.T), axis=1)
    assert moduli == pytest.approx(np.sort(expected, axis=1), rel=1e-9)
    assert cage.sizes(states) == pytest.approx(expected.sum(axis=1), rel=1e-9)  # all above their floors


@pytest.mark.parametrize("n", [1, 2, 3])
def test_amplitudes_obey_the_inequality_and_nothing_leaves_the_cage(n):
    system, oscillators, rng = tapping(n), Oscillators(n, DAMPINGS[n]), np.random.default_rng(10 + n)
    cage = cage_of(system, DAMPINGS[n], "flight")
    rates = 0.5 * oscillators.D
    floors = {round(rate, 12): floor for rate, floor in zip(cage.rates.tolist(), cage.floors.tolist(), strict=True)}
    floors = np.array([floors[round(rate, 12)] for rate in rates.tolist()])
    times = np.linspace(0.0, 2.999 * 2.0 * math.pi / OMEGA, 400)
    decay = np.exp(-rates * np.diff(times)[:, None])
    nearest = math.inf
    for x in random_members(cage, oscillators, rng, 40):
        motion = simulate(system, DAMPINGS[n], x, periods=3)
        assert "touch" not in motion.events["name"].tolist()
        amplitudes = oscillators.amplitudes(motion(times), OMEGA * times)
        allowed = decay * amplitudes[:-1] + (1.0 - decay) * floors
        assert np.all(amplitudes[1:] <= allowed + 1e-9)
        sizes = np.maximum(amplitudes, floors).sum(axis=1)
        assert np.all(np.diff(sizes) <= 1e-9)
        nearest = min(nearest, float(motion.output("z", times).min()) - 0.2 / 60.0)
    assert nearest >= cage.distances[0]


def test_motions_from_well_outside_the_cage_touch():
    system, oscillators, rng = tapping(2), Oscillators(2, DAMPINGS[2]), np.random.default_rng(3)
    cage = cage_of(system, DAMPINGS[2], "flight")
    outside = random_members(cage, oscillators, rng, 20, part=1.6)
    touched = [simulate(system, DAMPINGS[2], x, periods=20).events["name"].tolist() for x in outside]
    assert any("touch" in events for events in touched)


@pytest.mark.parametrize("n", [1, 2])
def test_motions_in_the_cage_converge_to_the_attractive_orbit(n):
    from systems import settle

    system, oscillators, rng = tapping(n), Oscillators(n, DAMPINGS[n]), np.random.default_rng(20 + n)
    cage = cage_of(system, DAMPINGS[n], "flight")
    orbit = find_orbit(system, DAMPINGS[n], cage.centre)
    assert orbit.signature == (("flight", "theta"),)
    p = system.parameter_vector(DAMPINGS[n])
    for x in random_members(cage, oscillators, rng, 5):
        end, mode = settle(system, p, x, 0, periods=600)
        assert mode == 0
        assert end[:-1] == pytest.approx(orbit.x0, abs=1e-6)


def stopped(events, field="-x - 0.2*v + A*cos(s)", **parameters):
    return HybridSystem(
        ("x", "v"),
        {"w": 2.0, "A": 1.0, **parameters},
        {"free": Mode({"x": "v", "v": field})},
        [
            Transition("free", "free", event, direction, {"v": "-0.8*v"}, name=f"stop {i}")
            for i, (event, direction) in enumerate(events)
        ],
        phase=("s", "w"),
    )


AMPLITUDE = 1.0 / math.sqrt(9.0 + 0.16)


def test_a_linear_oscillator_before_a_stop_may_swing_to_it():
    cage = cage_of(stopped([("x - 1", 1)]), {}, "free")
    assert cage.contraction == 0.0
    assert cage.floors.tolist() == [0.0]
    assert cage.bound + cage.distances[0] == pytest.approx(1.0 - AMPLITUDE, abs=1e-12)


def test_the_nearer_of_two_stops_bounds_the_cage():
    cage = cage_of(stopped([("x - 1", 1), ("x + 0.5", -1)]), {}, "free", fraction=0.1)
    assert cage.distances == pytest.approx([0.1 * (1.0 - AMPLITUDE), 0.1 * (0.5 - AMPLITUDE)], abs=1e-12)
    assert cage.bound == pytest.approx(0.9 * (0.5 - AMPLITUDE), abs=1e-12)


@pytest.mark.parametrize(
    ("events", "field", "why"),
    [
        ([("x - 0.3", 1)], "-x - 0.2*v + A*cos(s)", "the response meets the stop"),
        ([("x - 1", 1)], "-x + 0.2*v + A*cos(s)", "the linear part is unstable"),
        ([("x**2 - 1", 1)], "-x - 0.2*v + A*cos(s)", "the event function is not affine"),
        ([("x - 1", 1)], "-x - 0.2*v + A*cos(s) - 0.01*v**2", "the rest depends on more than the event function"),
        ([("x - 1", 1)], "-x - 0.2*v + A*cos(s) - 0.01*exp(x)", "the rest is not rational"),
        ([("x - 1", 1)], "-x - 0.2*v + A*cos(s) - 0.5*x**3", "the rest is too strong"),
        ([("x - 1", 1)], "-x - 0.2*v + A*cos(s) + 0.001/(1.1 - x)**2 - 0.001/(x + 0.5)", "the rest has a pole"),
    ],
)
def test_where_the_theorem_does_not_hold_there_is_no_cage(events, field, why):
    assert cage_of(stopped(events, field), {}, "free") is None, why


def test_a_weak_rest_leaves_a_smaller_cage_than_none():
    free = cage_of(stopped([("x - 1", 1)]), {}, "free")
    weak = cage_of(stopped([("x - 1", 1)], "-x - 0.2*v + A*cos(s) + 0.001/(1.1 - x)**2"), {}, "free")
    assert 0.0 < weak.bound < free.bound
    assert weak.floors[0] > 0.0
    assert 0.0 < weak.contraction < 1.0


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_a_cage_does_not_depend_on_the_units_of_its_event_functions(unit):
    field = "-x - 0.2*v + 0.02/(x + 1.2)**4"
    plain, scaled = (
        cage_of(stopped([(f"{factor}*(x + 1)", -1), ("x - 1", 1)], field), {}, "free") for factor in (1.0, unit)
    )
    assert 0.5 < plain.contraction < 1.0
    assert scaled.contraction == pytest.approx(plain.contraction, rel=1e-9)
    assert scaled.bound / scaled.distances[1] == pytest.approx(
        plain.bound / plain.distances[1] * min(unit, 1.0), rel=1e-9
    )
