"""Pictures of branches: solid where stable, dashed where unstable, with special points as markers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.parameters import OneParameter
from saltus.continuation.results.special_points import SpecialPoint
from saltus.plotting import plot, style
from saltus.plotting.ordinates import extremes_first, ordinate_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = [
    "Piece",
    "draw_branch",
    "draw_pieces",
    "draw_special",
    "pieces_of",
    "plot_any_branch",
    "plot_branch",
]

_SPLITS = ("SN", "PD", "TR", "BP", "HB")  # special points at which stability may change
_MEETINGS = (*CHANGES, "BE")  # special points at which the equations change
_GAP = "gap"  # the kind of an interval without length that is not drawn: a state leaps there
_NEAREST = 1e-9  # relative distance up to which a point of the branch is the grazing point next to it
_VERTICES = 4000  # vertices of a branch, about


@dataclass(frozen=True)
class Piece:
    """A stretch of a branch of one kind, both ends included.

    Attributes
    ----------
    kind : str
        ``stable``, ``unstable``, ``not admissible`` (orbits) or ``virtual`` (of other kinds).
    x, y : ndarray, shape (vertex,)
        Vertices of the curve: points of the branch, and interpolated ones between them.
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
    colour: str | None = None,
) -> Axes:
    """Draw a branch and return the matplotlib Axes.

    Stable orbits are solid, unstable ones dashed, those that are no motion of the system dotted in grey. The curve
    passes through every point and every special point. Between them it is interpolated in arclength without overshoot.
    docs/theory/plotting.md describes the interpolation.

    Parameters
    ----------
    branch : Branch
        The branch.
    x, y : str, optional
        Quantities that `Branch.column` knows, also observables, as ``"amplitude(z, 1)"``. By default the parameter, and
        ``min_`` of the first output or ``max_`` of the first state. Where that varies by no more than its error, as
        the greatest value at a wall, the first that does is drawn: the other extreme, the amplitude, the mean, the
        period, extremes of the others. Axes that show one of these keep it. Along a quantity by default the freed
        parameter or the period, and the quantity.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend names line kinds and special points.
    colour : str, optional
        Colour of the curve where it is a motion of the system, as matplotlib takes it; by default black.

    Raises
    ------
    InputError
        A quantity of another name, or no colour.
    """
    style.check_options(ax, x, y, special=special, legend=legend)
    if branch.fixed is not None:
        x, y = x or branch.fixed.free or "period", y or branch.parameter
    x = branch.parameter if x is None else x
    y = ordinate_of([branch], extremes_first(branch.system), ax) if y is None else y
    return draw_branch([branch], x, y, ax, special=special, legend=legend, colour=colour)


@plot.register(OneParameter)
def plot_any_branch(
    branch: OneParameter[Any],
    x: str | None = None,
    y: str | None = None,
    *,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
    colour: str | None = None,
) -> Axes:
    """Draw a branch of equilibria, or of any other kind of solution, and return the matplotlib Axes.

    Stable solutions are solid, unstable ones dashed, virtual ones dotted in grey. The curve is interpolated between
    its points as that of a `Branch`.

    Parameters
    ----------
    branch : EquilibriumBranch or another
        The branch.
    x, y : str, optional
        Quantities that its `column` knows. By default the parameter, and the first output or state that varies.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend names line kinds and special points.
    colour : str, optional
        Colour of the curve where it is a motion of the system, as matplotlib takes it; by default black.

    Raises
    ------
    InputError
        A quantity of another name, or no colour.
    """
    style.check_options(ax, x, y, special=special, legend=legend)
    x = branch.parameter if x is None else x
    y = ordinate_of([branch], [*branch.system.output_names, *branch.system.states], ax) if y is None else y
    return draw_branch([branch], x, y, ax, special=special, legend=legend, colour=colour)


