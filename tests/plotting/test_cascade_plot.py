"""Pictures of cascades: all branches, the doublings between them, and where they accumulate."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt

import saltus
import systems
from oracles.closed_forms import LOGISTIC, ImpactOrbit
from saltus import InputError
from saltus.plotting import style

ACCUMULATION = 3.569945671870945


@pytest.fixture(scope="module")
def cascade() -> saltus.results.Cascade:
    start = saltus.solve_orbit(systems.carried_map(("x",), {"a": 2.5}, LOGISTIC), {}, [("carry", "map", [0.6, 0.0], 1)])
    return saltus.follow_cascade(saltus.continue_orbit(start, "a", (2.0, 3.4))["PD1"], (2.5, 4.0), doublings=3)


def lines(ax, linestyle):
    return [line for line in ax.lines if line.get_linestyle() == linestyle and line.get_marker() == "None"]


def two_cycle(a):
    return (a + 1.0 + np.array([-1.0, 1.0]) * np.sqrt((a - 3.0) * (a + 1.0))) / (2.0 * a)


def test_each_branch_is_drawn_from_its_doubling_to_the_next_at_all_returns(cascade):
    ax = cascade.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$x$")
    stable = sorted(lines(ax, "-"), key=lambda line: line.get_xdata()[0])
    assert len(stable) == 2 + 4 + 8
    for line, level in zip(stable, [0] * 2 + [1] * 4 + [2] * 8, strict=True):
        first, last = cascade.values[level : level + 2]
        assert line.get_xdata()[0] == pytest.approx(first, abs=1e-4)
        assert line.get_xdata()[-1] == pytest.approx(last, abs=1e-9)
    ends = sorted(line.get_ydata()[-1] for line in stable[:2])
    np.testing.assert_allclose(ends, two_cycle(cascade.values[1]), atol=1e-9)


def test_every_doubling_is_marked_on_each_curve_that_forks(cascade):
    (marks,) = [line for line in cascade.plot().lines if line.get_marker() == style.SPECIAL["PD"].marker]
    np.testing.assert_array_equal(marks.get_xdata(), np.repeat(cascade.values, [1, 2, 4, 8]))
    assert marks.get_ydata()[0] == cascade.start.orbit.x0[0]
    np.testing.assert_allclose(sorted(marks.get_ydata()[1:3]), two_cycle(cascade.values[1]), atol=1e-9)


def test_returns_of_a_forced_system_are_once_a_period(impact_oscillator):
    """Against a motion that is followed from the first return on."""
    form = ImpactOrbit(w=0.7)
    start = saltus.find_orbit(impact_oscillator, {"w": 0.7, "A": 0.4}, [0.0, 0.0])
    branch = saltus.continue_orbit(start, "A", (0.05, 2.0))
    cascade = saltus.follow_cascade(branch["PD1"], (0.05, 2.0), doublings=1)
    curves = lines(cascade.plot("A", "v"), "-")
    # one of them leaps where the impact passes the phase of the return, and is drawn in two parts
    leap = [curve for curve in curves if curve.get_xdata()[-1] > cascade.values[1] + 1e-6]
    assert len(curves) == 3
    assert len(leap) == 1
    curves.remove(leap[0])
    A, last = cascade.branches[0].values[-1], cascade.branches[0].solution(-1)
    motion = saltus.simulate(impact_oscillator, {"w": form.w, "A": A}, last.x0, periods=2)
    ends = sorted(curve.get_ydata()[-1] for curve in curves)
    np.testing.assert_allclose(ends, sorted(motion(motion.t_end * np.array([0.0, 0.5]))[:, 1]), atol=1e-8)


def test_a_dotted_line_is_where_the_doublings_accumulate(cascade):
    (dotted,) = lines(cascade.plot(), ":")
    assert dotted.get_xdata() == pytest.approx([ACCUMULATION] * 2, abs=1e-4)
    assert not lines(cascade.plot("max_x", "period"), ":")


def test_options_leave_out_marks_and_legend(cascade):
    _, ax = plt.subplots()
    assert cascade.plot(ax=ax, special=False, legend=False) is ax
    assert ax.get_legend() is None
    assert {line.get_marker() for line in ax.lines} == {"None"}
    assert not lines(ax, ":")


def test_a_cascade_without_branches_is_an_empty_picture(cascade):
    assert not saltus.results.Cascade(cascade.start, (), "by hand").plot().lines


def test_a_wrong_name_is_answered_with_the_nearest_one(cascade):
    with pytest.raises(InputError, match="did you mean 'max_x'"):
        cascade.plot("a", "mx_x")
