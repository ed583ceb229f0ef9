"""Integrate-and-fire neurons with adaptation: each spiking or bursting motion is an admissible orbit."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition, find_orbit
from selection import guarding

KINDS = ("quadratic", "exponential", "Izhikevich")
SETTLED = 300  # spikes after which SciPy's motion is looked at
LONGEST = 10  # spikes of the longest burst that is looked for


def neuron(kind: str, seed: int) -> tuple[dict[str, float], str, str]:
    """Return parameters, field of V in a unit U, and rate of w: resets anywhere between rest and threshold."""
    draw = np.random.default_rng([seed, KINDS.index(kind)])
    if kind == "Izhikevich":
        p = {"a": draw.uniform(0.02, 0.1), "b": 0.2, "c": draw.uniform(-65.0, -40.0), "d": draw.uniform(1.0, 8.0),
             "I": draw.uniform(8.0, 20.0), "top": 30.0}  # fmt: skip
        return p, "0.04*V**2 + 5*V + 140 - w + I", "a*(b*V - w)"
    p = {"a": draw.uniform(0.03, 0.3), "b": draw.uniform(-0.2, 0.4), "c": draw.uniform(-1.0, 2.0),
         "d": draw.uniform(0.05, 1.0), "I": draw.uniform(2.0, 6.0), "top": 5.0}  # fmt: skip
    return p, "V**2 - w + I" if kind == "quadratic" else "exp(V) - V - w + I", "a*(b*V - w)"


def spikes(p: dict[str, float], field: str, rate: str) -> np.ndarray:
    """Return (time, w behind the reset) of the spikes that SciPy's integration meets, shape (spikes, 2)."""
    names = {**p, "exp": np.exp}
    v_of, w_of = (eval(f"lambda V, w: {text}", names) for text in (field, rate))

    def top(_, x):
        return x[0] - p["top"]

    top.terminal, top.direction = True, 1.0
    t, x, rows = 0.0, np.array([p["c"], 0.0]), []
    for _ in range(SETTLED + 2 * LONGEST + 1):
        run = solve_ivp(lambda _, x: (v_of(*x), w_of(*x)), (0.0, 1e3), x, "DOP853", events=top, rtol=1e-10, atol=1e-10)
        if run.status != 1:
            return np.empty((0, 2))
        t, w = t + run.t[-1], run.y[1, -1] + p["d"]
        x = np.array([p["c"], w])
        rows.append((t, w))
    return np.array(rows)


def recurrence(rows: np.ndarray) -> int:
    """Return after how many spikes a motion repeats itself; 0 where it does not."""
    for count in range(1, LONGEST + 1):
        last = rows[-LONGEST:, 1]
        if np.allclose(last, rows[-LONGEST - count : -count, 1], rtol=1e-7, atol=1e-7):
            return count
    return 0


@pytest.mark.parametrize(
    ("kind", "seed"),
    guarding(
        [(kind, seed) for seed in range(12) for kind in KINDS],
        ("quadratic", 0), ("quadratic", 3), ("exponential", 1), ("Izhikevich", 2), campaign=12,
    ),
)  # fmt: skip
def test_each_spiking_or_bursting_motion_is_an_admissible_orbit(kind, seed):
    p, field, rate = neuron(kind, seed)
    rows = spikes(p, field, rate)
    count = recurrence(rows) if len(rows) else 0
    if count == 0:
        pytest.skip("SciPy's motion comes to rest, or does not repeat itself")
    spike = Transition("m", "m", "V - top", 1, {"V": "c", "w": "w + d"}, name="spike")
    system = HybridSystem(("V", "w"), p, {"m": Mode({"V": field, "w": rate})}, [spike])
    orbit = find_orbit(system, x0=[p["c"], 0.0])
    assert orbit.admissible
    assert orbit.stable
    assert len(orbit.signature) == count
    assert orbit.period == pytest.approx(rows[-1, 0] - rows[-1 - count, 0], rel=1e-6)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("tolerance", [1e-12, 1e-5])
def test_bursts_of_five_are_found_in_any_unit_and_at_any_tolerance(unit, tolerance):
    spike = Transition("m", "m", "V - 30*U", 1, {"V": "-50*U", "w": "w + 2*U"}, name="spike")
    field = {"V": "0.04*V**2/U + 5*V + 150*U - w", "w": "0.02*(0.2*V - w)"}
    system = HybridSystem(("V", "w"), {"U": unit}, {"m": Mode(field)}, [spike])
    orbit = find_orbit(system, x0=[-65.0 * unit, -13.0 * unit], tolerance=tolerance)
    assert orbit.admissible
    assert orbit.period == pytest.approx(59.3113329965, rel=max(1e-10, tolerance))
