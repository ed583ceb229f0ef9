"""Equality is judged in one place: constants elsewhere that are as small as errors are counted, and grow no more."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import saltus

PACKAGE = Path(saltus.__file__).parent
SMALL = 1e-5  # a share or an error below which a constant most likely judges whether two things are the same
# room: its small constants when they were counted last; what is judged anew goes into `scales.py`
MOST = {"orbits": 60, "continuation": 125, "verification": 24}


def small_constants(file: Path) -> Iterator[str]:
    """Yield the names of a module's constants that hold a number below `SMALL`."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        numbers = [part.value for part in ast.walk(node.value) if isinstance(part, ast.Constant)]
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if any(isinstance(number, float) and 0.0 < number <= SMALL for number in numbers):
            yield f"{file.relative_to(PACKAGE)}: {ast.unparse(target)}"


@pytest.mark.parametrize("room", MOST)
def test_no_room_has_more_constants_that_judge_equality_than_when_they_were_counted(room: str) -> None:
    found = [name for file in sorted((PACKAGE / room).rglob("*.py")) for name in small_constants(file)]
    assert len(found) <= MOST[room], "\n".join(found)


def test_every_constant_of_the_scales_has_its_reason() -> None:
    lines = (PACKAGE / "scales.py").read_text(encoding="utf-8").splitlines()
    named = [i for i, line in enumerate(lines) if line[:1].isupper() and " = " in line and line.split(" ")[0].isupper()]
    assert len(named) > 5
    for i in named:
        assert lines[i - 1].startswith("#"), lines[i]
