"""Events of one instant: equal oscillators in phase, neurons in synchrony, orders that exchange along a branch."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from pairs_in_phase import drawn
from saltus import (
    ConvergenceError,
    HybridSystem,
    Mode,
    Transition,
    continue_orbit,
    find_orbit,
    simulate,
    solve_orbit,
)
from selection import guarding

KNOWN = {"A": 0.8, "w": 1.4, "e": 0.8, "k": 0.3, "d": 0.5}


def single(p: dict[str, float]) -> HybridSystem:
    """Return an impact oscillator."""
    hit = Transition("m", "m", "x - d", 1, {"v": "-e*v"}, name="hit")
    return HybridSystem(("x", "v"), p, {"m": Mode({"x": "v", "v": "A*cos(th) - x - 0.1*v"})}, [hit], phase=("th", "w"))


def several(p: dict[str, float], count: int) -> HybridSystem:
    """Return so many of them in a ring, coupled by springs k."""
    field, states = {}, [f"{name}{i}" for i in range(count) for name in "xv"]
    for i in range(count):
        others = " ".join(f"- k*(x{i} - x{j})" for j in range(count) if j != i)
        field |= {f"x{i}": f"v{i}", f"v{i}": f"A*cos(th) - x{i} - 0.1*v{i} {others}"}
    hits = [Transition("m", "m", f"x{i} - d", 1, {f"v{i}": f"-e*v{i}"}, name=f"hit{i}") for i in range(count)]
    return HybridSystem(states, p, {"m": Mode(field)}, hits, phase=("th", "w"))


def random(seed: int) -> dict[str, float]:
    draw = np.random.default_rng(seed)
    ranges = {"A": (0.6, 1.2), "w": (1.2, 1.7), "e": (0.5, 0.9), "k": (0.05, 0.6), "d": (0.3, 0.6)}
    return {name: draw.uniform(*ends) for name, ends in ranges.items()}


def test_multipliers_in_phase_are_those_of_one_sided_differences():
    orbit = find_orbit(several(KNOWN, 2), x0=[0.0] * 4)
    assert orbit.admissible
    assert orbit.coincidences == (("hit0", "hit1"),)
    assert not orbit.orders
    known = [-0.5713191 + 0.2866476j, -0.5713191 - 0.2866476j, 0.0433137 + 0.6377275j, 0.0433137 - 0.6377275j]
    assert np.abs(np.array(known)[:, None] - orbit.multipliers[None, :]).min(axis=1).max() < 2e-7


@pytest.mark.parametrize(
    ("count", "seed"),
    guarding([(2, 0), *((count, seed) for count in (2, 3) for seed in range(1, 8))], (2, 0), (3, 1), campaign=6),
)
def test_the_branch_in_phase_is_that_of_one_oscillator(count, seed):
    p = random(seed) if seed else KNOWN
    orbit = find_orbit(single(p), x0=[0.0, 0.0])
    low, high = 0.8 * p["w"], 1.4 * p["w"]
    alone = continue_orbit(orbit, "w", (low, high))
    together = find_orbit(several(p, count), x0=list(orbit.x0) * count)
    branch = continue_orbit(together, "w", (low, high))
    assert [end.split(":")[1] for end in branch.stopped] == [end.split(":")[1] for end in alone.stopped]
    assert branch.admissible.all()
    own = [(q.type, q.parameters["w"]) for q in alone.special_points]
    others = [(q.type, q.parameters["w"]) for q in branch.special_points]
    for name, w in own:
        assert min((abs(w - other) for kind, other in others if kind == name), default=math.inf) < 1e-7 * w
    # what is left breaks the symmetry
    assert {kind for kind, w in others if all(abs(w - one) > 1e-7 * w for _, one in own)} <= {"BP", "PD", "TR"}
    for one in alone.at(p["w"]):
        gaps = [
            np.abs(one.multipliers[:, None] - same.multipliers[None, :]).min(axis=1).max() for same in branch.at(p["w"])
        ]
        assert min(gaps) < 1e-7


def alone_at(seed):
    """Return a random oscillator with a periodic attractor, and this one."""
    while True:
        oscillator = drawn(seed)
        try:
            return oscillator, find_orbit(oscillator.system(), x0=list(oscillator.start))
        except ConvergenceError:  # it is chaotic
            seed += 600  # the same kind


def in_phase(oscillator, orbit):
    """Return the orbit of two of them, which need not be stable, from a motion over a period."""
    pair = oscillator.system(2)
    if not any(event.startswith("hit") for _, event in orbit.signature):
        return find_orbit(pair, x0=list(orbit.x0) * 2)
    motion = simulate(pair, {}, list(orbit.x0) * 2, t_end=(1.0 + 1e-6) * orbit.period)
    hits = [i for i, name in enumerate(motion.events["name"]) if name.startswith("hit")]
    names, times, after = (motion.events[name][hits] for name in ("name", "time", "after"))
    waits = np.maximum(np.diff(times, prepend=times[-1] - orbit.period), 1e-12 * orbit.period)
    starts = np.roll(after, 1, axis=0)
    return solve_orbit(pair, {}, [("m", *row) for row in zip(names.tolist(), starts, waits.tolist(), strict=True)])


@pytest.mark.parametrize("seed", guarding(range(100), 1, 4, 5, campaign=12))
def test_two_random_oscillators_in_phase_are_one(seed):
    """Events of both coincide along the whole branch; other points of it, and other multipliers, break the symmetry."""
    oscillator, orbit = alone_at(seed)
    p, value = oscillator.varied, oscillator.parameters[oscillator.varied]
    alone = continue_orbit(orbit, p, oscillator.bounds)
    together = in_phase(oscillator, orbit)
    branch = continue_orbit(together, p, oscillator.bounds)
    assert together.period == pytest.approx(orbit.period, rel=1e-9)
    assert branch.admissible.all()
    assert [end.split(":")[1] for end in branch.stopped] == [end.split(":")[1] for end in alone.stopped]
    own = [(q.type, q.parameters[p]) for q in alone.special_points]
    others = [(q.type, q.parameters[p]) for q in branch.special_points]
    for kind, at in own:
        assert sum(name == kind and abs(at - other) < 1e-7 * at for name, other in others) == 1
    assert {kind for kind, at in others if all(abs(at - one) > 1e-7 * at for _, one in own)} <= {"BP", "PD", "TR"}
    there = branch.at(value)
    for one in alone.at(value):
        gaps = [np.abs(one.multipliers[:, None] - same.multipliers[None, :]).min(axis=1).max() for same in there]
        assert min(gaps) < 1e-6


def synchrony(X: float, g: float) -> float:
    """Return the period of one neuron u' = X - u + y that inhibits itself by an alpha function, by SciPy."""

    def end(T):
        # y and z just behind a spike, from the sum over all spikes before
        q = math.exp(-T)
        z, y = g / (1.0 - q), g * T * q / (1.0 - q) ** 2
        run = solve_ivp(
            lambda _, s: (X - s[0] + s[1], s[2] - s[1], -s[2]), (0.0, T), [0.0, y, z], rtol=1e-12, atol=1e-13
        )
        return run.y[0, -1] - 1.0

    return float(brentq(end, 0.3, 12.0, xtol=1e-12))


