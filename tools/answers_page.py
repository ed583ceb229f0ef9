"""Write docs/verified_answers.md from the known answers of the tests: python tools/answers_page.py [--all].

Without an option what the page shows of an answer that it has is kept; with `--all` each answer is computed anew.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "verified_answers.md"
if str(ROOT / "tests") not in sys.path:
    sys.path.insert(0, str(ROOT / "tests"))

from answers.answer import NUMBER, Answer  # noqa: E402
from answers.table import ANSWERS  # noqa: E402

ROW = re.compile(r"^\| (?!problem )(.+) \| (.+) \| (.+) \| (.+) \| (.*) \|$", re.MULTILINE)
INTRODUCTION = """# Verified answers

Problems whose answers are known from elsewhere, and what saltus computes for them. Tests hold each row.

An answer is *verified* if the computed value, rounded to the digits shown as printed, is the printed value. Closed
forms are evaluated by SymPy, and a test holds their printed digits too. Other sources are papers, or a computation
apart from saltus, by the method that is named. A source with more digits is quoted rounded, to those that the
computation resolves. No row allows a tolerance.

There are {count} answers; {closed} of them have a closed form in the table.

- To check the rows that guard each change: `pytest tests/test_answers.py -m "not campaign"`.
- To check all of them: `pytest tests/test_answers.py`, or `make campaign` for the others.
- To add one: append an `Answer` to a list in `tests/answers/`, with problem, source, printed digits and a function
  that computes it. Then run `python tools/answers_page.py`. An answer that takes more than a second has
  `campaign=True`.

Computed values of ten digits and more are shown as rounded as the printed ones, shorter ones with two digits more.
"""


def page(computed: list[str]) -> str:
    """Return the text of the page; `computed` is what it shows of each answer, in their order."""
    every = [answer for answers in ANSWERS.values() for answer in answers]
    closed = sum(bool(answer.formula) for answer in every)
    lines = [INTRODUCTION.format(count=len(every), closed=closed)]
    shown = iter(computed)
    for kind, answers in ANSWERS.items():
        lines += [f"## {kind}\n", "| problem | source | printed | computed | digits |", "|---|---|---|---|---|"]
        lines += [f"| {' | '.join((*_told(answer), next(shown), answer.digits))} |" for answer in answers]
        lines.append("")
    return "\n".join(lines)


def _told(answer: Answer) -> tuple[str, str, str]:
    source = f"{answer.source}: `{answer.formula}`" if answer.formula else answer.source
    return _cell(answer.problem), _cell(source), answer.printed


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def computed_of(text: str) -> list[str]:
    """Return what a page shows as computed, row by row."""
    return [row[3] for row in ROW.findall(text)]


def numbers(text: str) -> list[str]:
    return NUMBER.findall(text)


def _known(text: str) -> dict[tuple[str, ...], str]:
    return {row[:3]: row[3] for row in ROW.findall(text)}


if __name__ == "__main__":
    known = {} if "--all" in sys.argv or not PAGE.exists() else _known(PAGE.read_text(encoding="utf-8"))
    every = [answer for answers in ANSWERS.values() for answer in answers]
    shown = [known.get(_told(answer)) or answer.shown(answer.compute()) for answer in every]
    PAGE.write_text(page(shown), encoding="utf-8")
