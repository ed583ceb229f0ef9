"""Poincare sections of a sweep: phase 0, a transition of the system, or a user's surface."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from saltus import checks
from saltus.errors import InputError, nearest
from saltus.system import HybridSystem, Transition
from saltus.system.evaluate import check_expression
from saltus.system.expressions import text_of
from saltus.system.grammar import syntax_tree

__all__ = ["Section", "on_section"]


@dataclass(frozen=True)
class Section:
    """A surface in the state space, in every mode, on which the points of a motion are taken.

    Parameters
    ----------
    event : expression
        Expression in states, phase, parameters and outputs that vanishes on the surface.
    direction : {-1, 0, 1}
        A crossing counts where the event falls (-1), rises (1), or either (0).

    Examples
    --------
    >>> Section("z - 0.5", direction=-1)
    Section(event='z - 0.5', direction=-1)
    """

    event: Any
    direction: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "event", text_of(self.event, "section"))
        allowed = "-1 (falling), 0 (either) or 1 (rising)"
        if checks.number("direction", self.direction, allowed) not in (-1.0, 0.0, 1.0):
            raise InputError("direction", self.direction, allowed)
        object.__setattr__(self, "direction", int(self.direction))


def on_section(system: HybridSystem, section: object) -> tuple[HybridSystem, tuple[int, ...] | None]:
    """Return the system with the section among its transitions, and their indices; None for phase 0.

    A `Section` becomes a transition of every mode, behind all others, that changes nothing. An event of the system on
    the same surface takes precedence: name its transition as the section.

    Raises
    ------
    InputError
        No such section.
    """
    names = system.transition_names
    if section is None:
        if system.phase is None:
            allowed = f"the name of a transition, {', '.join(names)}, or a Section" if names else "a Section"
            named = f"section={names[0]!r} or " if names else ""
            surface = f"section=saltus.Section('{system.states[0]} - 0.5', direction=1)"
            raise InputError("SweepOptions.section", section, allowed, f"the system has no phase: as {named}{surface}")
        return system, None
    if isinstance(section, Section):
        check_expression(system, section.event)
        own = [
            Transition(
                mode, mode, _written_out(system, section.event, mode), section.direction, name=f"section, {mode}"
            )
            for mode in system.mode_names
        ]
        return _with(system, own), tuple(range(len(names), len(names) + len(own)))
    if not isinstance(section, str) or section not in names:
        known = f"one of the transitions {', '.join(names)}, " if names else ""
        hint = nearest(section, names)
        if isinstance(section, str) and not section.isidentifier():
            hint = f"a surface of one's own is Section({section!r})"
        raise InputError("SweepOptions.section", section, f"{known}a Section, or None for phase 0", hint)
    return system, (names.index(section),)


def _with(system: HybridSystem, transitions: list[Transition]) -> HybridSystem:
    definition = system.definition()
    definition["transitions"] += [
        {"source": t.source, "target": t.target, "event": t.event, "direction": t.direction, "name": t.name}
        for t in transitions
    ]
    return HybridSystem.from_definition(definition)


def _written_out(system: HybridSystem, text: str, mode: str) -> str:
    """Return an expression in which the outputs are replaced by their formulas in a mode."""
    text = text.strip()
    known = (*system.all_states, *system.parameter_names, *system.output_names)
    tree = syntax_tree(text, known, "section", InputError)
    lines = text.encode().splitlines(keepends=True)  # the tree counts bytes
    starts = [0, *accumulate(map(len, lines))]
    found = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and node.id in system.outputs]
    written = text.encode()
    for node in sorted(found, key=lambda node: (node.lineno, node.col_offset), reverse=True):
        start = starts[node.lineno - 1] + node.col_offset
        end = start + (node.end_col_offset or 0) - node.col_offset
        output = system.outputs[node.id][mode]
        closed = f"({output}\n)" if "#" in output else f"({output})"
        written = written[:start] + closed.encode() + written[end:]
    return written.decode()
