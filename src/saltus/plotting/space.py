"""Branches and loci as curves in any two or more quantities, and pictures of these curves in space."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import ACCUMULATION, CHANGES
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.parameters import OneParameter, TwoParameters
from saltus.continuation.results.special_points import SpecialPoint
from saltus.errors import InputError
from saltus.plotting import style
from saltus.plotting.branch import pieces_of

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D
    from mpl_toolkits.mplot3d.art3d import Line3D, Poly3DCollection
    from numpy.typing import NDArray

__all__ = [
    "Stretch",
    "axes_in_space",
    "coordinates_of",
    "draw_in_space",
    "draw_level",
    "stretches_of",
]

_VERTICES = 2000  # vertices of a locus, about
_COINCIDENT = 1e-3  # distance in arclength, over a mean step, up to which two nodes of a locus are one
_VIEW = {"elev": 24.0, "azim": -58.0}  # direction from which space is seen, in degrees
_ZOOM = 0.93  # part of its square that the box fills, with room for the height's label
_LABEL_PAD = 14.0  # distance of the height's label from its axis, in points
_TICK_PAD = 6.0  # distance of the height's tick labels from its axis, in points
_TICKS = 5  # most intervals between ticks on an axis


@dataclass(frozen=True)
class Stretch:
    """A stretch of a branch or of a locus of one kind, both ends included."""

    # ``stable``, ``unstable``, ``not admissible`` (orbits) or ``virtual`` (equilibria, orbits of maps). On a locus
    # critical multipliers or eigenvalues do not count.
    kind: str
    places: NDArray[np.float64]  # shape (quantity, vertex): vertices of the curve


@singledispatch
def stretches_of(curve: Any, names: Sequence[str]) -> list[Stretch]:
    """Return a branch or a locus as connected smooth curves, each of one kind.

    Parameters
    ----------
    curve : Branch or Locus, or that of equilibria or of orbits of a map
        The curve.
    names : sequence of str
        Two quantities or more that its `column` knows, or parameters that are constant along the curve.

    Raises
    ------
    InputError
        A quantity of another name.
    """
    raise InputError("curve", type(curve).__name__, "a Branch or a Locus")


@stretches_of.register(OneParameter)
def _(curve: OneParameter[Any], names: Sequence[str]) -> list[Stretch]:
    along = [name for name in names if not _is_constant(curve, name)]
    first = along[0] if along else curve.parameter
    tables = {name: pieces_of(curve, first, name) for name in along or [first]}
    stretches = []
    for row, piece in enumerate(tables[first]):
        columns = [
            tables[name][row].y if name in tables else np.full(len(piece.x), curve.parameters[name]) for name in names
        ]
        stretches.append(Stretch(piece.kind, np.array(columns)))
    return stretches


@stretches_of.register(TwoParameters)
def _(locus: TwoParameters[Any], names: Sequence[str]) -> list[Stretch]:
    """Return a locus as curves, interpolated in arclength by modified Akima splines, which hardly overshoot."""
    points = np.array([_column(locus, name) for name in names]).T
    nodes = [(s, points[i], _kind(locus, i)) for i, s in enumerate(locus.arclength.tolist())]
    nodes += [(point.arclength, coordinates_of(locus, point, names), "") for point in locus.special_points]
    nodes.sort(key=lambda node: node[0])
    if len(nodes) < 2:
        return []
    least = _COINCIDENT * (nodes[-1][0] - nodes[0][0]) / len(nodes)
    apart = [nodes[0]]
    for node in nodes[1:]:
        if node[0] - apart[-1][0] > least:
            apart.append(node)
        elif not node[2]:
            apart[-1] = node
    kinds = _kinds_between([kind for _, _, kind in apart])
    each = max(_VERTICES // len(apart), 8)
    curve = _smooth(np.array([s for s, _, _ in apart]), np.array([place for _, place, _ in apart]), each)
    begins = [i for i, kind in enumerate(kinds) if i == 0 or kind != kinds[i - 1]]
    ends = [*begins[1:], len(kinds)]
    return [
        Stretch(kinds[first], curve[:, first * each : last * each + 1])
        for first, last in zip(begins, ends, strict=True)
    ]


def coordinates_of(curve: SolutionCurve[Any], point: SpecialPoint[Any], names: Sequence[str]) -> NDArray[np.float64]:
    """Return quantities of `stretches_of` at a special point of a curve; shape (quantity,)."""
    return np.array([point.parameters[n] if _is_constant(curve, n) else curve.value_at(point, n) for n in names])


def _is_constant(curve: SolutionCurve[Any], name: str) -> bool:
    return name in curve.parameters and name not in curve.varied


def _column(locus: TwoParameters[Any], name: str) -> NDArray[np.float64]:
    return np.full(len(locus), locus.parameters[name]) if _is_constant(locus, name) else locus.column(name)


def _kind(locus: TwoParameters[Any], index: int) -> str:
    """Return the kind of a point; one at which orbits change, and multipliers tell of no side, counts as stable."""
    if not locus.sound[index]:
        return locus.fault
    return "stable" if locus.stable[index] or locus.type in (*CHANGES, ACCUMULATION) else "unstable"


def _kinds_between(nodes: list[str]) -> list[str]:
    """Return the kind of each interval between nodes; special points have no kind of their own (empty)."""
    kinds = []
    for before, after in pairwise(nodes):
        met = {before, after} - {""}
        kinds.append(next((kind for kind in (*style.FAULTY, "unstable", "stable") if kind in met), ""))
    known = next((kind for kind in kinds if kind), "stable")
    for i, kind in enumerate(kinds):
        known = kinds[i] = kind or known
    return kinds


def _smooth(s: NDArray[np.float64], places: NDArray[np.float64], each: int) -> NDArray[np.float64]:
    """Return a curve through all places with `each` vertices an interval, shape (quantity, vertex)."""
    from scipy.interpolate import Akima1DInterpolator

    fine = np.append((s[:-1, None] + np.diff(s)[:, None] * np.arange(each) / each).ravel(), s[-1])
    if len(s) == 2:
        return np.array([np.interp(fine, s, column) for column in places.T])
    return np.asarray(Akima1DInterpolator(s, places, method="makima")(fine)).T


def axes_in_space() -> Axes3D:
    """Return Axes in space in a new figure, seen from in front and above, with room for the height's label."""
    ax = style.new_figure().add_subplot(projection="3d", **_VIEW)
    ax.set_box_aspect((1.2, 1.2, 0.9), zoom=_ZOOM)
    ax.zaxis.labelpad = _LABEL_PAD
    ax.tick_params(axis="z", pad=_TICK_PAD)
    ax.locator_params(nbins=_TICKS)
    return ax


