"""What a phase plane shows besides motions: the direction field, nullclines and event surfaces, as curves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.system.evaluate import evaluate
from saltus.system.own_states import absent_states
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = ["Window", "directions", "full_start", "modes_on", "nullclines", "surfaces"]

_ARROWS = (22, 16)  # arrows along the abscissa and the ordinate
_SHAFT = 0.62  # length of an arrow, over the distance between two
_HEAD = 0.28  # length of its head, over its own
_GRID = 81  # places along each side between which curves are drawn
_STEEP = 0.1  # value on a curve of zeros, over its change about there, from which on it jumps instead


@dataclass(frozen=True)
class Window:
    """A part of the plane of two states, all others fixed.

    Attributes
    ----------
    names : (str, str)
        The states to the right and upwards.
    x, y : (float, float)
        Their ranges.
    start : mapping of str to float
        The full state through which the plane goes, the phase included.
    parameters : mapping of str to float
        Parameters that differ from the defaults.
    """

    names: tuple[str, str]
    x: tuple[float, float]
    y: tuple[float, float]
    start: Mapping[str, float]
    parameters: Mapping[str, float]

    def states(self, system: HybridSystem, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return full states at places of the plane, shape (place, all states)."""
        columns = {name: np.full(x.size, self.start[name]) for name in system.all_states}
        columns |= dict(zip(self.names, (x.ravel(), y.ravel()), strict=True))
        return np.column_stack([columns[name] for name in system.all_states])


def modes_on(system: HybridSystem, states: NDArray[np.float64], parameters: Mapping[str, float]) -> NDArray[np.int64]:
    """Return the index of the mode in which a motion from each state starts; -1 where none does.

    It is the first whose domain holds the state and none of whose events to other modes is passed, as for `simulate`.
    Modes that slide along a surface are left out: a plane meets the surface in a curve.

    Parameters
    ----------
    system : HybridSystem
        The system.
    states : ndarray, shape (place, all states)
        Full states.
    parameters : mapping of str to float
        Parameters that differ from the defaults.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition
    >>> relay = HybridSystem(
    ...     ("x",), {}, {"right": Mode({"x": "-1"}), "left": Mode({"x": "1"})},
    ...     [Transition("right", "left", "x", -1), Transition("left", "right", "x", 1)],
    ... )
    >>> modes_on(relay, np.array([[1.0], [-1.0]]), {})
    array([0, 1])
    """
    found = np.full(len(states), -1, np.int64)
    for index, (name, mode) in enumerate(system.modes.items()):
        if mode.surface is not None:
            continue
        free = (found < 0) & np.all(states[:, absent_states(system, index)] == 0.0, axis=1)
        if mode.domain is not None:
            free &= evaluate(system, mode.domain, states, index, parameters) > 0.0
        for transition in system.transitions:
            if transition.source != name or transition.target == name or at_phases(system, transition):
                continue
            passed = evaluate(system, transition.event, states, index, parameters) * transition.direction > 0.0
            if transition.when is not None:
                passed &= evaluate(system, transition.when, states, index, parameters) > 0.0
            free &= ~passed
        found[free] = index
    return found


def directions(
    system: HybridSystem, window: Window, shape: tuple[float, float]
) -> tuple[list[list[float]], list[list[float]], list[int]]:
    """Return the direction field as arrows of one length on the screen.

    Parameters
    ----------
    system : HybridSystem
        The system.
    window : Window
        What is seen of the plane.
    shape : (float, float)
        Width and height of the window on the screen.

    Returns
    -------
    xs, ys : list of list of float
        Vertices of each arrow: the shaft, then both sides of the head.
    modes : list of int
        The mode of each.
    """
    centres = (np.linspace(*ends, 2 * n + 1)[1::2] for ends, n in zip((window.x, window.y), _ARROWS, strict=True))
    x, y = (side.ravel() for side in np.meshgrid(*centres))
    states = window.states(system, x, y)
    modes = modes_on(system, states, window.parameters)
    units = np.array([np.ptp(window.x) / shape[0], np.ptp(window.y) / shape[1]])  # of the plane, for a pixel
    with np.errstate(all="ignore"):
        rates = np.column_stack([_rate(system, name, states, modes, window) for name in window.names]) / units
        rates /= np.hypot(*rates.T)[:, None]
    sound = np.all(np.isfinite(rates), axis=1)
    length = _SHAFT * min(shape[0] / _ARROWS[0], shape[1] / _ARROWS[1])
    along = rates[sound] * length
    across = np.column_stack([-along[:, 1], along[:, 0]])
    middle = np.column_stack([x, y])[sound]
    tip = 0.5 * along
    vertices = [-tip, tip, tip - _HEAD * (along + 0.6 * across), tip, tip - _HEAD * (along - 0.6 * across)]
    table = np.stack([middle + place * units for place in vertices], axis=1)
    return table[:, :, 0].tolist(), table[:, :, 1].tolist(), modes[sound].tolist()


