"""Whether branches meet at a branch point: the equations with the parameter are singular there, not at a fold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.orbits import PeriodicOrbit
from saltus.scales import EQUATIONS_SOLVED, Verdict, critical_error, zero
from saltus.verification.table import AGREES, DIFFERS, Row, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["meeting_rows"]

_WHAT = "branches meet"


def meeting_rows(curve: Any) -> Iterator[Row]:
    """Yield for each branch point of a branch along a parameter whether the parameter acts across the null vector.

    At a fold it does; where two branches meet it does not, and the equations have a second direction.
    """
    if len(curve.varied) != 1 or getattr(curve, "fixed", None) is not None or getattr(curve.system, "laws", None):
        return
    for point in curve.special_points:
        if point.type != "BP" or point.of or getattr(point, "multiplicity", 1) != 1:
            continue
        error = critical_error(getattr(curve, "tolerance", EQUATIONS_SOLVED))
        try:
            found = _across(point, curve.varied[0])
        except SaltusError as reason:
            yield unchecked(_WHAT, point.label, str(reason))._replace(place=point.label)
            continue
        verdict = zero(found, error)
        if verdict is Verdict.UNCLEAR:
            row = unchecked(_WHAT, 0.0, f"{found:.1e}, within ten errors of {error:.1g}")
        else:
            row = Row(_WHAT, 0.0, found, found, error, AGREES if verdict else DIFFERS)
        yield row._replace(place=point.label)


def _across(point: SpecialPoint[Any], name: str) -> float:
    """Return the share of the parameter's action along the left null vector of the equations."""
    solution = point.solution
    problem = solution.problem(name)
    if isinstance(solution, PeriodicOrbit):
        u = np.append(solution.unknowns, solution.parameters[name])
        J, sizes = problem.resolve(u)[1], np.tile(np.append(problem.state_scale, solution.period), problem.segments)
    else:
        own = np.ravel(solution.points if hasattr(solution, "points") else solution.state)
        J = problem.evaluate(np.append(own, solution.parameters[name]))[1]
        sizes = np.where(own != 0.0, np.abs(own), 1.0)
    return _share(J[:, : sizes.size] * sizes, J[:, -1])


def _share(J: NDArray[np.float64], along: NDArray[np.float64]) -> float:
    rows = np.abs(J).max(axis=1, keepdims=True)
    rows = np.where(rows > 0.0, rows, 1.0)
    left = np.linalg.svd(J / rows)[0][:, -1]
    acts = along / rows[:, 0]
    size = float(np.linalg.norm(acts))
    return abs(float(left @ acts)) / size if size > 0.0 else 0.0
