"""Branches traced again at other parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.continuation.way import is_interrupted
from saltus.errors import ConvergenceError, InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.solve import converge

__all__ = ["Retraced", "Trace"]

Trace: TypeAlias = Callable[[Mapping[str, float]], Sequence[Branch]]  # branches at parameters that differ

_HALVINGS = 4  # times that the way from one set of parameters to another is halved


@dataclass
class Retraced:
    """Branches that are traced again at other parameters, each from an orbit of the branch known before.

    Attributes
    ----------
    branches : tuple of Branch
        The branches known last.
    bounds : (float, float)
        Range of the parameter over which they are traced.
    steps : StepControl
        Steps of the branches.
    """

    branches: tuple[Branch, ...]
    bounds: tuple[float, float]
    steps: StepControl = field(default_factory=StepControl)

    def __call__(self, changes: Mapping[str, float]) -> Sequence[Branch]:
        """Return the branches at other parameters.

        Raises
        ------
        ConvergenceError
            An orbit of a branch is not found at these parameters.
        KeyboardInterrupt
            An interrupt has ended a branch.
        """
        found = tuple(self._again(branch, changes) for branch in self.branches)
        self.branches = found
        return found

    def _again(self, branch: Branch, changes: Mapping[str, float]) -> Branch:
        failed: ConvergenceError | None = None
        for index in _starts(branch):
            try:
                start = _moved(branch.orbit(index), changes)
            except ConvergenceError as error:
                failed = error
                continue
            traced = continue_orbit(start, branch.parameter, self.bounds, steps=self.steps)
            if is_interrupted(traced):
                raise KeyboardInterrupt
            return traced
        raise failed or ConvergenceError("orbit of a branch", math.inf, 0, "the branch has no stable orbit")


def _starts(branch: Branch) -> Iterator[int]:
    """Yield points from which a branch is traced again: its ends, and the middle of its stable points."""
    stable = np.flatnonzero(branch.stable & branch.admissible)
    if stable.size:
        yield from dict.fromkeys((int(stable[0]), int(stable[-1]), int(stable[stable.size // 2])))


def _moved(orbit: PeriodicOrbit, changes: Mapping[str, float]) -> PeriodicOrbit:
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