def draw_in_space(
    ax: Axes3D,
    curve: SolutionCurve[Any],
    names: tuple[str, str, str],
    *,
    kinds: Collection[str] = tuple(style.LINES),
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    **line: Any,
) -> list[Line3D]:
    """Draw a branch or a locus into Axes in space and return the lines, one for each stretch.

    As in the plane, lines are solid where stable, dashed where unstable, dotted where the orbits are no motion of the
    system. Parts outside the limits of the axes are left out.

    Parameters
    ----------
    ax : mpl_toolkits.mplot3d.Axes3D
        Where to draw.
    curve : Branch or Locus
        The curve.
    names : (str, str, str)
        Quantities, as `stretches_of` takes them.
    kinds : collection of {"stable", "unstable", "not admissible", "virtual"}, optional
        Kinds that are drawn; by default all.
    origin : (float, float, float), optional
        Value that is subtracted from each quantity.
    **line
        Options of the lines in place of those of `style.LINES`; a ``label`` goes to the first line.

    Raises
    ------
    InputError
        A quantity of another name.
    """
    label = line.pop("label", None)
    lines: list[Line3D] = []
    for stretch in stretches_of(curve, names):
        if stretch.kind in kinds:
            x, y, z = stretch.places - np.array(origin)[:, None]
            options = {**style.LINES[stretch.kind], "axlim_clip": True, **line}
            lines += ax.plot(x, y, z, label="_" if lines or label is None else label, **options)
    return lines


def draw_level(ax: Axes3D, height: float, **surface: Any) -> Poly3DCollection:
    """Draw a transparent plane at a height, over the whole box, and return it.

    Parameters
    ----------
    ax : mpl_toolkits.mplot3d.Axes3D
        Where to draw; the plane spans its present limits.
    height : float
        Height of the plane.
    **surface
        Options of the polygon in place of those of `style.PLANE`.
    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    (left, right), (front, back) = ax.get_xlim(), ax.get_ylim()
    corners = [(left, front, height), (right, front, height), (right, back, height), (left, back, height)]
    plane = Poly3DCollection([corners], **{**style.PLANE, **surface})
    ax.add_collection3d(plane)
    return plane
