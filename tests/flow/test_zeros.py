"""Zeros of event functions: changes of sign above rounding are events; touches, flat stretches and noise are none.

The oracle is mpmath with 60 digits, or a sign that the function has by its form.
"""

from __future__ import annotations

import itertools
import random
import re

import mpmath
import numpy as np
import pytest

from saltus.ensemble.ensemble import Ensemble
from saltus.flow.poincare import EventSection, iterate
from saltus.flow.simulation import simulate
from saltus.result import load
from saltus.system.hybrid import HybridSystem, Mode, Transition
from selection import guarding

ROWS = {
    "exp(-1/(x - 1)**2)*(x - 1)": (1, 1),
    "(x - 1)**51": (1, 1),
    "(x - 1)**301": (1, 1),
    "-(x - 1)**51": (-1, 1),
    "1e-300*(x - 1)**3": (1, 1),
    "(abs(x - 1) + x - 1)/2": (1, 0),
    "abs(x - 0.5) + abs(x - 1) - 1/2": (1, 0),
    "exp(-1/(x - 1)**2)": (0, 0),
    "-exp(-1/(x - 1)**2)": (0, 0),
    "erf(50*(x - 1)) + 1": (1, 0),
    "sinh(x - 1) - (x - 1) - (x - 1)**3/6": (1, 1),
    "sin(3*(x - 1)) - 3*(x - 1) + 9*(x - 1)**3/2": (1, 1),
    "cos(40*x) - 1": (0, 0),
    "sin(40*x) - 1": (0, 0),
    "sin(40*x)**2 - 1": (0, 0),
    "cos(40*x) + 1": (0, 0),
    "(sin(40*x) - 1)*1e8": (0, 0),
    "(sin(40*x) - 1)*1e-250": (0, 0),
    "(x - 1)**2": (0, 0),
    "x**2 - 2*x + 1": (0, 0),
    "x**3 - 3*x**2 + 3*x - 1": (1, 1),
    "(x - 1)**2 - 1e-6": (1, 1),
    "(x - 1)**2 + 1e-10": (0, 0),
}
"""Event functions of x = t on [0, 2]: direction, and how many events there are."""


def counter(text, direction, parameters=None, speed="1"):
    """x runs through the function at a speed, y counts its events."""
    modes = {"m": Mode({"x": speed, "y": "0"})}
    return HybridSystem(("x", "y"), parameters or {}, modes, [Transition("m", "m", text, direction, {"y": "y + 1"})])


def counted(text, direction, *, t_end=2.0, **options):
    return simulate(counter(text, direction), None, [0.0, 0.0], t_end=t_end, **options)


@pytest.mark.parametrize("text", ROWS)
def test_a_zero_is_a_change_of_sign_above_rounding(text):
    direction, count = ROWS[text]
    assert counted(text, direction).x_end[1] == count


@pytest.mark.parametrize("tolerance", [1e-12, 1e-8, 1e-5])
@pytest.mark.parametrize("text", guarding(ROWS, "(x - 1)**51", "cos(40*x) - 1", "sin(40*x)**2 - 1"))
def test_the_tolerance_makes_no_event(text, tolerance):
    direction, count = ROWS[text]
    assert counted(text, direction, tolerance=tolerance).x_end[1] == count


@pytest.mark.parametrize("unit", [1e-9, 1e9])
@pytest.mark.parametrize("text", guarding(ROWS, "(x - 1)**51", "cos(40*x) - 1", "erf(50*(x - 1)) + 1"))
def test_the_unit_makes_no_event(text, unit):
    direction, count = ROWS[text]
    system = counter(re.sub(r"\bx\b", f"(x/{unit!r})", text), direction, speed=repr(unit))
    assert simulate(system, None, [0.0, 0.0], t_end=2.0).x_end[1] == count


def test_the_root_of_high_order_is_where_the_function_leaves_its_rounding():
    (time,) = counted("(x - 1)**51", 1).events["time"]
    assert time == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("text", ["cos(40*x) - 1", "abs(x - 0.5) + abs(x - 1) - 1/2", "-exp(-1/(x - 1)**2)"])
def test_touches_and_flat_stretches_are_named(text, tmp_path):
    motion = counted(text, 1)
    (touch,) = motion.touches
    assert 0.0 <= touch.first <= touch.last <= 2.0
    assert "the function of event 'm_to_m' of mode 'm' is 0 to rounding" in repr(motion)
    file = tmp_path / "motion.nc"
    motion.save(file)
    assert load(file).touches == motion.touches