def nullclines(system: HybridSystem, window: Window) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Go through the curves on which the rate of a state of the plane is zero, each in the mode that moves there.

    Parameters
    ----------
    system : HybridSystem
        The system.
    window : Window
        What is seen of the plane.

    Yields
    ------
    number : int
        0 for the state to the right, 1 for that upwards.
    curve : ndarray, shape (vertex, 2)
        The curve.
    """
    states = window.states(system, *np.meshgrid(*_sides(window)))
    modes = modes_on(system, states, window.parameters)
    for number, name in enumerate(window.names):
        for index in np.unique(modes[modes >= 0]).tolist():
            for curve in _zeros(system, window, _field(system, index, name), index):
                inside = modes_on(system, window.states(system, *curve.T), window.parameters) == index
                yield from ((number, part) for part in _parts(curve, inside))


def surfaces(system: HybridSystem, window: Window) -> Iterator[tuple[str, str, NDArray[np.float64]]]:
    """Go through the curves in which the surfaces of events meet the plane.

    Surfaces of the phase alone are left out, as they lie across no plane of states.

    Parameters
    ----------
    system : HybridSystem
        The system.
    window : Window
        What is seen of the plane.

    Yields
    ------
    names : str
        The transitions of the surface.
    event : str
        The event function.
    curve : ndarray, shape (vertex, 2)
        The curve.
    """
    told: dict[str, list[str]] = {}
    sources: dict[str, int] = {}
    for transition in system.transitions:
        if not at_phases(system, transition):
            told.setdefault(transition.event, []).append(transition.name)
            sources.setdefault(transition.event, system.mode_index(transition.source))
    for event, names in told.items():
        yield from ((", ".join(names), event, curve) for curve in _zeros(system, window, event, sources[event]))


def _sides(window: Window) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both axes of a grid over a window."""
    return np.linspace(*window.x, _GRID), np.linspace(*window.y, _GRID)


def _zeros(system: HybridSystem, window: Window, text: str, mode: int) -> Iterator[NDArray[np.float64]]:
    """Go through the curves on which an expression is zero; where it jumps from one sign to the other, it is not."""
    from contourpy import contour_generator

    def heights(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        return evaluate(system, text, window.states(system, x, y), mode, window.parameters)

    x, y = _sides(window)
    table = np.ma.masked_invalid(heights(*np.meshgrid(x, y)).reshape(len(y), len(x)))
    lines: Any = contour_generator(x, y, table).lines(0.0)
    dx, dy = x[1] - x[0], y[1] - y[0]
    for line in lines:
        curve = np.asarray(line, dtype=np.float64)
        a, b = curve.T
        about = [heights(a + i * dx, b + j * dy) for i, j in ((-1, -1), (-1, 1), (1, -1), (1, 1))]
        with np.errstate(invalid="ignore"):
            zero = np.abs(heights(a, b)) <= _STEEP * np.ptp(about, axis=0)
        yield from _parts(curve, zero)


def _parts(curve: NDArray[np.float64], holds: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
    """Go through the parts of a curve on which something holds."""
    cuts = np.flatnonzero(np.diff(holds.astype(np.int8))) + 1
    for part, first in zip(np.split(curve, cuts), np.split(holds, cuts), strict=True):
        if len(part) > 1 and first[0]:
            yield part


def _field(system: HybridSystem, mode: int, name: str) -> str:
    """Return the expression of a state's rate in a mode."""
    return str(system.modes[system.mode_names[mode]].field[name])


def _rate(
    system: HybridSystem, name: str, states: NDArray[np.float64], modes: NDArray[np.int64], window: Window
) -> NDArray[np.float64]:
    """Return the rate of a state at each place, in the mode of the place; NaN where there is none."""
    rates = np.full(len(states), np.nan)
    for index in np.unique(modes[modes >= 0]).tolist():
        rows = modes == index
        rates[rows] = evaluate(system, _field(system, index, name), states[rows], index, window.parameters)
    return rates


def full_start(system: HybridSystem | Map, x0: Sequence[float]) -> dict[str, float]:
    """Return a start by the names of all states; a phase that it leaves out is 0."""
    return dict.fromkeys(system.all_states, 0.0) | dict(zip(system.all_states, map(float, x0), strict=False))
