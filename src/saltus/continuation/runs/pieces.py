"""A branch goes on with its orbits cut into more pieces, in the same direction."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.zero_problem import Point, start_point
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.orbits.cuts import cut, cut_again, cut_within, grows_within, squeezed, started_elsewhere, stretched
from saltus.orbits.problem import OrbitProblem
from saltus.scales import EPS, ROUNDINGS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["in_more_pieces"]


def in_more_pieces(
    branch: OrbitZeroProblem,
    item: Point,
    zero_problem: Callable[[OrbitProblem, NDArray[np.float64]], OrbitZeroProblem],
    *,
    most: int,
) -> tuple[OrbitZeroProblem, Point] | str | None:
    """Return equations and point of an orbit cut into more pieces, or started elsewhere; None where no cut is due.

    Where more pieces are needed than are allowed, this is told.

    Parameters
    ----------
    branch : OrbitZeroProblem
        The equations of the point.
    item : Point
        The point, with the direction of the branch.
    zero_problem : callable
        Returns the zero problem of segment equations near unknowns.
    most : int
        Most pieces.
    """
    elsewhere = again = None
    tense = stretched(branch.problem, item.u, item.J)
    renewed = branch.problem.relaxes or branch.problem.signature.flies
    if renewed and (tense or squeezed(branch.problem, item.u)):
        again = cut_again(branch.problem, item.u, item.J)
    if again is not None:
        problem, u = again
    elif grows_within(branch.problem, item.u, item.J):
        problem, u = cut_within(branch.problem, item.u, item.J)
    elif tense:
        elsewhere = started_elsewhere(branch.problem, item.u) if branch.problem.stiff else None
        problem, u = cut(branch.problem, item.u, item.J) if elsewhere is None else elsewhere
    else:
        return None
    if len(problem.signature) > most:
        return f"an orbit so unstable that it needs more than {most} pieces"
    finer = zero_problem(problem, u)
    try:
        point = start_point(finer, u)
    except ValueError:
        return None
    sense = math.copysign(1.0, _agreement(branch.problem, item, problem, point, moved=elsewhere is not None))
    point = replace(point, tangent=sense * point.tangent, sign=sense * point.sign, arc=item.arc)
    point.examined = finer.examine(point, None)
    return finer, point


def _agreement(problem: OrbitProblem, item: Point, finer: OrbitProblem, point: Point, *, moved: bool) -> float:
    """Return the product of a point's tangent with that of its orbit in more pieces: positive in one direction.

    Period and parameter are compared, which no start changes. Old starts that are starts of new pieces are compared
    too, across the flow, along which a tangent is not determined. Along a canard the orbit may change at one of them
    alone. None is where the orbit starts elsewhere, as it is `moved`.
    """
    n, size, wide = problem.n, problem.size, problem.n + 1
    durations, parts = item.u[n:size:wide], point.u[n : finer.size : wide]
    period = float(durations.sum())
    slopes = [
        float(along[n:end:wide].sum()) / period for along, end in ((item.tangent, size), (point.tangent, finer.size))
    ]
    total = slopes[0] * slopes[1] + float(item.tangent[-1] * point.tangent[-1])
    if moved:
        return total
    begins, scale = np.cumsum(parts) - parts, problem.common_scale
    old = item.tangent[:size].reshape(-1, wide)[:, :n] / scale
    new = point.tangent[: finer.size].reshape(-1, wide)[:, :n] / scale
    flows = problem.flows_at_starts(item.u) / scale
    for begin, flow, before in zip(np.cumsum(durations) - durations, flows, old, strict=True):
        j = int(np.argmin(np.abs(begins - begin)))
        length = float(np.linalg.norm(flow))
        if abs(begins[j] - begin) <= ROUNDINGS * len(parts) * EPS * period and length > 0.0:
            along = flow / length if problem.slides else np.zeros(n)
            total += float((before - along * (along @ before)) @ new[j])
    return total
