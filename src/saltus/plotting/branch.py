"""Picture of a branch: solid where stable, dashed where not, special points as dots."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.branch import Branch, SpecialPoint
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["Piece", "pieces_of", "plot_branch"]

_SPLITS = ("SN", "PD", "TR", "BP")
"""Special points at which stability may change."""

_NEAREST = 1e-9
"""Points nearer than this to a special point, in the picture's width, are the point itself."""

_VERTICES = 4000


@dataclass(frozen=True)
class Piece:
    """A stretch of a branch of one kind, both ends included.

    Attributes
    ----------
    kind : str
        ``stable``, ``unstable`` or ``not admissible``.
    x, y : ndarray, shape (vertex,)
        The curve: all points of the branch on it, and interpolated ones between them.
    """

    kind: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


@plot.register(Branch)
def plot_branch(
    branch: Branch,
    x: str | None = None,
    y: str | None = None,
    *,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw a branch and return the matplotlib Axes.

    Stable orbits are solid, unstable ones dashed, those that are no motion of the system dotted in grey. The curve passes
    through every point and every special point; between them it is interpolated in arclength, without overshoot.

    Parameters
    ----------
    branch : Branch
        What is drawn.
    x, y : str, optional
        Quantities that `Branch.column` knows; by default the parameter, and ``min_`` of the first output or ``max_`` of
        the first state.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether line kinds and special points are named.

    Raises
    ------
    InputError
        A quantity of another name.
    """
    x = branch.parameter if x is None else x
    if y is None:
        outputs = branch.system.output_names
        y = f"min_{outputs[0]}" if outputs else f"max_{branch.system.states[0]}"
    pieces = pieces_of(branch, x, y)
    ax = style.axes(ax)
    named: set[str] = set()
    for piece in pieces:
        label = "_" if piece.kind in named else piece.kind
        ax.plot(piece.x, piece.y, label=label, **style.LINES[piece.kind])
        named.add(piece.kind)
    if special:
        _draw_special(ax, branch, x, y)
    ax.set_xlabel(style.label_of(x))
    ax.set_ylabel(style.label_of(y))
    if legend and (pieces or len(branch.special_points)):
        ax.legend()
    return ax


def _draw_special(ax: Axes, branch: Branch, x: str, y: str) -> None:
    for kind in dict.fromkeys(point.type for point in branch.special_points):
        marker = style.SPECIAL.get(kind, replace(style.EVENT, meaning=""))
        points = [point for point in branch.special_points if point.type == kind]
        ax.plot(
            [branch.at(point, x) for point in points],
            [branch.at(point, y) for point in points],
            label=f"{kind}, {marker.meaning}" if marker.meaning else kind,
            zorder=5 if kind in ("SN", "GR") else 6,
            **marker.options(),
        )


def pieces_of(branch: Branch, x: str, y: str) -> list[Piece]:
    """Return a branch as curves, each of one kind; where one ends the next begins."""
    nodes = _nodes(branch, x, y)
    if len(nodes.x) < 2:
        return []
    each = int(np.clip(_VERTICES // len(nodes.x), 4, 24))
    curves = []
    corners = [0, *np.flatnonzero(nodes.corner[1:-1]) + 1, len(nodes.x) - 1]
    for first, last in zip(corners, corners[1:], strict=False):
        part = slice(first, last + 1)
        curves.append(_smooth(nodes.s[part], nodes.x[part], nodes.y[part], each))
    x_all = np.concatenate([curves[0][0][:1], *(cx[1:] for cx, _ in curves)])
    y_all = np.concatenate([curves[0][1][:1], *(cy[1:] for _, cy in curves)])
    pieces = []
    begins = [i for i, kind in enumerate(nodes.kind) if i == 0 or kind != nodes.kind[i - 1]]
    for first, last in zip(begins, [*begins[1:], len(nodes.kind)], strict=True):
        part = slice(first * each, last * each + 1)
        pieces.append(Piece(nodes.kind[first], x_all[part], y_all[part]))
    return pieces


@dataclass(frozen=True)
class _Nodes:
    """Points and special points in order: arclength, place, whether the curve may have a corner, kind of each interval."""

    s: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    corner: NDArray[np.bool_]
    kind: list[str]


def _nodes(branch: Branch, x: str, y: str) -> _Nodes:
    columns = np.array([branch.column(x), branch.column(y)])
    specials = list(branch.special_points)
    if not len(branch):
        return _Nodes(np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool), [])
    rows = _rows(branch, specials)
    coordinates = _coordinates(branch)
    inside = {
        gap: [point for point in specials if rows[gap] < point.position < rows[gap + 1]]
        for gap in range(len(rows) - 1)
    }
    s, place, corner, kind = [0.0], [columns[:, rows[0]]], [False], []
    for gap, (row, after) in enumerate(zip(rows, rows[1:], strict=False)):
        between = inside[gap]
        kind += _kinds(branch, row, after, between)
        steps = _shares(coordinates, branch, row, after, between)
        begin, length = s[-1], max(float(branch.arclength[after] - branch.arclength[row]), 1e-300)
        for point, share in zip(between, steps, strict=True):
            s.append(begin + share * length)
            place.append(np.array([branch.at(point, x), branch.at(point, y)]))
            corner.append(point.type == "GR")
        s.append(begin + length)
        place.append(columns[:, after])
        corner.append(False)
        if branch.form[row] != branch.form[after] and not any(point.type == "GR" for point in between):
            corner[-1] = True
    table = np.array(place)
    return _Nodes(np.array(s), table[:, 0], table[:, 1], np.array(corner), kind)


def _rows(branch: Branch, specials: list[SpecialPoint]) -> list[int]:
    """Return the points of the branch that are drawn: all but those that are a grazing point once more."""
    again = set()
    for point in specials:
        if point.type != "GR":
            continue
        for row in (int(np.floor(point.position)), int(np.ceil(point.position))):
            if 0 <= row < len(branch):
                value = point.parameters[branch.parameter]
                width = float(np.ptp(branch.values)) or 1.0
                near = np.allclose(branch.x0[row], point.orbit.x0, rtol=_NEAREST, atol=_NEAREST)
                if near and abs(branch.values[row] - value) < _NEAREST * width and 0 < row < len(branch) - 1:
                    again.add(row)
    return [row for row in range(len(branch)) if row not in again]


def _coordinates(branch: Branch) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what distances along the branch are measured in, shape (point, coordinate), and the units of it."""
    table = np.column_stack([branch.values, branch.x0, branch.lows, branch.highs])
    units = np.ptp(table, axis=0)
    units[units == 0.0] = 1.0
    return table / units, units


def _shares(
    coordinates: tuple[NDArray[np.float64], NDArray[np.float64]],
    branch: Branch,
    row: int,
    after: int,
    between: list[SpecialPoint],
) -> list[float]:
    """Return where special points lie between two points, as shares of the arclength: those of the chords."""
    table, units = coordinates
    places = [table[row]]
    for point in between:
        value = point.parameters[branch.parameter]
        places.append(np.concatenate([[value], point.orbit.x0, point.orbit.lows, point.orbit.highs]) / units)
    places.append(table[after])
    chords = np.linalg.norm(np.diff(places, axis=0), axis=1) + 1e-15
    return (np.cumsum(chords)[:-1] / chords.sum()).tolist()


def _kinds(branch: Branch, row: int, after: int, between: list[SpecialPoint]) -> list[str]:
    """Return the kind of each interval from a point to the next, over the special points between them."""
    first, last = _kind(branch, row), _kind(branch, after)
    if not between:
        if first == last:
            return [first]
        return ["not admissible" if "not admissible" in (first, last) else "unstable"]
    kinds = [first, *[""] * (len(between) - 1), last]
    grazings = [i for i, point in enumerate(between) if point.type == "GR"]
    ahead = grazings[0] if grazings else len(between)
    for i in range(1, min(ahead + 1, len(between))):
        kinds[i] = _beyond(kinds[i - 1], between[i - 1])
    for i in range(len(between) - 1, ahead, -1):
        kinds[i] = _beyond(kinds[i + 1], between[i])
    return kinds


def _kind(branch: Branch, row: int) -> str:
    if not branch.admissible[row]:
        return "not admissible"
    return "stable" if branch.stable[row] else "unstable"


def _beyond(kind: str, point: SpecialPoint) -> str:
    """Return the kind on the other side of a special point: stability changes if no other multiplier is unstable."""
    if kind == "not admissible" or point.type not in _SPLITS:
        return kind
    if kind == "stable":
        return "unstable"
    unstable = int(np.sum(np.abs(point.orbit.multipliers) > 1.0 + 1e-6))
    return "unstable" if unstable else "stable"


def _smooth(
    s: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], each: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a curve through all nodes, `each` vertices an interval, that stays between neighbouring nodes in x and y."""
    t = np.arange(each) / each
    inner = (s[:-1, None] + np.diff(s)[:, None] * t).ravel()
    at = np.append(inner, s[-1])
    return _hermite(s, x, at, each), _hermite(s, y, at, each)


def _hermite(s: NDArray[np.float64], f: NDArray[np.float64], at: NDArray[np.float64], each: int) -> NDArray[np.float64]:
    """Return the monotone cubic Hermite interpolant of f(s).

    Slopes are those of parabolas through three nodes, limited so that the cubic has its extremes at nodes.

    References
    ----------
    F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238-246: |slope| <= 3 |secant| suffices.
    """
    h, secant = np.diff(s), np.diff(f) / np.diff(s)
    slope = np.empty_like(f)
    if len(f) == 2:
        slope[:] = secant[0]
    else:
        slope[1:-1] = (h[1:] * secant[:-1] + h[:-1] * secant[1:]) / (h[:-1] + h[1:])
        slope[0] = ((2.0 * h[0] + h[1]) * secant[0] - h[0] * secant[1]) / (h[0] + h[1])
        slope[-1] = ((2.0 * h[-1] + h[-2]) * secant[-1] - h[-1] * secant[-2]) / (h[-1] + h[-2])
    before, after = np.append(secant[:1], secant), np.append(secant, secant[-1:])
    most = 3.0 * np.minimum(np.abs(before), np.abs(after))
    turns = (before * after <= 0.0) | (slope * before <= 0.0)
    slope = np.where(turns, 0.0, np.sign(slope) * np.minimum(np.abs(slope), most))
    k = np.minimum(np.arange(len(at)) // each, len(h) - 1)
    t = (at - s[k]) / h[k]
    t[::each] = np.append(np.zeros(len(h)), 1.0)
    low, high = f[k], f[k + 1]
    value = (
        low
        + t**2 * (3.0 - 2.0 * t) * (high - low)
        + t * (1.0 - t) * h[k] * ((1.0 - t) * slope[k] - t * slope[k + 1])
    )
    value[::each] = f
    return np.clip(value, np.minimum(low, high), np.maximum(low, high))
