"""The motion from the start while a slider moves, and the orbit that is carried along: drawn by a process of its own.

Only the last wish counts: one picture is drawn at a time, and of the wishes that come meanwhile the newest waits.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from saltus.companion import Companion
from saltus.errors import SaltusError
from saltus.explorer.solutions import path_of
from saltus.explorer.subjects import system_of
from saltus.system.maps import flowing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.progress import Report
    from saltus.system import HybridSystem

    Curves = tuple[NDArray[np.float64], NDArray[np.float64]]

__all__ = ["Frame", "Live", "Wish", "joined", "motion_frame", "orbit_frame", "picture", "prepare", "segments_of"]

_FRAME = 0.015  # seconds of a processor that the motion in a picture should take, and the orbit beside it at most
_STEPS = (150, 2000)  # fewest and most steps of a motion that is drawn
_EVENTS = 2000  # most events of a motion that is drawn
_WHOLE = 0.999  # share of a motion from which on all of it is drawn
_LOST = "the orbit is not carried to these values"
_EMPTY = np.empty((0, 2))


@dataclass(frozen=True)
class Wish:
    """What is to be drawn."""

    definition: str  # of the system, as JSON
    parameters: dict[str, float]  # their values
    x0: tuple[float, ...]  # where the motion starts
    mode: str | None  # in which mode
    planes: tuple[str, str, str]  # abscissa and ordinate of the portrait, and what is shown over time
    span: float  # how long the motion lasts: periods where the system has a phase, else time
    shown: bool = True  # False to get ready only


@dataclass(frozen=True)
class Frame:
    """A part of a picture: the motion, or the orbit; each curve has shape (vertex, 2), with NaN between its pieces."""

    wish: Wish  # what it answers
    part: Literal["motion", "orbit"]  # what is drawn
    portrait: NDArray[np.float64]  # the curve in the portrait
    series: NDArray[np.float64]  # the curve over time
    told: str = ""  # what is to be said of it
    segments: Any = None  # (mode, transition, state, duration) of each of the orbit's: from here the next is found
    seconds: float = 0.0  # of a processor


def prepare() -> None:
    """Import what pictures need, before the first one."""
    import saltus.flow
    import saltus.orbits  # noqa: F401


def motion_frame(wish: Wish, steps: int, progress: Report | bool = False) -> Frame:
    """Return the motion from a start.

    Parameters
    ----------
    wish : Wish
        What is to be drawn.
    steps : int
        Most steps of the motion: it is drawn as far as they lead.
    progress : callable or bool, optional
        Not used.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> from saltus.explorer.subjects import definition_of
    >>> decay = definition_of(HybridSystem.smooth({"x": "-a*x"}, {"a": 1.0}))
    >>> motion_frame(Wish(decay, {"a": 2.0}, (1.0,), None, ("t", "x", "x"), 1.0), 1000).portrait[-2].round(6)
    array([1.      , 0.135335])
    """
    from saltus.flow import SimulationOptions, simulate

    begun, system = time.process_time(), flowing(system_of(wish.definition))
    options = SimulationOptions(max_events=_EVENTS, max_steps=steps)
    span: dict[str, Any] = {"periods": max(round(wish.span), 1)} if system.phase is not None else {"t_end": wish.span}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a motion that is kept tells them
            motion = simulate(system, wish.parameters, list(wish.x0), mode=wish.mode, options=options, **span)
            curves = _curves(motion, wish)
    except SaltusError as error:
        return Frame(wish, "motion", _EMPTY, _EMPTY, f"no motion: {error}")
    whole = wish.span * _unit(system, wish)
    told = "" if motion.t_end >= _WHOLE * whole else f"the motion is drawn to t = {motion.t_end:.2g}"
    return Frame(wish, "motion", *curves, told, None, time.process_time() - begun)


def orbit_frame(wish: Wish, segments: Any, progress: Report | bool = False) -> Frame:
    """Return the orbit that one nearby becomes at the wished values of the parameters.

    Parameters
    ----------
    wish : Wish
        What is to be drawn.
    segments : sequence of (mode, transition, state, duration)
        Those of the orbit at values nearby.
    progress : callable or bool, optional
        Not used.
    """
    from saltus.orbits import solve_orbit

    begun = time.process_time()

    def frame(told: str, curves: Curves = (_EMPTY, _EMPTY), segments: Any = None) -> Frame:
        """Return the picture with the time that it took."""
        return Frame(wish, "orbit", *curves, told, segments, time.process_time() - begun)

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = solve_orbit(flowing(system_of(wish.definition)), wish.parameters, segments)
        if not found.admissible:
            return frame(f"{_LOST}: {', '.join(found.reasons)}")
        told = "the orbit is carried, " + ("stable" if found.stable else "unstable")
        return frame(told, _curves(found, wish), segments_of(found))
    except SaltusError:
        return frame(_LOST)


def picture(wish: Wish, steps: int, segments: Any, progress: Report | bool = False) -> tuple[Frame, Frame]:
    """Return the motion from a start, and the orbit that one nearby becomes: a browser paints both at once.

    Parameters
    ----------
    wish : Wish
        What is to be drawn.
    steps : int
        Most steps of the motion.
    segments : sequence of (mode, transition, state, duration)
        Those of the orbit at values nearby.
    progress : callable or bool, optional
        Not used.
    """
    return motion_frame(wish, steps), orbit_frame(wish, segments)


def _unit(system: HybridSystem, wish: Wish) -> float:
    """Return the time in which a span is counted: the phase's period, or 1."""
    from saltus.system.evaluate import evaluate

    if system.phase is None:
        return 1.0
    states = np.zeros((1, len(system.all_states)))
    return system.turn / float(evaluate(system, system.phase[1], states, 0, wish.parameters)[0])