def draw_branch(
    branches: Sequence[OneParameter[Any]], x: str, y: str, ax: Axes | None, *, special: bool, legend: bool,
    colour: str | None = None,
) -> Axes:  # fmt: skip
    """Draw a branch; the options are those of `plot_branch`, checked. One of cycles is given once for each point."""
    pieces = [piece for branch in branches for piece in pieces_of(branch, x, y)]
    ax = style.axes(ax)
    draw_pieces(ax, pieces, colour)
    if special:
        for branch in branches:
            draw_special(ax, branch, x, y)
    ax.set_xlabel(style.label_of(x))
    ax.set_ylabel(style.label_of(y))
    if legend and (pieces or any(len(branch.special_points) for branch in branches)):
        style.draw_legend(ax)
    return ax


def draw_pieces(ax: Axes, pieces: Iterable[Piece], colour: str | None = None) -> None:
    """Draw pieces in the line styles of their kinds; each kind has one label for the legend."""
    named: set[str] = set()
    for piece in sorted(pieces, key=lambda piece: [*style.LINES].index(piece.kind)):
        label = "_" if piece.kind in named else piece.kind
        ax.plot(piece.x, piece.y, label=label, **style.line_of(piece.kind, colour))
        named.add(piece.kind)


def draw_special(
    ax: Axes,
    branch: OneParameter[Any],
    x: str,
    y: str,
    drawn: Iterable[SpecialPoint[Any]] | None = None,
    words: Mapping[str, str] | None = None,
) -> None:
    """Draw special points of a branch, by default all, with a label for each type; words: labels of one's own."""
    chosen = [*(branch.special_points if drawn is None else drawn)]
    for kind in dict.fromkeys(point.type for point in chosen):
        marker = style.on_branches(kind)
        points = [point for point in chosen if point.type == kind]
        ax.plot(
            [_at(branch, point, x) for point in points],
            [_at(branch, point, y) for point in points],
            label=(words or {}).get(kind) or (f"{kind}, {marker.meaning}" if marker.meaning else style.plain(kind)),
            zorder=5 if kind in ("SN", *_MEETINGS) else 6,
            **marker.options(),
        )


def _at(branch: OneParameter[Any], point: Any, name: str) -> float:
    return branch.value_at(point, name)


