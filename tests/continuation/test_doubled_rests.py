"""Orbits of doubled period that grow from a rest: the branch ends where the period halves, at the doubling of the rest.

In a frame that turns by half a turn a period, an amplitude w has w' = a w - c w^3: orbits of two periods have the
amplitude sqrt(a/c), and the rest doubles at a = 0.
"""

import numpy as np
import pytest

import saltus
from selection import guarding


def turning(unit: float, c: float) -> saltus.HybridSystem:
    """States in a unit, over which the amplitude is w."""
    let = {
        "X": f"x/{unit!r}", "Y": f"y/{unit!r}",
        "px": "((1 + cos(s))*X + sin(s)*Y)/2", "py": "(sin(s)*X + (1 - cos(s))*Y)/2",
    }  # fmt: skip
    return saltus.HybridSystem.smooth(
        {
            "x": f"{unit!r}*(a*px - (X - px) - Y/2 - {c!r}*(X*px + Y*py)*px)",
            "y": f"{unit!r}*(a*py - (Y - py) + X/2 - {c!r}*(X*px + Y*py)*py)",
        },
        {"a": -0.2},
        phase=("s", "1"),
        let=let,
    )


@pytest.mark.parametrize("tolerance", guarding((1e-12, 1e-10, 1e-8, 1e-6), 1e-10))
@pytest.mark.parametrize(
    ("unit", "c"),
    guarding([(u, c) for u in (1.0, 1e-9, 1e9) for c in (1.0, 0.1, 30.0)], (1.0, 1.0), campaign=3, spread=True),
)
def test_period_halves_at_a_rest(unit, c, tolerance):
    system = turning(unit, c)
    rest = saltus.solve_orbit(system, x0=[0.0, 0.0], period=2.0 * np.pi, tolerance=tolerance)
    rests = saltus.continue_orbit(rest, "a", (-0.5, 0.5))
    assert [point.type for point in rests.special_points] == ["PD"]
    error = max(1e-9, 100.0 * tolerance)
    assert abs(rests["PD1"].parameters["a"]) < error
    starts = [saltus.switch_branch(rests["PD1"])]
    starts += [saltus.find_orbit(system, {"a": a}, x0=[unit, 0.0], tolerance=tolerance) for a in (0.05, 0.4)]
    for start in starts:
        branch = saltus.continue_orbit(start, "a", (-0.5, 0.5))
        ends = sorted(branch.stopped)
        assert ends[0].endswith("the period halves") or ends[1].endswith("the period halves"), branch
        assert any(end.startswith("a = 0.5: bound") for end in ends), branch
        assert [point.type for point in branch.special_points] == ["BP"], branch
        assert abs(branch["BP1"].parameters["a"]) < error
        assert not branch.audit.breaches, branch
        assert not branch.audit.remarks, branch
        np.testing.assert_allclose(
            branch.column("max_x") / unit, np.sqrt(np.maximum(branch.values, 0.0) / c), atol=np.sqrt(error / c)
        )


@pytest.mark.parametrize("rate", guarding((1e4, 1e5, 1e6, 1e9, 1e12), 1e9))
def test_cycle_is_born_where_a_rate_vanishes_by_chance(rate):
    """Of the cycle's first state one part is 0, and with it the rate of the other: its plane is not invariant."""
    slow = saltus.HybridSystem.smooth(
        {"x": "m*x - y - x*z", "y": "x + m*y - y*z", "z": "-k*(z - x**2 - y**2)"}, {"m": 0.1, "k": rate}
    )
    rests = saltus.continue_equilibrium(
        saltus.find_equilibrium(slow, {"m": -0.1}, x0=[0.0, 0.0, 0.0]), "m", (-0.5, 0.5)
    )
    cycle = saltus.switch_branch(rests["HB1"])
    branch = saltus.continue_orbit(cycle, "m", (0.0, 0.5))
    np.testing.assert_allclose(branch.column("max_x"), np.sqrt(np.maximum(branch.values, 0.0)), atol=1e-3)
    np.testing.assert_allclose(branch.period, 2.0 * np.pi, rtol=1e-6)
    last = branch.solution(-1)
    np.testing.assert_allclose(sorted(abs(last.multipliers))[1], np.exp(-4.0 * np.pi * last.parameters["m"]), rtol=1e-3)
