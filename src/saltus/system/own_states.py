"""Modes that lack some of the system's states: completed, so that every mode carries all of them.

A state that a mode lacks rests at 0 there. Transitions into the mode set it to 0, and transitions out of it set it to
what their reset says. So the derivative of a period map is 0 along it, and the others are those of the mode's own
states.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import DefinitionError, nearest
from saltus.system.expressions import NAME
from saltus.system.once import once
from saltus.system.parts import Mode, Transition

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["absent_states", "completed_mode", "completed_transition", "faded"]

_ABSENT = "0"  # value of a state that a mode lacks
# Rate, over that of the drive, at which a disturbance of such a state fades: an orbit without a mode that has the state
# would be one of a family otherwise.
_DECAYS = 6


def completed_mode(key: str, mode: Mode, states: tuple[str, ...], phase: tuple[str, str] | None) -> Mode:
    """Return a mode with an equation for each state of the system, and its own states named.

    Parameters
    ----------
    key : str
        Its name.
    mode : Mode
        The mode, its expressions texts.
    states : tuple of str
        States of the system.
    phase : (str, str) or None
        Name and rate of its phase.

    Raises
    ------
    DefinitionError
        A state of its own is none of the system's; the mode uses a state that it lacks.
    """
    if mode.states is None:
        return mode
    where = f"mode {key!r}"
    if unknown := [name for name in mode.states if name not in states]:
        wanted = f"states of the system: {', '.join(states)}"
        raise DefinitionError(where, unknown[0], wanted, nearest(unknown[0], states))
    lacking = [name for name in states if name not in mode.states]
    if extra := [name for name in lacking if name in mode.field]:
        raise DefinitionError(where, extra[0], f"one of its states: {', '.join(mode.states)}")
    texts = [*mode.field.values(), *(text for text in (mode.domain, mode.surface) if text is not None)]
    _check_known(where, texts, lacking, f"mode {key!r}")
    own = tuple(name for name in states if name in mode.states)
    return faded(replace(mode, states=own if lacking else None), lacking, phase)


def faded(mode: Mode, lacking: Iterable[str], phase: tuple[str, str] | None, repeats: int = 1) -> Mode:
    """Return a mode in which states that it lacks fade within a period of the drive, which a turn has so many of."""
    rate = "1" if phase is None else f"{_DECAYS * repeats}*({phase[1]})"
    return replace(mode, field={**mode.field, **{name: f"-({rate})*{name}" for name in lacking}})


def completed_transition(transition: Transition, modes: Mapping[str, Mode], states: tuple[str, ...]) -> Transition:
    """Return a transition that sets the states to 0 which its target lacks.

    Parameters
    ----------
    transition : Transition
        The transition between two of the modes, its expressions texts.
    modes : mapping of str to Mode
        The modes, completed.
    states : tuple of str
        States of the system.

    Raises
    ------
    DefinitionError
        A state that its source lacks is used, or is not reset although its target has it; a state is reset that its
        target lacks.
    """
    before, after = (modes[name].states or states for name in (transition.source, transition.target))
    where = f"transition {transition.name!r}"
    if missing := [name for name in after if name not in before and name not in transition.reset]:
        hint = f"{transition.source!r} lacks it and {transition.target!r} has it"
        raise DefinitionError(where, list(transition.reset), f"a reset with {missing[0]!r}", hint)
    lost = [name for name in states if name not in after]
    if named := [name for name in lost if transition.reset.get(name, _ABSENT) != _ABSENT]:
        raise DefinitionError(where, named[0], f"a state of {transition.target!r}: {', '.join(after)}")
    given = {name: text for name, text in transition.reset.items() if name not in lost}
    texts = [transition.event, *given.values(), *([transition.when] if transition.when is not None else [])]
    lacking = [name for name in states if name not in before]
    _check_known(where, texts, lacking, f"mode {transition.source!r}")
    return replace(transition, reset={**given, **{name: _ABSENT for name in lost if name in before}})


def _check_known(where: str, texts: Iterable[str], lacking: list[str], mode: str) -> None:
    """Raise `DefinitionError` where an expression uses a state that a mode lacks."""
    for text in texts:
        if used := [name for name in NAME.findall(text) if name in lacking]:
            raise DefinitionError(where, text, f"an expression without {used[0]}", f"{mode} lacks this state")


@once
def absent_states(system: Any, mode: int) -> NDArray[np.int64]:
    """Return the places of the states that a mode lacks, by its index."""
    own = system.modes[system.mode_names[mode]].states or system.states
    return np.array([i for i, name in enumerate(system.states) if name not in own], dtype=np.int64)
