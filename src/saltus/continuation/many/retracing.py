"""Branches traced again at other parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from saltus.continuation.many.way import is_interrupted
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.crossings import extremes_of
from saltus.errors import ConvergenceError, InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.solve import converge
from saltus.scales import EXTREMES_ALIKE

__all__ = ["Follow", "Retraced", "Trace", "is_on", "moved", "orbits_at"]

Trace: TypeAlias = Callable[[Mapping[str, float]], tuple[Branch, ...]]  # branches at parameters that differ
Follow: TypeAlias = Callable[[PeriodicOrbit, Branch], Branch]  # the branch through an orbit, given that known before

_HALVINGS = 4  # times that the way from one set of parameters to another is halved


@dataclass
class Retraced:
    """Branches that are traced again at other parameters, each from an orbit of the branch known before.

    Sheets that appear in between are not on these branches. So `anew` traces a curve from its beginning, where the
    caller doubts what was found.
    """

    branches: tuple[Branch, ...]  # the branches known last
    follow: Follow  # returns the branch through an orbit, given the one known before
    whole: Trace | None = None  # returns all branches at other parameters, found without those known before

    def __call__(self, changes: Mapping[str, float]) -> tuple[Branch, ...]:
        """Return the branches at other parameters.

        Raises
        ------
        ConvergenceError
            An orbit of a branch is not found at these parameters.
        KeyboardInterrupt
            An interrupt has ended a branch.
        """
        found: list[Branch] = []
        for branch in self.branches:
            start = _begun(branch, changes)
            if not any(is_on(other, start) for other in found):
                found.append(self.follow(start, branch))
                if is_interrupted(found[-1]):
                    raise KeyboardInterrupt
        self.branches = tuple(found)
        return self.branches

    def anew(self, changes: Mapping[str, float]) -> tuple[Branch, ...]:
        """Return all branches at other parameters; raises what `__call__` does."""
        if self.whole is None:
            return self(changes)
        self.branches = self.whole(changes)
        return self.branches


def is_on(branch: Branch, orbit: PeriodicOrbit) -> bool:
    """Return whether an orbit is one of a branch."""
    found, wanted = orbits_at(branch, orbit.parameters[branch.parameter]), extremes_of(orbit)
    return any(np.allclose(extremes_of(other), wanted, rtol=EXTREMES_ALIKE) for other in found)


def orbits_at(branch: Branch, value: float) -> tuple[PeriodicOrbit, ...]:
    """Return the orbits of a branch at a value; none where one of them is not found, as beside a grazing."""
    try:
        return branch.at(value)
    except (ConvergenceError, InputError):
        return ()


def _begun(branch: Branch, changes: Mapping[str, float]) -> PeriodicOrbit:
    """Return an orbit of a branch at other parameters."""
    failed: ConvergenceError | None = None
    for index in _starts(branch):
        try:
            return moved(branch.solution(index), changes)
        except ConvergenceError as error:
            failed = error
    raise failed or ConvergenceError("orbit of a branch", math.inf, 0, "the branch has no stable orbit")


def _starts(branch: Branch) -> Iterator[int]:
    """Yield points from which a branch is traced again: its ends, and the middle of its stable points."""
    stable = np.flatnonzero(branch.stable & branch.admissible)
    if stable.size:
        yield from dict.fromkeys((int(stable[0]), int(stable[-1]), int(stable[stable.size // 2])))


def moved(orbit: PeriodicOrbit, changes: Mapping[str, float]) -> PeriodicOrbit:
    """Return the orbit at other parameters, reached in ever shorter steps.

    Raises
    ------
    ConvergenceError
        It is not found.
    """
    target = {name: value for name, value in changes.items() if orbit.parameters[name] != value}
    if not target:
        return orbit
    done, step = 0.0, 1.0
    begin = {name: orbit.parameters[name] for name in target}
    while done < 1.0:
        share = min(done + step, 1.0)
        there = {name: begin[name] + share * (target[name] - begin[name]) for name in target}
        p = orbit.system.parameter_vector({**orbit.parameters, **there})
        try:
            found = converge(orbit.system, orbit.form, orbit.unknowns, p, orbit.tolerance)
            if not found.admissible:
                raise ConvergenceError("orbit at other parameters", math.inf, 0, "; ".join(found.reasons))
        except (ConvergenceError, InputError):
            step *= 0.5
            if step < 0.5**_HALVINGS:
                raise
            continue
        orbit, done = found, share
    return orbit
