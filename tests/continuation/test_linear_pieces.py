"""Cycles of McKean's neuron, linear in pieces, up to the border equilibria at which they end; closed forms beside."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit
from selection import guarding


def neuron(e, slope, fall=1.0):
    """x' = f(x) - y, y' = e (x - a); f falls with a slope below 0 and above 1, and rises between them."""
    y = "e*(x - a)"
    modes = {
        "left": Mode({"x": f"-{fall!r}*x - y", "y": y}),
        "middle": Mode({"x": f"{slope!r}*x - y", "y": y}),
        "right": Mode({"x": f"{slope!r} - {fall!r}*(x - 1) - y", "y": y}),
    }
    return HybridSystem(
        ("x", "y"),
        {"e": e, "a": 0.5},
        modes,
        [
            Transition("left", "middle", "x", 1, name="rises"),
            Transition("middle", "left", "x", -1, name="drops"),
            Transition("middle", "right", "x - 1", 1, name="fires"),
            Transition("right", "middle", "x - 1", -1, name="falls"),
        ],
    )


def passed(offset, speed, k, e, level):
    """Return how long x - a takes from an offset to a level, past a turn where f falls, and the speed there."""
    root = math.copysign(math.sqrt(k * k - 4.0 * e), k)
    fast, slow = 0.5 * (k + root), 2.0 * e / (k + root)
    b = (speed - slow * offset) / (fast - slow)
    c = offset - b

    def gap(t):
        return b * math.exp(fast * t) + c * math.exp(slow * t) - level

    low = math.log(-slow * c / (fast * b)) / (fast - slow) if k < 0.0 else 0.0  # where the motion turns outside
    high = low + 0.1 / abs(k)
    while gap(low) * gap(high) > 0.0:
        low, high = high, high + 0.5 / abs(k)
    t = brentq(gap, low, high, xtol=1e-15, rtol=1e-15)
    return t, fast * b * math.exp(fast * t) + slow * c * math.exp(slow * t)


def period(a, e, slope, fall):
    """Return the period in closed form but for the four instants; the cycle forgets its start in a round."""
    speed, times = 0.1 + a, []
    for _ in range(3):
        times = []
        for begin, k, end in ((0.0, slope, 1.0), (1.0, -fall, 1.0), (1.0, slope, 0.0), (0.0, -fall, 0.0)):
            lasting, speed = passed(begin - a, speed, k, e, end - a)
            times.append(lasting)
    return sum(times)


def cells(count):
    chance = np.random.default_rng(20)
    for _ in range(count):
        slope, fall = chance.uniform(0.5, 2.0, 2).tolist()
        yield round(10.0 ** chance.uniform(-2.3, -0.9) * min(slope, fall) ** 2, 6), round(slope, 3), round(fall, 3)


CELLS = [(0.2, 1.0, 1.0), (0.1, 1.0, 1.0), (0.05, 1.0, 1.0), (0.02, 1.0, 1.0), (0.01, 1.0, 1.0), (0.05, 0.5, 1.0)]


@pytest.mark.parametrize(("e", "slope", "fall"), guarding([*CELLS, *cells(8)], CELLS[3], CELLS[4], campaign=5))
def test_cycles_go_on_to_both_knees_with_periods_of_the_closed_form(e, slope, fall):
    start = find_orbit(neuron(e, slope, fall), {"a": 0.5}, x0=[1.5, 0.0], mode="right")
    branch = continue_orbit(start, "a", (-1.0, 2.0))
    assert [point.type for point in branch.special_points] == ["BC", "BC"]
    assert all("meets the event" in end for end in branch.stopped)
    assert not branch.audit.breaches
    assert branch.values.min() == pytest.approx(0.0, abs=1e-5)
    assert branch.values.max() == pytest.approx(1.0, abs=1e-5)
    for row in np.linspace(0, len(branch) - 1, 12).astype(int):
        a, T = float(branch.values[row]), float(branch.period[row])
        error = 1e-12 / min(a, 1.0 - a) / abs(slope * e)  # of an instant at which a knee is passed slowly
        assert period(a, e, slope, fall) == pytest.approx(T, rel=1e-9, abs=10.0 * error)
