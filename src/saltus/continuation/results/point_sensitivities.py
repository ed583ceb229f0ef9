"""How a special point moves along its branch as other parameters change.

docs/theory/sensitivities.md, "Special points", derives the equations. The point solves those of its branch together
with the conditions that make it critical. This system is regular, also where the equations alone are not.

References
----------
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 3 and 4 (bordered systems); Moore,
in Numerical Methods for Bifurcation Problems, Birkhaeuser 1984, 355-367 (branch points).
"""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.problems.critical_points import CriticalOrbit, critical_condition
from saltus.continuation.problems.extents import extents
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.maps.orbit import MapOrbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.stability.critical import Branching, scaling
from saltus.orbits.stability.multiplier_slopes import ROUGH
from saltus.scales import REGULAR, UNFORCED_BY_PARAMETER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


__all__ = ["Place", "moved"]

_ORBITS = ("SN", "PD", "TR", "BP", *CHANGES)  # types of special points that move, of orbits
_EQUILIBRIA = ("SN", "HB", "BE")  # the same, of equilibria
_MAP_ORBITS = ("SN", "PD", "TR", "BC")  # the same, of orbits of maps


class Place(NamedTuple):
    """What is asked of a special point."""

    kind: str  # its type
    along: str  # the parameter of its branch
    others: tuple[str, ...]  # parameters that change
    sizes: NDArray[np.float64] | None = None  # typical sizes of the states, where they are known

    def active(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return the parameter of the branch and the others, in the system's order."""
        return tuple(name for name in names if name == self.along or name in self.others)

    def check(self, known: tuple[str, ...]) -> None:
        """Raise `InputError` for a type of special point that does not move as these do."""
        if self.kind not in known:
            raise InputError(
                "type", self.kind, f"one of {', '.join(known)}", "no derivatives are known of other points"
            )

    def split(self, J: NDArray[np.float64], names: tuple[str, ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the columns of the branch's parameter, (rows, 1), and of the others, from those of all active ones."""
        return J[:, [names.index(self.along)]], J[:, [names.index(name) for name in self.others]]


@singledispatch
def moved(solution: Any, place: Place) -> tuple[NDArray[np.float64], str]:
    """Return the derivatives of the branch's parameter at a special point by the others, and a note on them.

    A kind of solution registers what it knows.

    Parameters
    ----------
    solution : Solution
        The solution at the point.
    place : Place
        What is asked of the point.

    Returns
    -------
    slopes : ndarray, shape (others,)
        NaN where a branch point does not persist as a parameter changes.
    note : str
        What a user should know of them; empty for nothing.

    Raises
    ------
    InputError
        The type is another one, or the solution is not critical. The parameter of the branch does not move through the
        point.
    """
    raise InputError("type", place.kind, "that of a point that moves", "none is known of this kind of solution")


@moved.register(PeriodicOrbit)
def _(orbit: PeriodicOrbit, place: Place) -> tuple[NDArray[np.float64], str]:
    rooted = place.kind in ("PD", "TR", "BP") and orbit.system.compiled.rooted[list(orbit.form.modes)].any()
    return _moved_orbit(orbit, place), ROUGH if rooted else ""


def _moved_orbit(orbit: PeriodicOrbit, place: Place) -> NDArray[np.float64]:
    place.check(_ORBITS)
    names = place.active(orbit.system.parameter_names)
    values = np.array([orbit.parameters[name] for name in names])
    critical = CriticalOrbit(place.kind, orbit, names, np.ones(len(names)), values, place.sizes, (place.along,))
    if place.kind == "SN":
        problem, u = critical.problem(orbit.form, orbit.unknowns)
        J = problem.resolve(u)[1]
        columns, rows = scaling(problem, J, u)
        return _folded(
            rows[:, None] * J[:, : problem.size] * columns, rows[:, None] * J[:, problem.size :], place, names
        )
    problem, u, condition, extra = critical.extended()
    J, size = problem.resolve(u)[1], problem.size
    _, gradient, further = condition.evaluate(u, extra, J)
    columns, _ = scaling(problem, J, u)
    forced = condition.forcing[:, None] if isinstance(condition, Branching) else np.zeros((size, extra.size))
    own, others = place.split(np.vstack([J[:, size:], gradient[:, size:]]), names)
    matrix = np.hstack(
        [np.vstack([J[:, :size] * columns, gradient[:, :size] * columns]), np.vstack([forced, further]), own]
    )
    moved = _solved(matrix, others, place)
    slopes = moved[-1]
    if isinstance(condition, Branching):
        change = np.linalg.norm(others[:size] / np.linalg.norm(condition.forcing), axis=0)
        slopes = np.where(np.abs(moved[size]) <= UNFORCED_BY_PARAMETER * change, slopes, np.nan)
    return np.asarray(slopes)


@moved.register(Equilibrium)
def _(solution: Equilibrium, place: Place) -> tuple[NDArray[np.float64], str]:
    place.check(_EQUILIBRIA)
    return _moved(solution, place), ""


@moved.register(MapOrbit)
def _(solution: MapOrbit, place: Place) -> tuple[NDArray[np.float64], str]:
    place.check(_MAP_ORBITS)
    return _moved(solution, place), ""


def _moved(solution: Equilibrium | MapOrbit, place: Place) -> NDArray[np.float64]:
    """Return the derivatives at a special point of algebraic equations."""
    names = place.active(solution.system.parameter_names)
    problem = solution.problem(*names)
    u = np.append(solution.unknowns, problem.p[list(problem.active)])
    sizes = extents(problem, u) if place.sizes is None else place.sizes
    n, J = problem.n, problem.evaluate(u)[1]
    if place.kind == "SN":
        return _folded(J[:, :n] * sizes / sizes[:, None], J[:, n:] / sizes[:, None], place, names)
    condition, extra = critical_condition(solution, place.kind, problem, u, sizes)
    _, gradient, further = condition.evaluate(u, extra, J)
    own, others = place.split(np.vstack([J[:, n:], gradient[:, n:]]), names)
    states = np.vstack([J[:, :n], gradient[:, :n]]) * sizes
    matrix = np.hstack([states, np.vstack([np.zeros((n, extra.size)), further]), own])
    return np.asarray(_solved(matrix, others, place)[-1])


def _folded(
    A: NDArray[np.float64], by: NDArray[np.float64], place: Place, names: tuple[str, ...]
) -> NDArray[np.float64]:
    """Return how a fold moves: the left null vector of A takes the change of all unknowns out of the equations."""
    left = np.linalg.svd(A)[0][:, -1]
    own, others = place.split(by, names)
    along = float(left @ own[:, 0])
    if not abs(along) > UNFORCED_BY_PARAMETER * float(np.linalg.norm(own)):
        raise _unmoved(place)
    return np.asarray(-(left @ others) / along)


def _solved(matrix: NDArray[np.float64], others: NDArray[np.float64], place: Place) -> NDArray[np.float64]:
    """Return the derivatives of all unknowns of a square system, the parameter of the branch last."""
    rows = 1.0 / np.maximum(np.abs(matrix).max(axis=1, keepdims=True), 1e-300)
    sizes = np.maximum(np.abs(rows * matrix).max(axis=0), 1e-300)
    scaled = rows * matrix / sizes
    values = np.linalg.svd(scaled, compute_uv=False)
    if not values[-1] > REGULAR * values[0]:
        raise _unmoved(place)
    return np.asarray(-np.linalg.solve(scaled, rows * others) / sizes[:, None])


def _unmoved(place: Place) -> InputError:
    hint = "two special points meet there, or it turns in this parameter"
    return InputError(
        f"{place.kind} along {place.along}", "not isolated", "a point that the parameter passes once", hint
    )
