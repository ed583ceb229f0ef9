"""Sliding along two surfaces at once: followed where there is one way, against a complementarity solution.

The oracle holds a block that sticks by its own conditions, and integrates by SciPy between its events.
"""

from __future__ import annotations

import random

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus.flow.simulation import simulate
from saltus.system.filippov import filippov
from selection import guarding

STATES = ("x1", "v1", "x2", "v2")


def friction(sign, v, size, decay, belt):
    """The force of a belt on a block, as text."""
    s = "1" if sign == "+" else "-1"
    return f"- ({s})*{size!r}/(1 + {decay!r}*({v} - {belt!r})*({s}))"


def blocks(sizes, decays, belt, k, c):
    """Two blocks on a belt, each with a spring, and a spring between them."""
    fields = {
        a + b: {
            "x1": "v1", "v1": f"-x1 + {k!r}*(x2 - x1) - {c!r}*v1 {friction(a, 'v1', sizes[0], decays[0], belt)}",
            "x2": "v2", "v2": f"-1.1*x2 + {k!r}*(x1 - x2) - {c!r}*v2 {friction(b, 'v2', sizes[1], decays[1], belt)}",
        }
        for a in "+-" for b in "+-"
    }  # fmt: skip
    return filippov(STATES, {}, surfaces=(f"v1 - {belt!r}", f"v2 - {belt!r}"), fields=fields)


def followed(x, sizes, decays, belt, k, c, t_end):
    """The same by SciPy: a state for each block, 0 where it sticks, and the ends of each stretch found by events."""
    x, t, state = np.array(x, dtype=float), 0.0, [int(np.sign(x[1] - belt)), int(np.sign(x[3] - belt))]

    def pulled(y):
        return -y[0] + k * (y[2] - y[0]) - c * y[1], -1.1 * y[2] + k * (y[0] - y[2]) - c * y[3]

    def rate(_, y, state):
        found = []
        for i, force in enumerate(pulled(y)):
            s, v = state[i], y[2 * i + 1]
            found += [v, 0.0 if s == 0 else force - s * sizes[i] / (1.0 + decays[i] * (v - belt) * s)]
        return found

    while t < t_end:
        events = []
        for i in range(2):
            events.append(
                (lambda t, y, i=i: y[2 * i + 1] - belt) if state[i] else lambda t, y, i=i: sizes[i] - abs(pulled(y)[i])
            )
            events[-1].terminal, events[-1].direction = True, float(-state[i] or -1.0)
        out = solve_ivp(
            lambda t, y, state=tuple(state): rate(t, y, state),
            (t, t_end),
            x,
            "DOP853",
            events=events,
            rtol=1e-11,
            atol=1e-12,
        )
        t, x = out.t[-1], out.y[:, -1]
        for i in range(2):
            if out.t_events[i].size:
                force = pulled(x)[i]
                if state[i]:
                    x[2 * i + 1] = belt
                    state[i] = 0 if abs(force) < sizes[i] else int(np.sign(force))
                else:
                    state[i] = int(np.sign(force))
                    x[2 * i + 1] = belt + 1e-14 * state[i]
    return x


def test_two_blocks_that_stick_together_are_carried_by_the_belt():
    system = blocks((1.0, 1.0), (3.0, 3.0), 0.2, 1.2, 0.0)
    motion = simulate(system, x0=[0.5, 0.0, 0.5, 0.0], t_end=20.0)
    stuck = motion.events[motion.events["mode_after"] == "00"]["time"]
    left = motion.events[motion.events["mode_before"] == "00"]["time"]
    assert stuck.size
    assert left.size
    middle = motion(0.5 * (stuck[0] + left[0]))
    assert middle[[1, 3]] == pytest.approx([0.2, 0.2], abs=1e-12)
    begun = motion(stuck[0])
    assert middle[[0, 2]] - begun[[0, 2]] == pytest.approx(0.1 * (left[0] - stuck[0]), abs=1e-10)
    a, _, b, _ = motion(left[0])
    forces = [-a + 1.2 * (b - a), -1.1 * b + 1.2 * (a - b)]
    assert np.abs(forces).max() == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("seed", guarding(range(60), 0, 1, 2, campaign=10))
def test_random_pairs_of_blocks_move_as_by_complementarity(seed):
    draw = random.Random(seed)
    sizes, decays = (draw.uniform(0.5, 1.5), draw.uniform(0.5, 1.5)), (draw.uniform(0.0, 3.0), draw.uniform(0.0, 3.0))
    belt, k, c = draw.uniform(0.1, 0.5), draw.uniform(0.2, 2.0), draw.uniform(0.0, 0.2)
    x0 = [draw.uniform(-1.0, 1.0), draw.uniform(-0.5, 0.05), draw.uniform(-1.0, 1.0), draw.uniform(-0.5, 0.05)]
    motion = simulate(blocks(sizes, decays, belt, k, c), x0=x0, t_end=12.0)
    exact = followed(x0, sizes, decays, belt, k, c, 12.0)
    assert motion.x_end == pytest.approx(exact, abs=1e-6)


def test_a_motion_rests_where_both_of_its_states_are_drawn_to_0():
    rates = {"+": "-1", "-": "1"}
    fields = {a + b: {"x": rates[a], "y": rates[b]} for a in "+-" for b in "+-"}
    motion = simulate(filippov(("x", "y"), {}, surfaces=("x", "y"), fields=fields), x0=[0.2, 0.5], t_end=2.0)
    assert motion.mode_end == "00"
    assert motion.x_end == pytest.approx([0.0, 0.0], abs=1e-12)
    assert motion.events["time"] == pytest.approx([0.2, 0.5], abs=1e-12)


@pytest.mark.campaign
def test_three_blocks_that_touch_the_belt_alone_move_as_each_does():
    """No spring links them, so that each moves as in a system of its own; all three stick in the end."""
    sizes, springs, starts = (1.0, 0.8, 1.2), (1.0, 1.3, 0.7), ((0.5, 0.0), (-0.3, 0.1), (1.9, 0.2))

    def pushed(i, sign):
        return f"-{springs[i]!r}*x{i} {'-' if sign == '+' else '+'} {sizes[i]!r}"

    words = [a + b + c for a in "+-" for b in "+-" for c in "+-"]
    names = [name for i in range(3) for name in (f"x{i}", f"v{i}")]
    fields = {
        word: {name: f"v{i}" if name[0] == "x" else pushed(i, word[i]) for i in range(3) for name in (f"x{i}", f"v{i}")}
        for word in words
    }
    together = filippov(names, {}, surfaces=[f"v{i} - 0.2" for i in range(3)], fields=fields)
    for t_end in (0.7, 3.0):
        x = simulate(together, x0=np.ravel(starts), t_end=t_end, tolerance=1e-11).x_end
        for i, start in enumerate(starts):
            sides = {
                side: {f"x{i}": f"v{i}", f"v{i}": pushed(i, sign)} for side, sign in (("above", "+"), ("below", "-"))
            }
            alone = filippov((f"x{i}", f"v{i}"), {}, surface=f"v{i} - 0.2", **sides)
            own = simulate(alone, x0=start, t_end=t_end, tolerance=1e-11).x_end
            np.testing.assert_allclose(x[2 * i : 2 * i + 2], own[:2], rtol=1e-8, atol=1e-9)
