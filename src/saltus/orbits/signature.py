"""The signature of a periodic orbit, and the result of a dense survey of an orbit."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = [
    "BEYOND", "BOUNDARY", "CLOSED_END", "COARSE", "CUT_END", "DIRECTION", "DOMAIN", "DURATION", "EARLY", "EVENT_END",
    "FAULTS", "MEAN_END", "ONWARD_END", "ON_BORDER", "PHASE_END", "ROOT", "SECTION", "SPEED", "STOP", "TOUCH_END",
    "VALUE", "WHEN", "WHOLE", "Segment", "Signature", "Survey", "events_between", "path_of", "signature_from",
]  # fmt: skip

# Ways in which a segment ends: docs/theory/orbits.md.
EVENT_END = 0  # its event function vanishes
MEAN_END = 1  # its event function's mean rate vanishes: for a segment that starts on the surface on which it ends
PHASE_END = 2  # a whole number of forcing periods
CLOSED_END = 3  # a closed curve of an autonomous mode
TOUCH_END = 4  # a surface is touched, and the motion goes on in the same mode
CUT_END = 5  # a smooth orbit is cut where this piece begins; its duration over that of the piece before is fixed
ONWARD_END = 6  # a flight up to an event is cut where this piece ends; its duration over that of the next is fixed

_COUNTED = 4  # equal segments in a row from which on a signature's text counts them
_SHOWN = 12  # most parts of a signature's text
_MOST_TURNS = 2**31  # forcing periods in an orbit's period: kernels count them
_WITH_EVENT = {EVENT_END, MEAN_END, TOUCH_END}
_OF_FLIGHTS = {EVENT_END, MEAN_END, ONWARD_END}
_WITHOUT_EVENT = {PHASE_END, CLOSED_END, CUT_END, ONWARD_END}

# Bits of what a survey finds; all but COARSE make an orbit inadmissible, for the reasons in `FAULTS`.
DURATION = 1
DIRECTION = 2
EARLY = 4
WHEN = 8
DOMAIN = 16
VALUE = 32
COARSE = 64  # a step of the mesh passed over something
BEYOND = 128
SPEED = 256
ROOT = 512
# Bits that are rounding where the signature changes: what vanishes there has no sign.
ON_BORDER = DURATION | DIRECTION | EARLY | WHEN

# What an event does to motions that meet its surface.
BOUNDARY = 0  # leads to another mode, so that the mode's motions are on one side
STOP = 1  # moves the state within the mode
SECTION = 2  # neither: motions pass freely

WHOLE = -1.0  # in place of the clustered time of a least distance, where the whole segment is equally far

FAULTS = (
    (DURATION, "a segment's duration is not positive"),
    (DIRECTION, "an event is crossed in the wrong direction"),
    (EARLY, "another event lies inside a segment"),
    (WHEN, "a transition's condition does not hold"),
    (DOMAIN, "a mode's domain is left"),
    (ROOT, "the argument of a root is negative"),
    (VALUE, "the state is not finite"),
    (BEYOND, "a segment lies wholly beyond an event of its mode"),
    (SPEED, "an event is met without speed, so that a multiplier is infinite"),
)


@dataclass(frozen=True)
class Signature:
    """The cyclic list of (mode, transition) of an orbit, as indices, with how each segment ends."""

    # modes, transitions, kinds: one entry a segment; transition -1 for a segment without an event
    modes: tuple[int, ...]
    transitions: tuple[int, ...]
    kinds: tuple[int, ...]
    turns: int  # forcing periods in one period of the orbit; 0 for an autonomous system

    def __post_init__(self) -> None:
        columns = (self.modes, self.transitions, self.kinds)
        if not self.modes or len({len(column) for column in columns}) > 1:
            raise InputError("signature", columns, "a mode, a transition and an end for each segment, at least one")
        for number in (*self.modes, *self.transitions, *self.kinds, self.turns):
            if isinstance(number, bool) or not isinstance(number, int | np.integer):
                raise InputError("signature", number, "made of integers")

    def __len__(self) -> int:
        return len(self.modes)

    def check(self, system: HybridSystem) -> None:
        """Raise `InputError` where an index is none of the system's: compiled functions trust them."""
        for mode, transition, kind in zip(self.modes, self.transitions, self.kinds, strict=True):
            if not 0 <= mode < len(system.modes):
                raise InputError("signature's mode", mode, f"between 0 and {len(system.modes) - 1}")
            if kind not in _WITH_EVENT and kind not in _WITHOUT_EVENT:
                raise InputError("signature's end", kind, f"one of {sorted(_WITH_EVENT | _WITHOUT_EVENT)}")
            if kind in _WITHOUT_EVENT and transition != -1:
                raise InputError("signature's transition", transition, "-1 where a segment ends without an event")
            if kind in _WITH_EVENT and not 0 <= transition < len(system.transitions):
                allowed = f"between 0 and {len(system.transitions) - 1}" if system.transitions else "of the system"
                raise InputError("signature's transition", transition, allowed)
            if kind == PHASE_END and system.phase is None:
                raise InputError("signature's end", kind, "one without a phase", "the system has none")
        for i in range(len(self)):
            if self.kinds[i] == ONWARD_END and self.modes[i : i + 1] != self.modes[i + 1 : i + 2]:
                raise InputError("signature's end", ONWARD_END, "one with a piece of the same mode behind it")
        if not 0 <= self.turns < _MOST_TURNS:
            raise InputError("signature's turns", self.turns, f"between 0 and {_MOST_TURNS}")

    def as_list(self, system: HybridSystem) -> list[Any]:
        """Return plain data: modes, transitions, ends, periods of the drive, and how many of these a turn has."""
        count = system.drive_repeats
        return [self.modes, self.transitions, self.kinds, self.turns, *([count] if count > 1 else [])]

    def names(self, system: HybridSystem) -> tuple[tuple[str, str], ...]:
        """Return (mode, transition) names; a segment that ends with the period names the phase, or nothing."""
        closing = "" if system.phase is None else system.phase[0]
        whole = self.whole
        return tuple(
            (system.mode_names[mode], closing if transition < 0 else system.transition_names[transition])
            for mode, transition in zip(whole.modes, whole.transitions, strict=True)
        )

    def names_of_pieces(self, system: HybridSystem) -> list[tuple[str, str]]:
        """Return the (mode, transition) names of each piece's segment; where a flight goes on no transition is."""
        names, at = self.names(system), np.searchsorted(self.heads, np.arange(len(self)), side="right") - 1
        rows = zip((names[i] for i in at), self.kinds, strict=True)
        return [(mode, "" if kind == ONWARD_END else end) for (mode, end), kind in rows]

    @cached_property
    def heads(self) -> tuple[int, ...]:
        """Indices of the segments that do not begin at a cut."""
        return tuple(
            i
            for i, kind in enumerate(self.kinds)
            if kind != CUT_END and not (i > 0 and self.kinds[i - 1] == ONWARD_END)
        )

    @cached_property
    def tails(self) -> tuple[int, ...]:
        """Indices of the segments that do not end at a cut."""
        heads = self.heads
        return (*(i - 1 for i in heads[1:]), len(self) - 1)

    @cached_property
    def is_cut(self) -> bool:
        """Whether a smooth part of the orbit is cut into pieces."""
        return CUT_END in self.kinds or ONWARD_END in self.kinds

    @cached_property
    def flies(self) -> bool:
        """Whether all segments are flights up to events, which may be cut."""
        return set(self.kinds) <= _OF_FLIGHTS

    @cached_property
    def rows(self) -> tuple[int, ...]:
        """The ends of pieces as their equations have them: behind a cut none starts on the surface on which it ends."""
        behind = (0, *self.kinds[:-1])
        pairs = zip(self.kinds, behind, strict=True)
        return tuple(EVENT_END if kind == MEAN_END and last == ONWARD_END else kind for kind, last in pairs)

    @cached_property
    def whole(self) -> Signature:
        """The signature without cuts."""
        return self.joined(self.heads) if self.is_cut else self

    def joined(self, firsts: Sequence[int]) -> Signature:
        """Return the signature with pieces put together; firsts: that of each row of pieces that become one."""
        lasts = (*(i - 1 for i in firsts[1:]), len(self) - 1)
        ends = [j if self.kinds[i] == ONWARD_END else i for i, j in zip(firsts, lasts, strict=True)]
        return self._of([(self.modes[i], self.transitions[i], self.kinds[i]) for i in ends])

    def halved(self, pieces: Sequence[int]) -> Signature:
        """Return the signature with some of its pieces cut in two."""
        rows = []
        for i, own in enumerate(zip(self.modes, self.transitions, self.kinds, strict=True)):
            if i in pieces and own[2] in _OF_FLIGHTS:
                rows.append((own[0], -1, ONWARD_END))
            rows.append(own)
            if i in pieces and own[2] not in _OF_FLIGHTS:
                rows.append((own[0], -1, CUT_END))
        return self._of(rows)

    def _of(self, rows: Sequence[tuple[int, int, int]]) -> Signature:
        modes, transitions, kinds = zip(*rows, strict=True)
        return Signature(modes, transitions, kinds, self.turns)


