"""Motions about an equilibrium, by the field linearised there: what a portrait of it shows besides the point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.equilibria import Equilibrium

__all__ = ["linear_motions"]

_STARTS = 6  # motions in a plane
_SIZE = 0.1  # of the portrait, over the size of a state
_BEYOND = 1.25  # distance at which a motion ends, over that at which it begins
_LARGE = 4.0  # the same from which on a motion is cut off at all
_DECAYS = 5.0  # times in which the slowest motion shrinks e-fold, that are shown
_TURNS = 6.0  # turns of the fastest oscillation that are shown at most
_POINTS = 400  # points of a motion


def linear_motions(rest: Equilibrium, names: Sequence[str]) -> list[NDArray[np.float64]]:
    """Return motions of the field linearised at an equilibrium, from places about it in the plane of two states.

    The motion from x0 + u is x0 + exp(t J) u, with the Jacobian J of the field, taken by its eigenvectors. With ``t``,
    and where nothing grows, it goes forward; where nothing decays backward; about a saddle both ways, up to its start's
    distance.

    Parameters
    ----------
    rest : Equilibrium
        The equilibrium.
    names : sequence of str
        States, or ``t`` and a state; where there are others, no motions are returned.

    Returns
    -------
    list of ndarray, shape (point, 2)

    Examples
    --------
    >>> from saltus import HybridSystem, find_equilibrium
    >>> decay = find_equilibrium(HybridSystem.smooth({"x": "1 - x"}), x0=[0.5])
    >>> curve = linear_motions(decay, ("t", "x"))[0]
    >>> bool(np.allclose(curve[:, 1] - 1.0, 0.1 * np.exp(-curve[:, 0])))
    True
    """
    states, shown = rest.system.states, [name for name in names if name != "t"]
    if not shown or any(name not in states for name in shown):
        return []
    problem = rest.problem()
    J = problem.evaluate(rest.state)[1][:, : len(states)]
    values, vectors = np.linalg.eig(J)
    if not np.isfinite(vectors).all() or np.linalg.cond(vectors) > 1e12:
        return []
    inverse, where = np.linalg.inv(vectors), [states.index(name) for name in shown]
    sizes = _SIZE * _sizes(rest)[where]
    times, found = _times(values, names), []
    for direction in _directions(len(shown)):
        offset = np.zeros(len(states))
        offset[where] = sizes * direction
        paths = np.exp(np.outer(times, values)) * (inverse @ offset)
        moved = (paths @ vectors.T).real[:, where]
        away = np.linalg.norm(moved / sizes, axis=1)
        kept = _around(away <= _BEYOND, int(np.argmin(np.abs(times)))) if away.max() > _LARGE else slice(None)
        columns = {name: rest.state[k] + moved[kept, i] for i, (name, k) in enumerate(zip(shown, where, strict=True))}
        found.append(np.column_stack([(columns | {"t": times[kept]})[name] for name in names]))
    return found


def _sizes(rest: Equilibrium) -> NDArray[np.float64]:
    """Return sizes of the states; of one that vanishes that of the largest, or 1."""
    sizes = np.abs(rest.state)
    return np.where(sizes > 0.0, sizes, float(sizes.max()) or 1.0)


def _directions(count: int) -> NDArray[np.float64]:
    if count == 1:
        return np.array([[1.0], [-1.0]])
    angles = 2.0 * np.pi * np.arange(_STARTS) / _STARTS
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _times(values: NDArray[np.complex128], names: Sequence[str]) -> NDArray[np.float64]:
    """Return times of a few decays or turns, forward or backward or both."""
    rates, turns = np.abs(values.real), np.abs(values.imag)
    slow = rates[rates > 1e-9 * max(float(np.abs(values).max()), 1e-300)]
    span = _DECAYS / float(slow.min()) if slow.size else np.inf
    if turns.max() > 0.0:
        span = min(span, _TURNS * 2.0 * np.pi / float(turns.max()))
    span = span if np.isfinite(span) else 1.0
    forward = np.linspace(0.0, span, _POINTS)
    if "t" in names or np.all(values.real <= 0.0):
        return forward
    return -forward[::-1] if np.all(values.real > 0.0) else np.concatenate([-forward[:0:-1], forward])


def _around(near: NDArray[np.bool_], begun: int) -> slice:
    """Return the stretch about one point in which a condition holds."""
    after = np.flatnonzero(~near[begun:])
    before = np.flatnonzero(~near[: begun + 1])
    return slice(int(before[-1]) + 1 if before.size else 0, begun + int(after[0]) if after.size else len(near))
