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


@pytest.mark.parametrize("residual", [0.0, np.inf, np.nan])
def test_what_has_no_residual_is_not_said_to_have_failed_by_one(residual):
    told = str(ConvergenceError("cycle at the Hopf point", residual, 0, "it has no imaginary pair"))
    assert told == "cycle at the Hopf point: not found; it has no imaginary pair"


@pytest.mark.parametrize("most", range(26, 80))
def test_a_long_text_is_cut_between_words(most):
    text = "the argument of a root is negative: a0_nm - z1_nm + 2*sin(theta) is -0.5 in (a0_nm - z1_nm)**0.5"
    told = errors.shortened(text, most)
    head, tail = told.split("...")
    assert len(told) <= most
    assert {*head.split(), *tail.split()} <= set(text.split())


def test_a_single_long_word_is_cut_where_it_must():
    assert errors.shortened("x" * 100, 21) == "x" * 9 + "..." + "x" * 9


def test_of_a_motion_that_diverges_the_reason_is_told_whole():
    reason = "the argument of a root is negative: Zc_nm - a0_nm - z1_nm is -0.001 in (Zc_nm - a0_nm - z1_nm)**(3/2)"
    told = str(errors.DivergenceError(1.0 / 3.0, [0.1 + k / 3.0 for k in range(12)], "contact", reason))
    assert told.endswith(reason)
    assert len(told) < 300