def signature_from(parts: Any, system: HybridSystem) -> Signature:
    """Return the signature of a file, as `Signature.as_list` writes it; earlier files count turns of the phase."""
    if not isinstance(parts, list) or len(parts) not in (4, 5) or not all(isinstance(part, list) for part in parts[:3]):
        raise InputError("signature", parts, "lists of modes, transitions and ends, and a number of periods")
    modes, transitions, kinds = map(tuple, parts[:3])
    turns, known = parts[3], parts[4] if len(parts) == 5 else 1
    signature = Signature(modes, transitions, kinds, turns)
    if known == system.drive_repeats:
        return signature
    if known != 1:
        raise InputError("signature's drive", known, f"1, or the {system.drive_repeats} times that the drive repeats")
    return replace(signature, turns=turns * system.drive_repeats)


def path_of(signature: tuple[tuple[str, str], ...]) -> str:
    """Return a signature as text; equal segments in a row are counted, the end of a long text is left out."""
    shown: list[str] = []
    for (mode, transition), group in itertools.groupby(signature):
        step, count = f"{mode}:{transition}" if transition else mode, len(list(group))
        shown += [step] * count if count < _COUNTED else [f"{step} ({count} times)"]
    left_out = [f"... ({len(signature)} segments)"] if len(shown) > _SHOWN else []
    return " -> ".join(shown[:_SHOWN] + left_out)


