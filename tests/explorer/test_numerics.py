"""Numbers that a person may set reach the steps that they concern, and their Python."""

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.numerics import Numerics, section_names, section_of, with_numerics
from saltus.explorer.steps import Continue, FindOrbit, Move, Place, Sweep

ALL = Numerics(largest=0.02, max_points=30, settle=50.0, tolerance=1e-7, discard=20, keep=8)
TOLD = [
    (FindOrbit(x0=(0.6, 3.1)), "x0=[0.6, 3.1], settle=50.0)"),
    (
        Continue(place=Place(of="orbit1"), parameter="a", bounds=(0.9, 1.8), directions="up"),
        "(0.9, 1.8), directions='up', steps=saltus.StepControl(largest=0.02, max_points=30))",
    ),
    (Move(x0=(0.6, 3.1), periods=3), "periods=3, tolerance=1e-07)"),
    (
        Sweep(parameter="a", bounds=(1.0, 1.2), count=3),
        "SweepOptions(follow='up', discard=20, keep=8, tolerance=1e-07, workers=1))",
    ),
]


@pytest.mark.parametrize(("step", "told"), TOLD, ids=[step.kind for step, _ in TOLD])
def test_numbers_reach_the_steps_that_they_concern(step, told, ball_on_table):
    assert with_numerics(step, Numerics(), ball_on_table) == step
    assert with_numerics(step, ALL, ball_on_table).text().endswith(told)


def test_a_system_without_a_phase_has_a_section_where_its_first_state_is_largest():
    system = saltus.HybridSystem.smooth({"x": "v", "v": "a*v*(1 - x**2) - x"}, {"a": 1.0})
    step = with_numerics(Sweep(parameter="a", bounds=(0.5, 1.0), count=2, x0=(1.0, 0.0)), Numerics(), system)
    assert step.section == ("v", -1)
    assert "section=saltus.Section('v', -1)" in step.text()
    sweep = step.model_copy(update={"observables": ("max(x)",)}).run(system, {}, False)
    highest = sweep.column("max(x)")[..., None]  # the cycle touches its maximum on the section
    assert np.ptp(sweep.column("x") - highest) < 1e-3
    assert abs(sweep.column("x") - highest).max() < 1e-3


def test_sections_are_named_as_people_write_them(ball_on_table):
    assert section_of("", ball_on_table) is None
    assert section_names(ball_on_table)[0] == section_of(ball_on_table.transition_names[0], ball_on_table)
    assert section_of("z = 0.5", ball_on_table) == ("z - (0.5)", 1)
    with pytest.raises(InputError, match="the maximum of one of z, v"):
        section_of("max(w)", ball_on_table)
