"""Orbits on the border of a condition: whether they are admissible is told, left open, or refused, by the error."""

from __future__ import annotations

from dataclasses import replace

import pytest

import saltus
from saltus.verification.table import AGREES, UNCHECKED
from selection import guarding


def friction(sign: str, force: str, speed: str) -> str:
    return f"- ({sign})*{force}/(1 + ({sign})*({speed} - u))"


def blocks() -> saltus.HybridSystem:
    """Two blocks on a belt, joined by a spring, each with a friction that falls with the speed on the belt."""
    signs = {"+": "1", "-": "-1"}
    fields = {
        a + b: {
            "x": "v", "v": f"-x + 0.6*(y - x) {friction(one, '0.4', 'v')}",
            "y": "w", "w": f"-y + 0.6*(x - y) {friction(other, 'F', 'w')}",
        }
        for a, one in signs.items()
        for b, other in signs.items()
    }  # fmt: skip
    surfaces = ("v - u", "w - u")
    return saltus.filippov(("x", "v", "y", "w"), {"F": 0.5, "u": 0.1}, surfaces=surfaces, fields=fields)


@pytest.mark.parametrize("x0", guarding([[0.5, 0.0, -0.2, 0.0], [1.0, 0.0, 1.0, 0.0]], [1.0, 0.0, 1.0, 0.0]))
def test_a_branch_passes_verification_where_blocks_begin_to_stick_otherwise(x0):
    orbit = saltus.find_orbit(blocks(), x0=x0)
    branch = saltus.continue_orbit(orbit, "u", (0.05, 1.0))
    assert {"SS"} <= {point.type for point in branch.special_points}
    assert saltus.verify(branch).passed


@pytest.mark.parametrize(
    ("height", "verdict"), [(1e-3, AGREES), (1e-9, UNCHECKED), (-1e-9, UNCHECKED), (-1e-3, AGREES)]
)
def test_a_condition_is_judged_by_the_error_of_the_state(height, verdict):
    # x' = v, v' = -1 from the table at the height 0: the ball comes down with the speed 1, where v + 1 = 0
    impact = saltus.Transition("flight", "flight", "x", -1, {"v": "1"}, when=f"v + 1 + ({height!r})")
    system = saltus.HybridSystem(("x", "v"), {}, {"flight": saltus.Mode({"x": "v", "v": "-1"})}, [impact])
    orbit = saltus.solve_orbit(system, {}, [("flight", impact.name or 0, [0.0, 1.0], 2.0)])
    for faults in (0, orbit.faults):
        row = next(row for row in saltus.verify(replace(orbit, faults=faults)) if row.what == "admissible")
        if verdict == UNCHECKED or replace(orbit, faults=faults).admissible == (height > 0.0):
            assert row.verdict == verdict