class Segment(NamedTuple):
    """One smooth piece of an orbit.

    Attributes
    ----------
    mode, transition : str
        Mode, and transition at the end. A segment that ends with the period has the phase's name, or an empty text.
    state : ndarray, shape (all states,)
        Full state at its start, phase last; the phase runs on over the period.
    duration : float
        Duration in the system's time.
    """

    mode: str
    transition: str
    state: NDArray[np.float64]
    duration: float


def events_between(system: HybridSystem, segments: Sequence[Segment]) -> NDArray[np.void]:
    """Return the events of an orbit as `landings_beyond` takes them; states before them are NaN."""
    ends = np.cumsum([segment.duration for segment in segments])
    names, modes = np.array(system.transition_names), np.array(system.mode_names)
    n = len(system.all_states)
    fields = [("time", "f8"), ("name", names.dtype if names.size else "U1"), ("mode_before", modes.dtype),
              ("mode_after", modes.dtype), ("before", "f8", (n,)), ("after", "f8", (n,))]  # fmt: skip
    rows = [
        (end, one.transition, one.mode, other.mode, np.full(n, np.nan), other.state)
        for end, one, other in zip(ends, segments, (*segments[1:], segments[0]), strict=True)
        if one.transition in system.transition_names
    ]
    return np.array(rows, dtype=fields)


class Survey(NamedTuple):
    """What a dense look at an orbit shows."""

    faults: int  # bits of what makes the orbit no motion of the system; 0 for an admissible orbit
    # whether a step of the mesh passed over something, so that the orbit is to be solved again on a new mesh
    coarse: bool
    # lows, highs: shape (states + outputs,): extremes over the period; NaN for an output that has no value on part of
    # it
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    # margins, places: shape (segments, transitions): least interior minimum of each event function in its firing
    # direction, and the clustered time of it. Where a whole segment is equally far from the surface, as at rest or on a
    # circle round it, the distance and `WHOLE`: it is positive before the event, negative beyond it, and the event
    # function itself where either direction counts.
    margins: NDArray[np.float64]
    places: NDArray[np.float64]
    # shape (segments, 4): Lie derivative of each segment's event at its end and start, what is left of the segment's
    # equations, and the transition's condition at the end, 1 where there is none
    rates: NDArray[np.float64]
    # shape (segments, transitions): how far each segment's end is from the surface of each event of its mode, positive
    # before the event. NaN for other events, for those in either direction, that do not come nearer there, or whose
    # condition does not hold there
    ahead: NDArray[np.float64]
    # shape (segments, transitions): how far beyond the surface of each event of its mode each segment starts, negative
    # before the event. NaN for other events, for those from which it does not go on there, or whose condition does not
    # hold there
    behind: NDArray[np.float64]
    # shape (segments, transitions): how far from holding the condition of each transition is where the segment meets
    # its surface all the same, and not as its end; negative where it holds, NaN where the surface is not met. How often
    # the surface is met so
    unmet: NDArray[np.float64]
    counts: NDArray[np.int64]
    # shape (states,): state at phase 0, or at the first segment's start where there is no phase
    x0: NDArray[np.float64]
    # shape (states + outputs, 3): means over the period, and of the products with cosine and sine of the angle, which
    # is the phase; without a phase it grows by 2 pi in a period
    moments: NDArray[np.float64]
    implicit: bool = False  # whether the flow is stiff, and was followed by implicit steps
    # segments without length whose event happens at the same instant as the one before, whichever of both is first
    together: tuple[int, ...] = ()

    @property
    def means(self) -> NDArray[np.float64]:
        """Means over the period, shape (states + outputs,)."""
        return self.moments[:, 0]

    @property
    def harmonics(self) -> NDArray[np.complex128]:
        """First harmonics, shape (states + outputs,): a exp(i phi) of a sin(angle + phi)."""
        return np.asarray(2.0 * self.moments[:, 2] + 2.0j * self.moments[:, 1])

    @property
    def residual(self) -> float:
        """Largest gap between a segment's end and the next one's start, or its event."""
        return float(self.rates[:, 2].max())

    @property
    def admissible(self) -> bool:
        """Whether the orbit is a motion of the hybrid system."""
        return self.faults == 0

    def reasons(self) -> tuple[str, ...]:
        """Return in words why the orbit is not admissible."""
        return tuple(text for bit, text in FAULTS if self.faults & bit)
