"""What a branch of orbits has met before: special points of the start of a closed one, and changes of signature."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.closure import alongside
from saltus.orbits.cuts import merged
from saltus.scales import SAME_POINT

if TYPE_CHECKING:
    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.continuation.runs.two_sided import Found, OneSide
    from saltus.orbits.problem import OrbitProblem

    Beyond = tuple[OrbitZeroProblem, Point]

__all__ = ["points_when_closed", "unless_followed"]


def points_when_closed(half: OneSide, branch: OrbitZeroProblem) -> list[Found]:
    """Return the special points of a branch that passes its start in a step, without those of its first step.

    A start that is special is located within its error on either side: in the first step, in the last one, or in both.

    Parameters
    ----------
    half : OneSide
        The branch without the step.
    branch : OrbitZeroProblem
        Equations of the step.
    """
    count, problem = len(half.points), branch.problem
    first = [found for found in half.specials if found.after == 0]
    return [
        found
        for found in half.specials
        if found.after < count or not any(_same(problem, found, other) for other in first)
    ]


def unless_followed(half: OneSide, went: Beyond | str) -> Beyond | str:
    """Return what a branch goes on with behind its last special point, a change of signature, or why it ends there.

    An orbit that the branch had before, and that goes on in a signature that was followed from it, closes a loop: the
    start need not lie on it, as several branches of symmetric orbits meet.
    """
    if isinstance(went, str):
        return went
    *before, own = half.specials
    form = went[0].problem.signature.whole
    for old in before:
        pieces = [half.points[i][0].problem for i in (old.after - 1, old.after, old.after + 1) if i < len(half.points)]
        whole = own.solution.form.whole
        fitting = next((problem for problem in pieces if problem.signature.whole == whole), None)
        followed = any(problem.signature.whole == form for problem in pieces)
        if followed and fitting is not None and _same(fitting, own, old):
            return "from which on the branch is followed already"
    return went


def _same(problem: OrbitProblem, found: Found, other: Found) -> bool:
    """Return whether two special points of a branch are one, within the error of both.

    problem: equations whose segments, in one piece each, have as many unknowns.
    """
    one, two, wide = found.solution, other.solution, problem.n + 1
    form = one.form.whole
    if found is other or found.name != other.name or form != two.form.whole or form != problem.signature.whole:
        return False
    own, its = merged(one.form, one.unknowns), merged(two.form, two.unknowns)
    scale = np.tile(np.append(problem.state_scale, one.period), own.size // wide)
    apart = np.abs(alongside(problem, its, own) - own) / scale
    size = max(abs(value) for value in one.parameters.values())
    moved = max(abs(one.parameters[name] - two.parameters[name]) for name in one.parameters)
    return bool(max(np.max(apart), moved / size) < max(SAME_POINT, problem.tol))