def segments_of(orbit: Any) -> Any:
    """Return the segments of a periodic orbit as plain data; None of what has none."""
    from saltus.orbits import PeriodicOrbit

    return tuple(tuple(segment) for segment in orbit.segments) if isinstance(orbit, PeriodicOrbit) else None


def _curves(shown: Any, wish: Wish) -> Curves:
    """Return a motion in the portrait and over time."""
    x, y, over = wish.planes
    table = joined(path_of(shown, (x, y, "t", over)).curves)
    return table[:, :2], table[:, 2:]


def joined(curves: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return curves as one, with NaN between them."""
    if not curves:
        return np.empty((0, 4))
    gap = np.full((1, curves[0].shape[1]), np.nan)
    return np.vstack([part for curve in curves for part in (curve, gap)])


class Live:
    """The process that draws, and what it is asked.

    Parameters
    ----------
    shown : callable
        Called with each `Frame` that is not out of date.
    """

    def __init__(self, shown: Callable[[Frame], None]) -> None:
        self._shown = shown
        self._companion = Companion(prepare)
        self._waiting: Wish | None = None  # of which nothing is drawn yet
        self._half: Wish | None = None  # of which the motion is drawn, and the orbit is not
        self._key: int | None = None
        self._steps = _STEPS[1] // 2
        self._segments: Any = None
        self._sent: Any = None
        self._quick = False  # whether the orbit took so little time that it is drawn with the motion

    @property
    def busy(self) -> bool:
        """Whether a picture is being drawn."""
        return self._key is not None

    def start_from(self, orbit: Any) -> None:
        """Carry another orbit from now on; None for none."""
        self._segments, self._half, self._quick = segments_of(orbit), None, False

    def want(self, wish: Wish) -> None:
        """Ask for a picture; of wishes that come while another is drawn, the last one counts.

        What is being drawn is not interrupted: its steps are bounded. One that is not shown is for a process at rest.
        """
        if not wish.shown and self.busy:
            return
        self._waiting = wish
        if self._key is None:
            self._next()

    def _next(self) -> None:
        """Ask for the orbit of the motion that was drawn last, else for what is wished now."""
        if self._half is not None and self._segments is not None:
            wish, self._half, self._sent = self._half, None, self._segments
            self._key = self._companion.submit(orbit_frame, wish, self._sent)
        elif self._waiting is not None and self._quick and self._segments is not None:
            wish, self._waiting, self._sent = self._waiting, None, self._segments
            self._key = self._companion.submit(picture, wish, self._steps, self._sent)
        elif self._waiting is not None:
            self._half, self._waiting = self._waiting, None
            self._key = self._companion.submit(motion_frame, self._half, self._steps)

    def listen(self) -> None:
        """Take in what was drawn since the last call, and ask for what is wished now."""
        for message in self._companion.heard():
            if message.kind != "progress" and message.key == self._key:
                self._key = None
                if message.kind == "result":
                    for drawn in message.content if isinstance(message.content, tuple) else (message.content,):
                        self._take(drawn)
        if self._key is None:
            self._next()

    def _take(self, drawn: Frame) -> None:
        if drawn.part == "motion":
            scale = min(max(_FRAME / max(drawn.seconds, 1e-4), 0.25), 2.0)
            self._steps = int(min(max(self._steps * scale, _STEPS[0]), _STEPS[1]))
        elif self._segments is not self._sent:  # another one is carried meanwhile
            return
        else:
            self._quick = drawn.seconds < _FRAME
            self._segments = self._segments if drawn.segments is None else drawn.segments
        if drawn.wish.shown:
            self._shown(drawn)

    def close(self) -> None:
        """Leave the process."""
        self._companion.leave()
        self._key = self._waiting = self._half = None