@pytest.mark.parametrize(("X", "period"), [(1.05, 4.72479187), (1.3, 2.17518346), (2.5, 0.72127441)])
def test_two_neurons_in_synchrony_are_one_that_inhibits_itself(X, period):
    field = {"u": "X - u + y2", "v": "X - v + y1", "y1": "z1 - y1", "z1": "-z1", "y2": "z2 - y2", "z2": "-z2"}
    spikes = [
        Transition("m", "m", "u - 1", 1, {"u": "0", "z1": "z1 + g"}, name="s1"),
        Transition("m", "m", "v - 1", 1, {"v": "0", "z2": "z2 + g"}, name="s2"),
    ]
    system = HybridSystem(tuple(field), {"X": 1.3, "g": -0.4}, {"m": Mode(field)}, spikes)
    orbit = find_orbit(system, x0=[0.0, 0.001, 0.0, 0.0, 0.0, 0.0])
    assert sorted(orbit.coincidences[0]) == ["s1", "s2"]
    branch = continue_orbit(orbit, "X", (1.05, 2.5))
    assert branch.stopped == ("X = 1.05: bound reached", "X = 2.5: bound reached")
    assert len(branch.special_points) == 0
    (found,) = branch.at(X)
    assert found.period == pytest.approx(period, abs=1e-8)
    assert found.period == pytest.approx(synchrony(X, -0.4), rel=1e-8)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_independent_events_exchange_their_order_without_a_special_point(unit):
    p = {**KNOWN, "s": -0.3, "A": KNOWN["A"] * unit, "d": KNOWN["d"] * unit}
    field = {"x": "v", "v": "A*cos(th) - x - 0.1*v", "y": "u", "u": "A*cos(th + s) - y - 0.1*u"}
    hits = [
        Transition("m", "m", "x - d", 1, {"v": "-e*v"}, name="x"),
        Transition("m", "m", "y - d", 1, {"u": "-e*u"}, name="y"),
    ]
    system = HybridSystem(tuple(field), p, {"m": Mode(field)}, hits, phase=("th", "w"))
    orbit = find_orbit(system, x0=[0.0] * 4)
    branch = continue_orbit(orbit, "s", (-0.3, 0.3))
    assert branch.stopped == ("s = -0.3: bound reached", "s = 0.3: bound reached")
    assert len(branch.special_points) == 0
    assert branch.admissible.all()
    sizes = np.abs(np.sort(np.abs(branch.multipliers), axis=1) - np.sort(np.abs(branch.multipliers[0])))
    assert sizes.max() < 1e-7  # two oscillators that know nothing of each other
