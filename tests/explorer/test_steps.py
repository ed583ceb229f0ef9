"""Steps are calls of the package: what runs, what is kept as JSON and what is told as Python are the same."""

import json

import numpy as np
import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.steps import (
    Attract,
    Basin,
    Cascade,
    Continue,
    FindEquilibrium,
    FindOrbit,
    Follow,
    Move,
    Place,
    Sweep,
    Switch,
    step_from,
    taken,
)

PLACE = Place(of="branch1", label="SN1")
STEPS = [
    FindOrbit(parameters={"a": 1.2}, x0=(0.6, 3.1, 0.5)),
    FindEquilibrium(parameters={"B": 1.5}, x0=(1.0, 1.5), mode="reaction"),
    Continue(place=Place(of="branch1", index=7), parameter="a", bounds=(0.9, 1.8)),
    Switch(place=Place(of="branch1", label="PD1"), parameter="a", bounds=(0.9, 1.8)),
    Follow(place=PLACE, parameters=("a", "e"), bounds=((0.1, 3.0), (0.1, 0.9))),
    Cascade(place=Place(of="branch1", label="PD1"), bounds=(0.9, 1.8)),
    Sweep(parameter="a", bounds=(0.9, 1.8), count=5, observables=("max(z)",)),
    Move(parameters={"a": 1.3}, x0=(0.0, 1.0), periods=3),
    Attract(region={"z": (0.0, 1.0), "v": (-1.0, 1.0)}),
    Basin(grid={"z": (0.0, 1.0, 4), "v": 0.5}, attractors="attractors1"),
]


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.kind)
def test_a_step_is_read_back_equal_from_json(step):
    assert step_from(json.loads(json.dumps(step.model_dump()))) == step


@pytest.mark.parametrize(
    "step",
    [
        STEPS[0],
        STEPS[2],
        STEPS[3],
        STEPS[4],
        Cascade(place=Place(of="branch1", label="PD1"), bounds=(0.9, 1.8), doublings=1),
        Sweep(parameter="a", bounds=(1.15, 1.2), count=2, x0=(0.6, 3.1), direction="down"),
        Move(parameters={"a": 1.2}, x0=(0.6, 3.1), t_end=2.0),
    ],
    ids=lambda step: step.kind,
)
def test_the_python_of_a_step_makes_the_same_result(step, results, ball_on_table):
    told: dict = {"saltus": saltus, "np": np, "system": ball_on_table, **results}
    assert step.run(ball_on_table, results, False) == eval(step.text(), told)


def test_cycles_begin_at_a_hopf_point(rests):
    _, found = rests
    assert found["branch1"]["HB1"].parameters["B"] == pytest.approx(2.0, abs=1e-10)  # 1 + A^2
    assert found["branch2"].period[-1] > 2.0 * np.pi


@pytest.mark.parametrize(
    ("plain", "message"),
    [
        ({"kind": "find_orbit", "x0": ["import os"]}, "step's find_orbit.x0.0 = 'import os'"),
        ({"kind": "erase"}, "step = "),
        ({"kind": "sweep", "parameter": "a", "bounds": [0.0, 1.0], "count": 10**9}, "less than or equal to 10000"),
        ({"kind": "find_orbit", "command": "x"}, "Extra inputs are not permitted"),
        ("find_orbit", "step = 'find_orbit'"),
    ],
)
def test_plain_data_that_are_no_step_are_refused(plain, message):
    with pytest.raises(InputError) as caught:
        step_from(plain)
    assert message in str(caught.value)


def test_a_place_that_is_not_there_is_told(results, ball_on_table):
    with pytest.raises(InputError, match="result = 'branch9'"):
        Continue(place=Place(of="branch9"), parameter="a", bounds=(0.9, 1.8)).run(ball_on_table, results, False)
    with pytest.raises(InputError, match="label = 'SN9'"):
        Switch(place=Place(of="branch1", label="SN9"), parameter="a", bounds=(0.9, 1.8)).run(
            ball_on_table, results, False
        )


def test_a_place_is_told_as_python(results):
    for place, text in {
        Place(of="orbit1"): "orbit1",
        Place(of="branch1", index=3): "branch1.solution(3)",
        PLACE: "branch1['SN1'].orbit",
    }.items():
        assert place.text() == text
        assert taken(place, results) == eval(text, dict(results))


def test_a_step_names_the_results_that_it_takes():
    assert {step.kind: step.needs for step in STEPS if step.needs} == {
        "continue": ("branch1",), "switch": ("branch1",), "follow": ("branch1",), "cascade": ("branch1",),
        "basin": ("attractors1",),
    }  # fmt: skip
