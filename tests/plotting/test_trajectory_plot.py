"""Pictures of trajectories."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.errors import InputError
from saltus.plotting import style


@pytest.fixture(scope="module")
def bounce(ball):
    return saltus.simulate(ball, {}, [1.0, 0.0], t_end=3.0)


def test_each_flight_is_a_curve_from_event_to_event(bounce):
    ax = bounce.plot("t", "z")
    curves = [line for line in ax.lines if line.get_linestyle() == "-"]
    hits = bounce.events["time"]
    assert len(curves) == len(hits) + 1
    assert [float(curve.get_xdata()[-1]) for curve in curves] == [*hits.tolist(), 3.0]
    for curve in curves[:-1]:
        assert curve.get_ydata()[-1] == pytest.approx(0.0, abs=1e-12)
    t, z = curves[0].get_data()
    assert z == pytest.approx(1.0 - 0.5 * t**2, abs=1e-12)  # free fall
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["flight"]


def test_resets_are_joined_by_dotted_lines(bounce):
    ax = bounce.plot("z", "v")
    jumps = [line for line in ax.lines if line.get_linestyle() == ":"]
    assert len(jumps) == len(bounce.events)
    for jump in jumps:
        assert jump.get_ydata()[1] == pytest.approx(-0.5 * jump.get_ydata()[0], abs=1e-12)


def test_outputs_are_drawn(bounce):
    ax = bounce.plot("t", "energy")
    energies = [float(line.get_ydata()[0]) for line in ax.lines if line.get_linestyle() == "-"]
    assert energies == pytest.approx([0.25**i for i in range(len(energies))], abs=1e-12)


def test_any_expression_is_drawn(bounce):
    ax = bounce.plot("t", "2*energy - v**2")
    for line in (line for line in ax.lines if line.get_linestyle() == "-"):
        assert line.get_ydata() == pytest.approx(2.0 * bounce.output("z", line.get_xdata()), abs=1e-12)
    assert ax.get_ylabel() == "2*energy - v**2"


def test_gap_and_its_rate_are_drawn_for_a_tapping_tip():
    motion = saltus.simulate(afm.tapping_mode(afm.table1(), modes=2), {}, [0.1, 0.0, 0.2, 0.0], periods=2)
    z, v = np.concatenate([line.get_xydata() for line in motion.plot("z", "v").lines]).T
    assert np.ptp(z) > 0.5
    assert np.ptp(v) > 0.5


def test_modes_have_their_colours(stick_slip):
    motion = saltus.simulate(stick_slip, {}, [0.0, 0.3], mode="stick", t_end=12.0)
    ax = motion.plot("t", "v")
    colours = {line.get_color() for line in ax.lines if line.get_linestyle() == "-"}
    assert colours == {style.colour_of_mode(0), style.colour_of_mode(1)}
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {"slip", "stick"}


def test_the_phase_wraps_without_a_line_across(impact_oscillator):
    motion = saltus.simulate(impact_oscillator, {"A": 0.05}, [0.0, 0.0], periods=3)
    ax = motion.plot("theta", "x")
    curves = [line.get_xdata() for line in ax.lines]
    assert all(np.all(np.diff(curve) >= 0.0) for curve in curves)
    assert max(curve.max() for curve in curves) == pytest.approx(2.0 * math.pi)


def test_the_first_state_against_time_is_the_default(bounce):
    ax = bounce.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$t$", "$z$")


def test_a_wrong_name_is_answered_with_the_nearest_one(bounce):
    allowed = r"in z, v, g, e, energy and pi, but 'enrgy' is unknown; did you mean 'energy'\?"
    with pytest.raises(InputError, match=rf"expression = 'enrgy': must be {allowed}"):
        bounce.plot("t", "enrgy")


@pytest.mark.campaign
def test_plotting_imports_matplotlib_only_to_draw():
    code = "import sys, saltus.plotting, saltus.plotting.style; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
