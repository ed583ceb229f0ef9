"""Each known answer is what saltus computes, to all digits of its source, and the page of answers says so."""

from __future__ import annotations

import runpy
from decimal import Decimal
from pathlib import Path

import pytest
import sympy

from answers.answer import Answer, unit_of, values
from answers.table import ANSWERS
from selection import CAMPAIGN

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "verified_answers.md").read_text(encoding="utf-8")
TOOL = runpy.run_path(str(ROOT / "tools" / "answers_page.py"))
EVERY = [answer for answers in ANSWERS.values() for answer in answers]
SHOWN = TOOL["computed_of"](PAGE)
FEWEST = 40


def test_the_page_has_a_row_for_each_answer_and_what_it_shows_is_what_is_printed():
    assert TOOL["page"](SHOWN) == PAGE, "run python tools/answers_page.py"
    assert len(EVERY) == len(SHOWN) >= FEWEST
    for answer, shown in zip(EVERY, SHOWN, strict=True):
        found = tuple(float(text) for text in TOOL["numbers"](shown)) if answer.numbers else shown
        assert answer.agrees(found), answer.problem


@pytest.mark.parametrize(
    ("answer", "shown"),
    [
        pytest.param(answer, shown, marks=CAMPAIGN if answer.campaign else (), id=f"{i}-{answer.problem[:40]}")
        for i, (answer, shown) in enumerate(zip(EVERY, SHOWN, strict=True))
    ],
)
def test_an_answer_agrees_to_all_digits(answer, shown):
    found = answer.compute()
    assert answer.agrees(found), f"{found} is not {answer.printed}"
    if answer.numbers:
        texts = TOOL["numbers"](shown)
        for printed, text, value in zip(answer.numbers, texts, values(found), strict=True):
            allowed = max(unit_of(Decimal(text)), unit_of(printed) / 10)
            assert abs(Decimal(text) - Decimal(repr(float(value)))) <= allowed, "run python tools/answers_page.py"


@pytest.mark.parametrize("answer", [one for one in EVERY if one.formula], ids=lambda answer: answer.problem[:40])
def test_a_closed_form_has_the_printed_digits(answer):
    exact = sympy.sympify(f"[{answer.formula}]", rational=True)
    assert answer.agrees(tuple(float(value.evalf(30)) for value in exact))


def test_a_wrong_digit_is_seen():
    answer = Answer("a problem", "a source", "(1.250, -2.5e-4)", lambda: (1.2504, -2.54e-4))
    assert answer.agrees(answer.compute())
    assert answer.digits == "4, 2"
    assert answer.shown(answer.compute()) == "(1.25040, -2.540e-4)"
    assert not answer.agrees((1.2506, -2.54e-4))
    assert not answer.agrees((1.2504, -2.56e-4))
    with pytest.raises(ValueError, match="shorter"):
        answer.agrees((1.2504,))
    word = Answer("a problem", "a source", "chaotic", lambda: "chaotic")
    assert (word.agrees("chaotic"), word.agrees("period-2"), word.digits) == (True, False, "")
