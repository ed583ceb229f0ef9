"""Pictures of whole diagrams."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, InputError, Mode, diagram


@pytest.fixture(scope="module")
def brusselator():
    field = {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}
    system = HybridSystem(("x", "y"), {"A": 1.0, "B": 1.5}, {"flow": Mode(field)}, name="Brusselator")
    return diagram(system, "B", (1.0, 3.0), x0=[1.0, 1.0])


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_equilibria_and_both_extremes_of_cycles_are_drawn(brusselator):
    ax = brusselator.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$B$", "$x$")
    assert labels(ax) == ["stable equilibria", "unstable equilibria", "stable cycles", "HB, Hopf point"]
    tops = [np.max(line.get_ydata()) for line in ax.lines if line.get_linestyle() == "-"]
    assert max(tops) == pytest.approx(brusselator[1].highs[:, 0].max(), rel=1e-3)


def test_a_point_of_two_branches_is_one_marker(brusselator):
    markers = [line for line in brusselator.plot().lines if line.get_marker() == "D"]
    assert sum(len(line.get_xdata()) for line in markers) == 1


def test_another_quantity_and_no_legend(brusselator):
    ax = brusselator.plot("y", legend=False, special=False)
    assert ax.get_ylabel() == "$y$"
    assert ax.get_legend() is None
    assert not any(line.get_marker() == "D" for line in ax.lines)


def test_a_quantity_that_is_none_is_told(brusselator):
    with pytest.raises(InputError, match="y = 'z'"):
        brusselator.plot("z")
