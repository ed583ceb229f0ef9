"""Cells in the space of initial conditions: boxes of any number of free coordinates, and planes of any direction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import checked_texts
from saltus.errors import InputError, nearest
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Grid", "Plane", "tiles"]

_CHUNK = 2**16  # cells of a chunk, at most; a chunk is read for a single cell

_UNITS = 16  # units into which a grid is cut, at least, unless they fall below `_LEAST` cells

_LARGEST = 2**38  # cells in a file: 275 gigabytes of labels

_ROUNDING = 1e-9  # distance beyond the grid's edge, over a cell's width, that still belongs to the cell there

_MOST_CELLS = 2**31 - 1  # cells along a coordinate, at most

_LEAST = 40_000  # cells of a unit, at least: half a second of computing
_MOST = 2**19  # cells of a unit, at most: five seconds of computing


@dataclass(frozen=True)
class Plane:
    """A plane through state space, spanned by two vectors: its points are ``origin + a u + b v``.

    Distances measured on the plane are those of `a` and `b`; they are distances in state space where `u` and `v` are
    orthogonal and of length 1.

    Parameters
    ----------
    origin : mapping of str to float
        A point of the plane, each state named.
    u, v : mapping of str to float
        Two directions; states not named are 0.
    extents : ((float, float), (float, float))
        Least and greatest `a`, then `b`.
    counts : (int, int)
        Cells along `u` and along `v`.
    names : (str, str), optional
        Names of `a` and `b`.

    Examples
    --------
    A plane that holds the diagonal of (q, v):

    >>> plane = Plane({"q": 0.0, "v": 0.0, "s": 1.0}, {"q": 0.6, "v": 0.8}, {"s": 1.0}, ((-1, 1), (-2, 2)), (2, 4))
    >>> Grid(("q", "v", "s"), plane).points((slice(1, 2), slice(0, 2))).tolist()
    [[0.3, 0.4, -0.5], [0.3, 0.4, 0.5]]
    """

    origin: Mapping[str, float]
    u: Mapping[str, float]
    v: Mapping[str, float]
    extents: tuple[tuple[float, float], tuple[float, float]]
    counts: tuple[int, int]
    names: tuple[str, str] = ("a", "b")


class Grid:
    """Equal cells over a box of free coordinates, the other states frozen.

    Cell ``i`` of a range ``(low, high, count)`` has its centre at ``low + (i + 1/2) (high - low) / count``. The order
    in which the free coordinates are given is the order of the array's dimensions.

    Parameters
    ----------
    states : sequence of str
        The states, in the order in which a point has them.
    axes : mapping of str to (float, float, int) or float, or Plane
        For each state a free coordinate's range ``(low, high, count)``, or a frozen value.

    Attributes
    ----------
    states : tuple of str
        As given.
    names : tuple of str
        The free coordinates.
    ranges : tuple of (float, float, int)
        Their ranges.
    origin : ndarray, shape (n,)
        The point at which every free coordinate is 0.
    vectors : ndarray, shape (free, n)
        The direction of each free coordinate in the states.

    Raises
    ------
    InputError
        A coordinate that is unknown, or neither free nor frozen; or no free coordinate. A range turned round, or a
        count that is no positive integer.

    Examples
    --------
    >>> grid = Grid(("x", "v"), {"v": (-1, 1, 4), "x": 0.3})
    >>> grid.names, grid.shape, grid.axes[0].tolist()
    (('v',), (4,), [-0.75, -0.25, 0.25, 0.75])
    >>> grid.points().tolist()
    [[0.3, -0.75], [0.3, -0.25], [0.3, 0.25], [0.3, 0.75]]
    >>> Grid(("x", "v"), {"v": (1, -1, 4), "x": 0.3})
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: grid['v'] = (1, -1, 4): must be (low, high, count) with low < high; turn it round
    """

    def __init__(self, states: Sequence[str], axes: Mapping[str, Any] | Plane) -> None:
        names = checks.names("states", states, "names of states", least=1)
        if isinstance(axes, Plane):
            self._hold(names, *_read_plane(names, axes))
        elif isinstance(axes, Mapping):
            self._hold(names, *_read_box(names, axes))
        else:
            raise InputError("grid", axes, "a mapping of each state to a range or a value, or a Plane")

    def _hold(
        self,
        states: tuple[str, ...],
        names: Sequence[str],
        ranges: Sequence[tuple[float, float, int]],
        origin: NDArray[np.float64],
        vectors: NDArray[np.float64],
    ) -> None:
        self.states = states
        self.names = tuple(names)
        self.ranges = tuple((float(low), float(high), int(count)) for low, high, count in ranges)
        self.origin = frozen(origin)
        self.vectors = frozen(vectors)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each free coordinate."""
        return tuple(count for _, _, count in self.ranges)

    @property
    def size(self) -> int:
        """Count of all cells."""
        return math.prod(self.shape)

    @cached_property
    def axes(self) -> tuple[NDArray[np.float64], ...]:
        """Centres of the cells along each free coordinate."""
        return tuple(
            frozen(low + (np.arange(count) + 0.5) * ((high - low) / count)) for low, high, count in self.ranges
        )

    @property
    def spacing(self) -> tuple[float, ...]:
        """Size of a cell along each free coordinate."""
        return tuple((high - low) / count for low, high, count in self.ranges)

    @property
    def fixed(self) -> Mapping[str, float]:
        """States that are equal in all cells, and their values."""
        still = ~(self.vectors != 0.0).any(axis=0)
        return MappingProxyType({name: float(self.origin[j]) for j, name in enumerate(self.states) if still[j]})

    @property
    def box(self) -> Mapping[str, tuple[float, float]]:
        """Least and greatest value of each state in the grid; equal for a frozen state."""
        ends = np.array([self.origin, self.origin])
        for (low, high, _), vector in zip(self.ranges, self.vectors, strict=True):
            ends += np.sort([low * vector, high * vector], axis=0)
        return MappingProxyType({name: (float(a), float(b)) for name, (a, b) in zip(self.states, ends.T, strict=True)})

    def points(self, cells: Sequence[slice | NDArray[np.int64]] | slice | None = None) -> NDArray[np.float64]:
        """Return the centres of cells, shape (cells, n), the last coordinate running fastest.

        Parameters
        ----------
        cells : sequence of slice or of integer array, or slice, optional
            Cells along each free coordinate, or a range of all cells in their order; by default all.
        """
        if isinstance(cells, slice):
            indices = np.unravel_index(np.arange(*cells.indices(self.size)), self.shape)
            return self.at(np.stack(indices, axis=-1))
        chosen = [axis[part] for axis, part in zip(self.axes, cells or [slice(None)] * len(self.axes), strict=True)]
        points = np.empty((*(len(values) for values in chosen), len(self.states)))
        along = np.ix_(*chosen)
        for j, value in enumerate(self.origin):
            for k in np.flatnonzero(self.vectors[:, j]):
                value = value + along[k] * self.vectors[k, j]
            points[..., j] = value
        return points.reshape(-1, len(self.states))

    def at(self, indices: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres, shape (cells, n), of the cells of given indices, shape (cells, free)."""
        points = np.empty((len(indices), len(self.states)))
        points[...] = self.origin
        for k, axis in enumerate(self.axes):
            for j in np.flatnonzero(self.vectors[k]):
                points[:, j] += axis[indices[:, k]] * self.vectors[k, j]
        return points

    def nearest(self, values: Mapping[str, float]) -> dict[str, int]:
        """Return the index of the cell nearest to the value of each named coordinate.

        Raises
        ------
        InputError
            No free coordinate has the name, or the value lies outside its range.
        """
        found = {}
        for name, value in checks.mapping("coordinates", values, "free coordinates to values").items():
            if name not in self.names:
                wanted = f"a free coordinate: {', '.join(self.names)}"
                hint = f"it is frozen at {self.fixed[name]:g}" if name in self.fixed else nearest(name, self.names)
                raise InputError("coordinate", name, wanted, hint)
            number = checks.number(name, value)
            inside = self.clipped(name, number)
            low, high, count = self.ranges[self.names.index(name)]
            if inside is None:
                raise InputError(name, value, f"between {low:g} and {high:g}")
            found[name] = min(int((inside - low) / (high - low) * count), count - 1)
        return found

    def clipped(self, name: str, value: float) -> float | None:
        """Return a value of a free coordinate, moved to the grid's edge if beyond it by rounding; None outside.

        Examples
        --------
        >>> Grid(("x",), {"x": (0.0, 0.3, 3)}).clipped("x", 0.1 + 0.2)
        0.3
        """
        low, high, count = self.ranges[self.names.index(name)]
        inside = min(max(value, low), high)
        return inside if abs(value - inside) <= _ROUNDING * (high - low) / count else None

    def section(self, cells: Mapping[str, int]) -> Grid:
        """Return the grid of the cells with given indices along named coordinates.

        Raises
        ------
        InputError
            No free coordinate would be left.
        """
        kept = [k for k, name in enumerate(self.names) if name not in cells]
        if not kept:
            raise InputError("section", list(cells), f"fewer than all coordinates: {', '.join(self.names)}")
        origin = self.origin.copy()
        for k, name in enumerate(self.names):
            if name in cells:
                origin += self.axes[k][cells[name]] * self.vectors[k]
        return self._made(
            self.states, [self.names[k] for k in kept], [self.ranges[k] for k in kept], origin, self.vectors[kept]
        )

    @classmethod
    def _made(cls, *parts: Any) -> Grid:
        grid = cls.__new__(cls)
        grid._hold(*parts)
        return grid

    def definition(self) -> dict[str, Any]:
        """Return the grid as plain data, from which `from_definition` makes an equal one."""
        return {
            "states": list(self.states),
            "ranges": {name: list(part) for name, part in zip(self.names, self.ranges, strict=True)},
            "order": list(self.names),
            "origin": dict(zip(self.states, self.origin.tolist(), strict=True)),
            "vectors": {name: vector.tolist() for name, vector in zip(self.names, self.vectors, strict=True)},
        }

    @classmethod
    def from_definition(cls, definition: Mapping[str, Any]) -> Grid:
        """Return the grid that `definition` describes; raise `InputError` where it describes none."""
        names, states = _checked_definition(definition)
        return cls._made(
            states,
            names,
            [definition["ranges"][name] for name in names],
            np.array([definition["origin"][name] for name in states]),
            np.array([definition["vectors"][name] for name in names]).reshape(len(names), len(states)),
        )

    @cached_property
    def layout(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes of a chunk, the least part that is read, and of a unit, the least part that is computed and written.

        A unit is made of whole chunks. Both follow from the grid alone.
        """
        most = min(max(self.size // _UNITS, _LEAST), _MOST)
        halvings, per_unit = [0] * len(self.shape), [0] * len(self.shape)
        while math.prod(self._parts(halvings)) > min(most, _CHUNK):
            k = int(np.argmax(self._parts(halvings)))
            halvings[k] += 1
            unit = [n * 2 ** (a - b) for n, a, b in zip(self._parts(halvings), halvings, per_unit, strict=True)]
            if math.prod(unit) > most:
                per_unit[k] += 1
        chunk = self._parts(halvings)
        return chunk, tuple(n * 2 ** (a - b) for n, a, b in zip(chunk, halvings, per_unit, strict=True))

    def _parts(self, halvings: Sequence[int]) -> tuple[int, ...]:
        return tuple(-(-count // 2**h) for count, h in zip(self.shape, halvings, strict=True))

    def units(self) -> Iterator[tuple[slice, ...]]:
        """Go through the units of work, see `layout`: the slices of each."""
        return tiles(self.shape, self.layout[1])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and self.definition() == other.definition()

    def __hash__(self) -> int:
        return hash((self.states, self.names, self.ranges))

    def __reduce__(self) -> tuple[Any, ...]:
        return Grid.from_definition, (self.definition(),)

    def __repr__(self) -> str:
        free = [f"{name} from {a:g} to {b:g}" for name, (a, b, _) in zip(self.names, self.ranges, strict=True)]
        fixed = [f"{name} = {value:g}" for name, value in self.fixed.items()]
        return (
            f"Grid({' x '.join(map(str, self.shape))} cells: {', '.join(free)}" + "".join(f"; {x}" for x in fixed) + ")"
        )


def _checked_definition(definition: Any) -> tuple[list[str], tuple[str, ...]]:
    """Return the names of coordinates and states in a checked result of `Grid.definition`."""
    if not isinstance(definition, Mapping):
        raise InputError("grid", definition, "a mapping")
    names, states = (checked_texts(definition.get(key), f"the grid's {key}") for key in ("order", "states"))
    for key, texts in (("order", names), ("states", states)):
        if not texts or len(set(texts)) < len(texts):
            raise InputError(f"the grid's {key}", texts, "names, each once, at least one")
    for key, wanted in (("ranges", names), ("vectors", names), ("origin", states)):
        part = definition.get(key)
        if not isinstance(part, Mapping) or set(part) != set(wanted):
            raise InputError(f"the grid's {key}", part, f"a mapping of {', '.join(wanted)}")
        for name in wanted:
            where = f"the grid's {key}[{name!r}]"
            if key == "origin":
                checks.number(where, part[name])
            elif not isinstance(part[name], list | tuple):
                raise InputError(where, part[name], "a list")
            elif key == "ranges":
                _range(part[name], where)
            elif len([checks.number(where, entry) for entry in part[name]]) != len(states):
                raise InputError(where, part[name], f"a number for each of {', '.join(states)}")
    if (size := math.prod(definition["ranges"][name][2] for name in names)) > _LARGEST:
        raise InputError("the grid's cells", size, f"at most {_LARGEST}")
    return names, tuple(states)


def tiles(shape: Sequence[int], tile: Sequence[int]) -> Iterator[tuple[slice, ...]]:
    """Go through the tiles of an array, those at its ends cut off: the slices of each.

    Examples
    --------
    >>> [(cells[0].start, cells[0].stop) for cells in tiles((5,), (2,))]
    [(0, 2), (2, 4), (4, 5)]
    """
    ends = list(zip(shape, tile, strict=True))
    for place in product(*(range(-(-n // t)) for n, t in ends)):
        yield tuple(slice(i * t, min((i + 1) * t, n)) for i, (n, t) in zip(place, ends, strict=True))


def _read_box(states: tuple[str, ...], axes: Mapping[str, Any]) -> tuple[Any, ...]:
    checks.mapping("grid", axes, "states to ranges and values", known=states)
    if missing := [name for name in states if name not in axes]:
        example = f"{missing[0]!r}: 0.0 or {missing[0]!r}: (-1, 1, 100)"
        raise InputError("grid", list(axes), f"a range or a value for each of {', '.join(states)}", f"add {example}")
    names, ranges, origin = [], [], np.zeros(len(states))
    for name, value in axes.items():
        where = f"grid[{name!r}]"
        if isinstance(value, tuple | list):
            names.append(name)
            ranges.append(_range(value, where))
        else:
            origin[states.index(name)] = checks.number(where, value, "a number, or a range (low, high, count)")
    if not names:
        raise InputError("grid", dict(axes), "with a free coordinate", "give one a range (low, high, count)")
    vectors = np.array([[float(state == name) for state in states] for name in names])
    return names, ranges, origin, vectors


def _read_plane(states: tuple[str, ...], plane: Plane) -> tuple[Any, ...]:
    for part in ("origin", "u", "v"):
        if not isinstance(given := getattr(plane, part), Mapping):
            raise InputError(f"plane's {part}", given, "a mapping of states to numbers")
        checks.mapping(f"plane's {part}", given, "states to numbers", known=states)
    if missing := [name for name in states if name not in plane.origin]:
        raise InputError(
            "plane's origin", dict(plane.origin), f"a value for each of {', '.join(states)}", f"add {missing[0]!r}"
        )
    origin, *vectors = (
        np.array([checks.number(f"plane's {part}[{name!r}]", given.get(name, 0.0)) for name in states])
        for part, given in (("origin", plane.origin), ("u", plane.u), ("v", plane.v))
    )
    if np.linalg.matrix_rank(np.array(vectors)) < 2:
        raise InputError("plane's u, v", (dict(plane.u), dict(plane.v)), "two vectors that span a plane")
    named = _is_pair(plane.names) and all(isinstance(name, str) for name in plane.names)
    if not named or len({*plane.names, *states}) < 2 + len(states):
        raise InputError("plane's names", plane.names, "two names that no state has")
    if not _is_pair(plane.extents) or not all(map(_is_pair, plane.extents)):
        raise InputError("plane's extents", plane.extents, "two pairs (low, high)")
    if not _is_pair(plane.counts):
        raise InputError("plane's counts", plane.counts, "two counts of cells")
    ranges = [
        _range((*extent, count), f"plane's {name!r}")
        for name, extent, count in zip(plane.names, plane.extents, plane.counts, strict=True)
    ]
    return plane.names, ranges, origin, np.array(vectors)


def _is_pair(value: object) -> bool:
    return isinstance(value, tuple | list) and len(value) == 2


def _range(value: Sequence[Any], where: str) -> tuple[float, float, int]:
    if len(value) != 3:
        raise InputError(where, tuple(value), "(low, high, count)")
    low, high = (checks.number(where, end) for end in value[:2])
    try:
        count = checks.count(where, value[2])
    except InputError:
        raise InputError(where, tuple(value), "(low, high, count) with count an integer >= 1") from None
    if count > _MOST_CELLS:
        raise InputError(where, tuple(value), f"(low, high, count) with count at most {_MOST_CELLS}")
    if not low < high:
        raise InputError(
            where, tuple(value), "(low, high, count) with low < high", "turn it round" if high < low else ""
        )
    return low, high, count
