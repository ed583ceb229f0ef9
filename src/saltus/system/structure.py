"""How the parts of a definition fit together."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from typing import Any

from saltus.errors import DefinitionError, nearest

__all__ = ["check_structure"]


def check_structure(definition: Any, let: Iterable[str]) -> None:
    """Raise `DefinitionError` where the parts of a definition do not fit together: names, equations, resets, modes.

    Parameters
    ----------
    definition : Definition
        Its parts, read one by one.
    let : iterable of str
        Names of sub-expressions.
    """
    taken: set[str] = set()
    for name in (*definition.all_states, *definition.parameters, *definition.outputs, *let):
        if (read := unicodedata.normalize("NFKC", name)) in taken:
            raise DefinitionError("states, parameters, phase, outputs and let", name, "named once")
        taken.add(read)
    if not definition.modes:
        raise DefinitionError(f"{definition.part}s", {}, f"at least one {definition.part}")
    for key, mode in definition.modes.items():
        if missing := [name for name in definition.states if name not in mode.field]:
            wanted = f"an equation for each of {', '.join(definition.states)}"
            where = f"{definition.part} {key!r}"
            raise DefinitionError(where, list(mode.field), wanted, f"{missing[0]!r} is missing")
        if extra := [name for name in mode.field if name not in definition.states]:
            hint = "the phase has its rate already" if definition.phase and extra[0] == definition.phase[0] else ""
            hint = hint or nearest(extra[0], definition.states)
            raise DefinitionError(
                f"{definition.part} {key!r}", extra[0], f"a state: {', '.join(definition.states)}", hint
            )
    names = definition.transition_names
    for transition in definition.transitions:
        where = f"transition {transition.name!r}"
        if names.count(transition.name) > 1:
            raise DefinitionError(where, transition.name, "named once", "pass name=")
        for name in (transition.source, transition.target):
            if not isinstance(name, str) or name not in definition.modes:
                hint = nearest(name, definition.modes)
                raise DefinitionError(where, name, f"a mode: {', '.join(definition.modes)}", hint)
        for state in transition.reset:
            if state not in definition.all_states:
                wanted = f"a state to reset: {', '.join(definition.states)}"
                raise DefinitionError(where, state, wanted, nearest(state, definition.states))
            if definition.phase and state == definition.phase[0]:
                raise DefinitionError(where, state, "a state other than the phase, which runs on across events")
    for key, members in definition.groups.items():
        if unknown := [member for member in members if member not in definition.parameters]:
            raise DefinitionError(f"group {key!r}", unknown[0], f"one of {', '.join(definition.parameters)}")
    for key, visited in definition.regimes.items():
        if unknown := [mode for mode in visited if mode not in definition.modes]:
            hint = nearest(unknown[0], definition.modes)
            raise DefinitionError(f"regime {key!r}", unknown[0], f"a mode: {', '.join(definition.modes)}", hint)
    for key in (*definition.positive, *definition.parameter_bounds):
        if key not in definition.parameters:
            raise DefinitionError("positive, parameter_bounds", key, f"one of {', '.join(definition.parameters)}")