def test_crossings_and_near_misses_are_no_touches():
    for text in ("x - 1", "sin(40*x)", "(x - 1)**2 + 1e-10", "sin(40*x) - 1.0001", "(x - 1)**3"):
        assert counted(text, 1).touches == ()


def drawn(seed):
    """A random event function of x on [0, 2] with its direction: text, and how often mpmath sees it cross."""
    draw = random.Random(seed)
    places = sorted(draw.uniform(0.2, 1.8) for _ in range(draw.randint(1, 3)))
    places = [a for i, a in enumerate(places) if i == 0 or a - places[i - 1] > 0.05]
    orders = [draw.choice((1, 2, 2, 3, 4, 5)) for _ in places]
    factors = "*".join(f"(x - {a!r})**{k}" for a, k in zip(places, orders, strict=True))
    kind = draw.choice(("plain", "wave", "scaled", "shifted", "positive"))
    text = {
        "plain": factors,
        "wave": "*".join(
            f"sin(x - {a!r})**{k}" if k % 2 else f"(1 - cos({draw.uniform(1.0, 3.0)!r}*(x - {a!r})))**{k // 2}"
            for a, k in zip(places, orders, strict=True)
        ),
        "scaled": f"{10.0 ** draw.randint(-100, 100)!r}*{factors}",
        "shifted": f"cos(x)**2 + sin(x)**2 - 1 + {factors}",
        "positive": f"exp(sin(3*x))*{factors}",
    }[kind]
    direction, side, count = draw.choice((-1, 1)), 1.0, 0
    for k in reversed(orders):
        if k % 2:  # from the right: positive there
            count += direction == (1 if side > 0.0 else -1)
            side = -side
    return text, direction, count


@pytest.mark.parametrize("seed", guarding(range(300), *range(12), campaign=40))
def test_random_functions_cross_as_often_as_by_mpmath(seed):
    text, direction, count = drawn(seed)
    assert counted(text, direction).x_end[1] == count
    # the sign changes of mpmath are those of the drawn places
    with mpmath.workdps(60):
        names = {"sin": mpmath.sin, "cos": mpmath.cos, "exp": mpmath.exp}
        values = [eval(text, names, {"x": mpmath.mpf(i) / 5003 * 2}) for i in range(5004)]
        signs = [mpmath.sign(value) for value in values if abs(value) > mpmath.mpf(10) ** -200]
    crossed = sum(a != b and b == direction for a, b in itertools.pairwise(signs))
    assert crossed == count


def turning(text, direction=1):
    """The same along the phase: z counts, and forgets a part of its count each time."""
    modes = {"m": Mode({"z": "-z/10"})}
    return HybridSystem(
        ("z",), {}, modes, [Transition("m", "m", text, direction, {"z": "z + 1"}, name="count")], phase=("th", "1")
    )


@pytest.mark.parametrize(
    "text",
    ["cos(th) - 1", "sin(3*th)**2 - 1", "1 - cos(2*th)", "sin(th)", "sin(th)**3", "(sin(th - 1))**5", "sin(th) - 1"],
)
@pytest.mark.parametrize("direction", [1, -1])
def test_series_and_runge_kutta_steps_count_the_same_zeros(text, direction):
    system = turning(text, direction)
    count = {"sin(th)": 1, "sin(th)**3": 1, "(sin(th - 1))**5": 1}.get(text, 0)
    p = system.parameter_vector({})
    found = iterate(system, p, [0.3, 0.4], 0, discard=0, keep=5 * count + 1, section=EventSection((0,), longest=32.0))
    assert found.times.size == 5 * count + min(count, 1)
    motion = simulate(system, None, [0.3, 0.4], t_end=32.0)
    assert int(np.sum(motion.events["kind"] == "event")) == 5 * count


@pytest.mark.parametrize("text", ["cos(th) - 1", "sin(3*th)**2 - 1", "sin(th - 1)**3", "sin(th - 1)"])
def test_lanes_count_the_same_zeros(text):
    system = turning(text)
    ends, _ = Ensemble(system, tolerance=1e-10).strobe([[0.3]] * 3, count=4)
    exact = simulate(system, None, [0.3], periods=4).x_end[0]
    assert ends[:, 0] == pytest.approx([exact] * 3, rel=1e-8)
