"""Motions and orbits of maps as curves and points: series, planes, and the cobweb of a map of one state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.maps import Iterates, MapOrbit
    from saltus.system import Map

__all__ = ["COUNT", "NEXT", "Path", "names_of", "visited"]

NEXT = "next "  # before the name of a state: its next value
COUNT = "n"  # the count of iterations
_FEW = 400  # points up to which a thin line joins those of a series, and a cobweb shows its way
_GRAPH = 400  # places at which the graph of a map of one state is drawn
_ROOM = 0.25  # part of the states' range that a graph shows beyond them


@dataclass(frozen=True)
class Path:
    """A motion as curves in some quantities."""

    # shape (vertex, name): the curve, cut at events and where an angle passes 2 pi
    curves: list[NDArray[np.float64]] = field(default_factory=list)
    modes: list[int] = field(default_factory=list)  # the mode of each curve
    # shape (event, name): where events are; of what does not flow, as an equilibrium, where it is
    events: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    points: bool = False  # whether `events` are all points of a motion that has no curves of its own
    # shape (vertex, name): thin curves beside the motion, as the way of a cobweb
    aids: list[NDArray[np.float64]] = field(default_factory=list)


def names_of(system: Map) -> list[str]:
    """Return names of quantities that are shown of a map's motions.

    Examples
    --------
    >>> from saltus import Map
    >>> names_of(Map(("x",), {}, {"x": "x/2"}))
    ['n', 'x', 'next x']
    """
    return [COUNT, *system.states, *(NEXT + name for name in system.states), *system.output_names]


def visited(motion: Iterates | MapOrbit, names: Sequence[str], *, closed: bool) -> Path:
    """Return the points of a motion in some quantities.

    Parameters
    ----------
    motion : Iterates or MapOrbit
        The motion.
    names : sequence of str
        ``n``, states, their next values as ``"next x"``, outputs or expressions.
    closed : bool
        Whether the last point's image is the first one.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.

    Examples
    --------
    >>> from saltus import Map, iterate
    >>> halved = iterate(Map(("x",), {}, {"x": "x/2"}), x0=[1.0], n=2)
    >>> visited(halved, ("x", "next x"), closed=False).events.tolist()
    [[1.0, 0.5], [0.5, 0.25]]
    """
    table = np.column_stack([_column(motion, name, closed=closed) for name in names])
    if any(name.startswith(NEXT) for name in names) and not closed:
        table = table[:-1]
    state = motion.system.states[0]
    if tuple(names) == (state, NEXT + state) and len(motion.system.states) == 1:
        graph, pieces = _graph(motion, table.ravel())
        aids = [*_cobweb(table, np.vstack(graph), closed=closed)]
        return Path(graph, pieces, table, points=True, aids=aids)
    joined = [table] if COUNT in names and 1 < len(table) <= _FEW else []
    return Path(events=table, points=True, aids=joined)


def _column(motion: Any, name: str, *, closed: bool) -> NDArray[np.float64]:
    if name == COUNT:
        first = getattr(motion, "first", 0)
        return np.arange(float(first), first + len(motion.output(motion.system.states[0])))
    shifted = name.startswith(NEXT)
    values = np.asarray(motion.output(name.removeprefix(NEXT)), dtype=np.float64)
    return np.roll(values, -1) if shifted else values


def _graph(motion: Any, visited: NDArray[np.float64]) -> tuple[list[NDArray[np.float64]], list[int]]:
    """Return the graph of a map of one state about the places that a motion visits, a curve for each piece."""
    system, p = motion.system, motion.system.parameter_vector(motion.parameters)
    low, high = float(visited.min()), float(visited.max())
    room = _ROOM * ((high - low) or abs(high) or 1.0)
    places = np.linspace(low - room, high + room, _GRAPH)
    pieces = np.array([system.piece_index(np.array([x]), p) for x in places])
    images = np.array([system.compiled.field(int(k), np.array([x]), p)[0] for k, x in zip(pieces, places, strict=True)])
    cuts = np.flatnonzero(np.diff(pieces)) + 1
    curves = np.split(np.column_stack([places, images]), cuts)
    return curves, [int(part[0]) for part in np.split(pieces, cuts)]


def _cobweb(table: NDArray[np.float64], graph: NDArray[np.float64], *, closed: bool) -> Iterator[NDArray[np.float64]]:
    """Go through the diagonal and the way between it and the graph."""
    ends = graph[[0, -1], 0]
    yield np.column_stack([ends, ends])
    if len(table) <= _FEW:
        x, image = table.T
        way = np.column_stack([np.repeat(x, 2), np.column_stack([x, image]).ravel()])
        yield np.vstack([way, way[:1]]) if closed else way
