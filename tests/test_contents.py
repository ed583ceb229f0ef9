"""What a file holds is checked when it is taken: kinds, shapes, ranges, names."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from saltus.contents import Contents, as_json, checked_texts, complex_of
from saltus.errors import InputError


@pytest.fixture
def held():
    variables = {
        "time": ("step", [0.0, 0.5, np.inf]),
        "mode": ("step", [0, 1, 1]),
        "flag": ("step", [0, 1, 2]),
        "state": ("state", ["x", "v"]),
    }
    attributes = {"t_end": 2.5, "count": 3, "part": 1.5, "name": "ball", "list": '["a", "b"]', "wrong": "[1"}
    return Contents(xr.Dataset(variables, attrs=attributes))


def test_what_is_right_is_returned_in_its_kind(held):
    np.testing.assert_array_equal(held.array("time", ("step",), finite=False), [0.0, 0.5, np.inf])
    assert held.array("mode", ("step",), int, least=0, most=1).dtype == np.int64
    assert held.array("mode", ("step",), bool).tolist() == [False, True, True]
    assert held.array("state", ("state",), str).tolist() == ["x", "v"]
    assert (held.number("t_end"), held.count("count"), held.text("name")) == (2.5, 3, "ball")
    assert held.texts("list") == ["a", "b"]
    assert held.size("step", 3) == 3
    held.expect(step=3, state=2)
    held.names("state", ["x", "v"])


@pytest.mark.parametrize(
    ("take", "message"),
    [
        (lambda h: h.array("gone", ("step",)), "variable 'gone' = None: must be in the file"),
        (lambda h: h.array("time", ("state",)), r"variable 'time''s dimensions = \('step',\): must be \('state',\)"),
        (lambda h: h.array("state", ("state",)), "variable 'state''s kind = .*: must be that of float"),
        (lambda h: h.array("time", ("step",)), "variable 'time' = inf: must be finite"),
        (lambda h: h.array("time", ("step",), least=0.1, finite=False), "'time' = 0.0: must be finite and >= 0.1"),
        (lambda h: h.array("mode", ("step",), int, most=0), "variable 'mode' = 1: must be <= 0"),
        (lambda h: h.array("flag", ("step",), bool), "variable 'flag' = 2: must be between 0 and 1"),
        (lambda h: h.expect(step=4), "dimension 'step' = 3: must be of size 4"),
        (lambda h: h.size("orbit"), "dimension 'orbit' = None: must be of size 0 or more"),
        (lambda h: h.names("state", ["x", "y"]), r"variable 'state' = .*: must be \['x', 'y'\]"),
        (lambda h: h.number("name"), "attribute 'name' = 'ball': must be a number"),
        (lambda h: h.number("t_end", most=2.0), "attribute 't_end' = 2.5: must be <= 2"),
        (lambda h: h.count("part"), "attribute 'part' = 1.5: must be a whole number"),
        (lambda h: h.text("count"), "attribute 'count' = .*: must be a text"),
        (lambda h: h.json("wrong"), r"attribute 'wrong' = '\[1': must be JSON"),
        (lambda h: h.json("list", dict), "must be JSON of dict"),
        (lambda h: h.text("gone"), "attribute 'gone' = None: must be in the file"),
    ],
)
def test_what_is_wrong_is_told_by_its_name(held, take, message):
    with pytest.raises(InputError, match=message):
        take(held)


def test_deep_or_long_texts_are_told_in_a_line():
    for text in ("[" * 100_000, "x" * 100_000):
        with pytest.raises(InputError) as error:
            as_json(text, "attribute 'form'")
        assert len(str(error.value)) < 300
    with pytest.raises(InputError, match="a list of texts"):
        checked_texts([1], "names")


def test_infinite_parts_of_complex_numbers_stay_as_they_are():
    found = complex_of(np.array([np.inf, 1.0]), np.array([0.0, -np.inf]))
    np.testing.assert_array_equal(found.real, [np.inf, 1.0])
    np.testing.assert_array_equal(found.imag, [0.0, -np.inf])
