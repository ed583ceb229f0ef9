"""Equality is judged in one place: the numbers of other modules make steps and guesses, and they are counted."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

import saltus

PACKAGE = Path(saltus.__file__).parent
SMALL = 1e-5  # a share or an error below which a number most likely judges whether two things are the same
MOST = 120  # constants with real numbers in the modules of orbits and continuation together
# constant that is as small and judges nothing: what it is
KEPT = {
    "orbits/landing/landed.py: _FAR": "guess",
    "orbits/orbit.py: TOLERANCES": "file limit",
    "orbits/stability/hopf.py: _DIFFERENCE": "step",
    "continuation/core/multiple.py: _NEAR": "guess",
    "continuation/core/multiple.py: _NUDGE": "step",
    "continuation/problems/border.py: _NEAR": "step",
    "continuation/problems/critical_points.py: _DIFFERENCE": "step",
    "continuation/problems/ends/homoclinic.py: _NEAREST": "step",
    "continuation/problems/extents.py: _ROUNDED": "step",
    "continuation/runs/beyond.py: _CLOSER": "guess",
    "continuation/runs/seen.py: _PROBES": "guess",
    "continuation/runs/branching.py: _SHIFTS": "guess",
    "continuation/runs/excursion.py: _CONTROL": "step",
    "continuation/runs/field_roots.py: _ROOT_PLACES": "step",
    "verification/motion.py: _ATOL": "step",
    "verification/motion.py: _RTOL": "step",
    "verification/motion.py: _RTOL_STIFF": "step",
    "verification/growth.py: _MOVED": "step",
    "verification/reference.py: _REACH": "step",
}


def constants(room: str) -> Iterator[tuple[str, bool]]:
    """Yield each constant of a room's modules that holds a real number, and whether one is as small as an error."""
    for file in sorted((PACKAGE / room).rglob("*.py")):
        for node in ast.parse(file.read_text(encoding="utf-8")).body:
            if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                continue
            parts = [part.value for part in ast.walk(node.value) if isinstance(part, ast.Constant)]
            numbers = [part for part in parts if isinstance(part, float)]
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if numbers or "finfo" in ast.unparse(node.value):
                name = f"{file.relative_to(PACKAGE).as_posix()}: {ast.unparse(target)}"
                yield name, any(0.0 < number <= SMALL for number in numbers)


def test_orbits_and_continuation_hold_few_numbers_of_their_own() -> None:
    found = [name for room in ("orbits", "continuation") for name, _ in constants(room)]
    assert 0 < len(found) <= MOST, "\n".join(found)


@pytest.mark.parametrize("room", ["orbits", "continuation", "verification"])
def test_a_number_as_small_as_an_error_stands_in_the_scales_unless_it_judges_nothing(room: str) -> None:
    found = {name for name, small in constants(room) if small}
    assert found == {name for name in KEPT if name.startswith(f"{room}/")}
    assert set(KEPT.values()) <= {"step", "quadrature", "guess", "file limit"}


def named() -> Iterator[tuple[Path, str, str]]:
    """Yield file, line before and line of each constant of the scales."""
    for file in sorted((PACKAGE / "scales").glob("*.py")):
        lines = file.read_text(encoding="utf-8").splitlines()
        for before, line in pairwise(lines):
            if line.split(" ")[0].strip("_").isupper() and " = " in line:
                yield file, before, line


def test_every_constant_of_the_scales_has_its_reason() -> None:
    assert len(list(named())) > 200
    for file, before, line in named():
        assert before.startswith("#"), f"{file.name}: {line}"


def test_no_constant_of_the_scales_stands_there_twice() -> None:
    names = [line.split(" ")[0] for _, _, line in named()]
    assert sorted(set(names)) == sorted(names)
