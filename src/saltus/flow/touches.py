"""Places at which an event function is zero within its rounding and does not change its sign: no event happens."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.contents import Contents
    from saltus.system.hybrid import HybridSystem

__all__ = ["Touch", "held_touches", "touch_table", "touches_of"]


@dataclass(frozen=True)
class Touch:
    """An event function that touches 0, or stays at 0, to its rounding: such places are no events.

    Parameters
    ----------
    event : str
        The transition.
    mode : str
        The mode that it leaves.
    count : int
        Steps in which this is so.
    first, last : float
        Times of the first and the last of them.
    """

    event: str
    mode: str
    count: int
    first: float
    last: float

    def __str__(self) -> str:
        when = f"at t = {self.first:.10g}"
        if self.count > 1:
            when = f"in {self.count} steps between t = {self.first:.10g} and t = {self.last:.10g}"
        return (
            f"the function of event {self.event!r} of mode {self.mode!r} is 0 to rounding {when}, without a change of "
            "sign: not counted"
        )


def touches_of(system: HybridSystem, counts: NDArray[np.int64], times: NDArray[np.float64]) -> tuple[Touch, ...]:
    """Return what a motion has noted of each transition: in how many steps, and the first and the last time."""
    return tuple(
        Touch(transition.name, transition.source, int(count), float(first), float(last))
        for transition, count, (first, last) in zip(system.transitions, counts, times, strict=True)
        if count
    )


def touch_table(system: HybridSystem, touches: tuple[Touch, ...]) -> NDArray[np.float64]:
    """Return rows of transition, count, first and last time, shape (touch, 4), for a file."""
    rows = [[system.transition_names.index(t.event), t.count, t.first, t.last] for t in touches]
    return np.array(rows, dtype=float).reshape(len(rows), 4)


def held_touches(system: HybridSystem, held: Contents) -> tuple[Touch, ...]:
    """Return the touches in a file, which an earlier one lacks."""
    if "touches" not in held.dataset.variables:
        return ()
    table = held.array("touches", ("touch", "touch_field"), least=0.0)
    held.expect(touch_field=4)
    which, counts = table[:, 0], table[:, 1]
    if np.any(which >= len(system.transitions)) or np.any(which % 1.0) or np.any(counts % 1.0):
        raise InputError("variable 'touches'", table.tolist(), "rows of a transition, a count and two times")
    names = [system.transitions[int(k)] for k in which]
    return tuple(
        Touch(t.name, t.source, int(count), first, last)
        for t, (_, count, first, last) in zip(names, table.tolist(), strict=True)
    )
