"""What is in the picture of a sweep: every point, a cell for each label, the exponent; what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt

import saltus
import systems
from oracles.closed_forms import LOGISTIC
from saltus import InputError
from saltus.plotting import plot
from saltus.plotting.sweep import PANELS
from saltus.results import Sweep

VALUES = [2.9, 3.2, 3.5, 3.83, 4.0]


@pytest.fixture(scope="module")
def sweep() -> Sweep:
    logistic = systems.carried_map(("x",), {"a": 3.2}, LOGISTIC)
    options = {"section": "map", "quantities": ["x", "x**2"], "observables": ["max(x)"]}
    return saltus.run_sweep(
        logistic,
        "a",
        VALUES,
        x0=[0.3, 0.0],
        options=saltus.options.SweepOptions(follow="both", discard=300, keep=20, workers=1, **options),
    )


def drawn(ax, name):
    (line,) = [line for line in ax.lines if line.get_gid() == name]
    return np.column_stack(line.get_data())


def test_every_point_is_drawn_at_its_value(sweep):
    points = drawn(sweep.plot("x"), "down")
    assert points.shape == (len(VALUES) * 20, 2)
    np.testing.assert_array_equal(points[:, 1], sweep.column("x")[1].ravel())
    np.testing.assert_array_equal(points[:, 0], np.repeat(VALUES, 20))


def test_an_observable_has_a_point_for_each_value(sweep):
    assert drawn(sweep.plot("max(x)"), "up").shape == (len(VALUES), 2)


def test_the_strip_has_a_cell_for_each_label_in_the_colour_of_its_legend(sweep):
    ax = sweep.plot()
    (mesh,) = ax.figure.axes[1].collections
    codes = mesh.get_array().reshape(2, len(VALUES))
    assert len(set(codes[0].tolist())) == 5
    (legend,) = ax.figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["period-1", "period-2", "period-4", "other periods", "chaotic"]
    colours = {patch.get_facecolor() for patch in legend.get_patches()}
    assert colours == set(map(tuple, mesh.cmap(mesh.norm(codes[0]))))


def test_the_lower_panel_is_the_leading_exponent_per_return(sweep):
    ax = sweep.plot()
    line = drawn(ax.figure.axes[2], "up")
    assert line[-1, 1] == pytest.approx(np.log(2.0), abs=0.2)  # at a = 4
    leading, error = sweep.exponents[0, :, 0], sweep.errors[0, :, 0]
    told = np.where(np.abs(leading) > error, leading * sweep.return_times[0], np.nan)  # 0 is that of the flow itself
    np.testing.assert_allclose(line[:, 1], told)


@pytest.fixture(scope="module")
def roessler() -> Sweep:
    field = {"x": "-y - z", "y": "x + a*y", "z": "b + z*(x - c)"}
    system = saltus.HybridSystem.smooth(field, {"a": 0.2, "b": 0.2, "c": 2.5})
    section = saltus.Section("x", direction=1)
    options = saltus.options.SweepOptions(section=section, discard=100, keep=20, exponents=2, workers=1)
    return saltus.run_sweep(system, "c", [2.5, 3.5, 5.7], x0=[1.0, 1.0, 0.0], options=options)


def test_without_a_phase_the_panel_leaves_out_the_exponent_of_the_flow(roessler):
    ax = roessler.plot()
    line = drawn(ax.figure.axes[2], "up")[:, 1]
    assert line[0] < -0.1  # a cycle: the largest multiplier of its Poincare map
    assert line[1] < -0.1
    assert line[2] == pytest.approx(0.0714 * roessler.return_times[0, 2], abs=0.1)  # Wolf et al., 1985


def test_the_default_ordinate_is_no_state_that_the_section_holds(roessler):
    assert roessler.plot().get_ylabel() == "$y$"


def test_given_axes_hold_the_points_alone(sweep):
    figure, ax = plt.subplots()
    assert plot(sweep, "x**2", ax=ax) is ax
    assert figure.axes == [ax]
    with pytest.raises(InputError, match=r"^panels = \['labels'\]: must be left out where Axes are given"):
        plot(sweep, ax=ax, panels=["labels"])


@pytest.mark.parametrize("panels", [(), ("labels",), ("exponent",), PANELS])
def test_panels_stand_under_the_diagram(sweep, panels):
    assert len(sweep.plot(panels=panels).figure.axes) == 1 + len(panels)


def test_what_is_not_done_is_not_drawn(sweep):
    def interrupt(*told):
        raise KeyboardInterrupt

    options = {"section": "map", "discard": 50, "keep": 20, "workers": 1}
    part = saltus.run_sweep(
        sweep.system, "a", VALUES, x0=[0.3, 0.0], progress=interrupt, options=saltus.options.SweepOptions(**options)
    )
    ax = part.plot("x")
    ax.figure.canvas.draw()
    assert np.isfinite(drawn(ax, "up")[:, 1]).sum() == 20
    (mesh,) = ax.figure.axes[1].collections
    assert mesh.get_array().count() == 1


def test_a_wrong_name_is_answered_with_the_nearest_one(sweep):
    with pytest.raises(InputError, match=r"^quantity = 'x\*\*3': must be one of x, x\*\*2, max\(x\); did you mean"):
        sweep.plot("x**3")
    with pytest.raises(
        InputError, match=r"^panels = 'label': must be one of labels, exponent; did you mean 'labels'\?$"
    ):
        sweep.plot(panels=["label"])
