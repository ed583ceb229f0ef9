"""States as a user hands them in: numbers in order, or a mapping of names to numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from saltus.checks.numeric import number
from saltus.checks.textual import mapping
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    StateLike: TypeAlias = ArrayLike | Mapping[str, float]

__all__ = ["leaves_out_phase", "named_state", "shapes_that_fit"]


def named_state(
    given: Mapping[str, object], name: str, states: tuple[str, ...], phase: str | None, own: Sequence[str] | None
) -> NDArray[np.float64]:
    """Return the state that a mapping names, with the phase last where there is one.

    States that the mode lacks, whose own states are `own`, are 0 where they are left out; so is the phase. The error
    says which state is missing, or which name is unknown.
    """
    known = states if phase is None else (*states, phase)
    found = mapping(name, given, "states to numbers", known=known)
    needed = states if own is None else own
    if missing := [state for state in needed if state not in found]:
        raise InputError(name, dict(given), f"a value for each of {', '.join(needed)}", f"{missing[0]!r} is missing")
    return np.array([number(f"{name}[{state!r}]", found.get(state, 0.0)) for state in known])


def shapes_that_fit(states: tuple[str, ...], phase: str | None, own: Sequence[str] | None, mode: str | None) -> str:
    """Return in words which lengths a state may have, to be read after "must be"."""
    fits = f"of shape ({len(states)},), one number for each of {', '.join(states)}"
    if phase is not None:
        fits += f", or ({len(states) + 1},) with the phase {phase}"
    if own is not None and len(own) != len(states):
        fits += f", or ({len(own)},) for {', '.join(own)} of mode {mode!r}"
    return fits


def leaves_out_phase(given: object, phase: str, lengths: tuple[int, ...]) -> bool:
    """Return whether a state comes without its phase: it has one of the lengths that states without phase may have."""
    return phase not in given if isinstance(given, Mapping) else np.size(given) in lengths  # type: ignore[arg-type]
