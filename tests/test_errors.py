"""Errors: what they say, what they keep, and that they travel between processes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from saltus import errors
from saltus.errors import ConvergenceError, InputError, SaltusError, nearest, shown

RAISED = [
    InputError("x0", [1.0, np.nan], "finite", "see the docs"),
    errors.DefinitionError("mode 'flight'", "z", "a field"),
    errors.ChatteringError(1.5, [0.0, 1.0], "flight", "impact"),
    errors.DivergenceError(2.0, [1e13], "flight", "a state passes 1e+12"),
    ConvergenceError("periodic orbit", 0.5, 3, "start nearer"),
]


@pytest.mark.parametrize("error", RAISED, ids=lambda error: type(error).__name__)
def test_an_error_travels_with_its_text(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert isinstance(again, SaltusError)


@pytest.mark.parametrize("name", sorted(set(errors.__all__) - {"nearest", "shortened", "shown"}))
def test_all_errors_are_saltus_errors_and_bad_input_is_a_value_error(name):
    kind = getattr(errors, name)
    assert issubclass(kind, SaltusError)
    assert issubclass(kind, ValueError) == issubclass(kind, InputError)


def test_a_motion_that_ends_keeps_where_it_did():
    chattering, diverged = RAISED[2], RAISED[3]
    assert (chattering.time, chattering.state, chattering.mode, chattering.transition) == (
        1.5, (0.0, 1.0), "flight", "impact",
    )  # fmt: skip
    assert diverged.state == (1e13,)
    assert errors.ChatteringError(0.0, [], "m").transition == ""


def test_the_nearest_name_is_a_hint_and_a_far_one_is_none():
    assert nearest("Omga", ["Omega", "ybar"]) == "did you mean 'Omega'?"
    assert nearest("quite another", ["Omega", "ybar"]) == ""


def test_values_are_shown_in_a_line_whatever_they_are():
    class Rude:
        def __repr__(self):
            return "two\nlines" * 100

    for value in (Rude(), np.zeros((50, 50)), "text" * 100, [list(range(100))] * 100):
        text = shown(value)
        assert "\n" not in text
        assert len(text) <= 130