def pieces_of(branch: OneParameter[Any], x: str, y: str, phase: float = 0.0) -> list[Piece]:
    """Return a branch as connected curves, each of one kind; phase: that at which its states are drawn."""
    nodes = _nodes(branch, x, y, phase)
    if len(nodes.x) < 2:
        return []
    each = int(np.clip(_VERTICES // len(nodes.x), 4, 24))
    curves = []
    corners = [0, *np.flatnonzero(nodes.corner[1:-1]) + 1, len(nodes.x) - 1]
    for first, last in pairwise(corners):
        part = slice(first, last + 1)
        curves.append(_smooth(nodes.s[part], nodes.x[part], nodes.y[part], each))
    x_all = np.concatenate([curves[0][0][:1], *(cx[1:] for cx, _ in curves)])
    y_all = np.concatenate([curves[0][1][:1], *(cy[1:] for _, cy in curves)])
    pieces: list[Piece] = []
    begins = [i for i, kind in enumerate(nodes.kind) if i == 0 or kind != nodes.kind[i - 1]]
    for first, last in zip(begins, [*begins[1:], len(nodes.kind)], strict=True):
        part = slice(first * each, last * each + 1)
        if nodes.kind[first] != _GAP:
            pieces.append(Piece(nodes.kind[first], x_all[part], y_all[part]))
    return pieces


@dataclass(frozen=True)
class _Nodes:
    """Nodes of a branch's curve: arclength, coordinates, whether the curve may have a corner, kinds of intervals."""

    s: NDArray[np.float64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    corner: NDArray[np.bool_]
    kind: list[str]


def _nodes(branch: OneParameter[Any], x: str, y: str, phase: float) -> _Nodes:
    columns = np.array([branch.column(x), branch.column(y)])
    specials: list[SpecialPoint[Any]] = [*branch.special_points]
    if not len(branch):
        return _Nodes(np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool), [])
    twins = _twins(branch, specials)
    rows = [row for row in range(len(branch)) if row not in twins.values()]
    s, place, corner, kind = [float(branch.arclength[rows[0]])], [columns[:, rows[0]]], [False], []
    leaps, is_state = _leaps(branch, x, y, phase), np.array([name in branch.system.states for name in (x, y)])
    for row, after in pairwise(rows):
        if (leap := leaps[row:after])[np.isfinite(leap)].size:
            share = float(leap[np.isfinite(leap)][0])
            ends, at = columns[:, [row, after]], float(branch.arclength[[row, after]] @ (1.0 - share, share))
            between = ends @ (1.0 - share, share)
            sides = [np.where(is_state, ends[:, side], between) for side in (0, 1)]
            kind += [
                *_kinds(branch, row, row, []),
                _GAP,
                *_kinds(branch, after, after, []),
            ]
            s += [at, at, float(branch.arclength[after])]
            place += [*sides, ends[:, 1]]
            corner += [True, True, False]
            continue
        points = [point for point in specials if row < point.position < after]
        met = [point.type in _MEETINGS for point in points]
        kind += _kinds(branch, row, after, points)
        s += [*(point.arclength for point in points), float(branch.arclength[after])]
        place += [np.array([_at(branch, point, x), _at(branch, point, y)]) for point in points]
        place.append(columns[:, after])
        corner += met
        corner.append(bool(branch.equations[row] != branch.equations[after]) and not any(met))
    table = np.array(place)
    return _Nodes(_growing(np.array(s)), table[:, 0], table[:, 1], np.array(corner), kind)


@singledispatch
def _leaps(branch: OneParameter[Any], x: str, y: str, phase: float) -> NDArray[np.float64]:
    """Return for each interval where in it a state that is drawn leaps, since its reset passes the phase; else NaN."""
    return np.full(max(len(branch) - 1, 0), np.nan)


@_leaps.register(Branch)
def _(branch: Branch, x: str, y: str, phase: float) -> NDArray[np.float64]:
    leaps = np.full(max(len(branch) - 1, 0), np.nan)
    if branch.system.phase is None:
        return leaps
    resets = [bool({x, y} & set(transition.reset)) for transition in branch.system.transitions]
    wide, ahead = len(branch.system.all_states) + 1, np.full(len(branch), np.nan)
    for i, (u, at) in enumerate(zip(branch.unknowns, branch.form.tolist(), strict=True)):
        form = branch.forms[at]
        half, starts = 0.5 * branch.system.turn * max(form.turns, 1), u[wide - 2 :: wide]
        before = np.roll(form.transitions, 1)  # the transition with which each segment starts
        first = branch.system.turn * np.ceil(starts[0] / branch.system.turn - 1e-13)  # the phase 0 at which `x0` is
        away = (starts[[k >= 0 and resets[k] for k in before]] - first - phase + half) % (2.0 * half) - half
        if away.size:
            ahead[i] = away[np.argmin(np.abs(away))]
    passed = (ahead[1:] * ahead[:-1] < 0.0) & (np.abs(ahead[1:] - ahead[:-1]) < 0.25 * branch.system.turn)
    leaps[passed] = ahead[:-1][passed] / (ahead[:-1] - ahead[1:])[passed]
    return leaps


def _growing(s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `s`, its steps enlarged where needed to make it strictly increasing."""
    least = 1e-14 * max(float(np.ptp(s)), 1e-300) if len(s) > 1 else 0.0
    return np.append(s[:1], s[0] + np.cumsum(np.maximum(np.diff(s), least)))


def _twins(branch: OneParameter[Any], specials: list[SpecialPoint[Any]]) -> dict[int, int]:
    """Return, by index, the points at which equations change that are also points of the branch, in the others."""
    twins: dict[int, int] = {}
    width = float(np.ptp(branch.values)) or 1.0
    for i, point in enumerate(specials):
        for row in (int(np.floor(point.position)), int(np.ceil(point.position))):
            if point.type in _MEETINGS and 0 < row < len(branch) - 1:
                apart = abs(branch.values[row] - point.value(branch.parameter))
                near = np.allclose(branch.x0[row], point.solution.x0, rtol=_NEAREST, atol=_NEAREST)
                if near and apart < _NEAREST * width:
                    twins[i] = row
    return twins


def _kinds(branch: OneParameter[Any], row: int, after: int, between: list[SpecialPoint[Any]]) -> list[str]:
    """Return the kinds of the intervals between two points, divided by the special points between them."""
    told = ["stable" if branch.stable[i] else "unstable" for i in (row, after)]
    first, last = (kind if branch.sound[i] else branch.fault for kind, i in zip(told, (row, after), strict=True))
    if not between:
        if first == last:
            return [first]
        return [branch.fault if branch.fault in (first, last) else "unstable"]
    kinds = [first, *[""] * (len(between) - 1), last]
    meetings = [i for i, point in enumerate(between) if point.type in _MEETINGS]
    ahead = meetings[0] if meetings else len(between)
    for i in range(1, min(ahead + 1, len(between))):
        kinds[i] = _beyond(kinds[i - 1], between[i - 1])
    for i in range(len(between) - 1, ahead, -1):
        kinds[i] = _beyond(kinds[i + 1], between[i])
    return kinds


def _beyond(kind: str, point: SpecialPoint[Any]) -> str:
    """Return the kind beyond a special point: stability changes if no other multiplier or eigenvalue is unstable."""
    if kind in style.FAULTY or point.type not in _SPLITS:
        return kind
    if kind == "stable":
        return "unstable"
    return "unstable" if point.solution.unstable else "stable"


def _smooth(
    s: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], each: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a cubic Hermite curve through all nodes, with `each` vertices an interval.

    The curve is monotone between neighbouring nodes, in x and in y. Both may turn at one node, as at a fold next to an
    extreme of y. The coordinate with the larger relative slope then keeps it, to avoid a cusp.

    References
    ----------
    F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238-246: |slope| <= 3 |secant| suffices.
    """
    slopes, turns, limits = [], [], []
    for f in (x, y):
        secant = np.diff(f) / np.diff(s)
        before, after = np.append(secant[:1], secant), np.append(secant, secant[-1:])
        raw = _parabolic_slopes(np.diff(s), secant)
        slopes.append(raw)
        turns.append((before * after <= 0.0) | (raw * before <= 0.0))
        limits.append(np.minimum(np.abs(before), np.abs(after)))
    rates = [np.abs(raw) / (np.ptp(f) or 1.0) for raw, f in zip(slopes, (x, y), strict=True)]
    cusp = turns[0] & turns[1]
    kept = [cusp & (rates[0] >= rates[1]), cusp & (rates[0] < rates[1])]
    t = np.arange(each) / each
    curves = []
    for f, raw, turn, limit, keep in zip((x, y), slopes, turns, limits, kept, strict=True):
        most = np.where(keep, limit, np.where(turn, 0.0, 3.0 * limit))
        slope = np.sign(raw) * np.minimum(np.abs(raw), most)
        low, high, h = f[:-1, None], f[1:, None], np.diff(s)[:, None]
        bulge = (1.0 - t) * slope[:-1, None] - t * slope[1:, None]
        curve = low + t**2 * (3.0 - 2.0 * t) * (high - low) + t * (1.0 - t) * h * bulge
        free = (keep[:-1] | keep[1:])[:, None]
        curve = np.where(free, curve, np.clip(curve, np.minimum(low, high), np.maximum(low, high)))
        curves.append(np.append(curve.ravel(), f[-1]))
    return curves[0], curves[1]


def _parabolic_slopes(h: NDArray[np.float64], secant: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return slopes at nodes by parabolas through three nodes; `h` are lengths of intervals, `secant` their slopes."""
    if len(h) == 1:
        return np.array([secant[0], secant[0]])
    slope = np.empty(len(h) + 1)
    slope[1:-1] = (h[1:] * secant[:-1] + h[:-1] * secant[1:]) / (h[:-1] + h[1:])
    slope[0] = ((2.0 * h[0] + h[1]) * secant[0] - h[0] * secant[1]) / (h[0] + h[1])
    slope[-1] = ((2.0 * h[-1] + h[-2]) * secant[-1] - h[-1] * secant[-2]) / (h[-1] + h[-2])
    return slope
