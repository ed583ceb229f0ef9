"""Text that reads and writes the fields of a lane and the numbers of a run, for all writers of steps."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from saltus.ensemble.labels import FIELDS
from saltus.ensemble.lane_kinds import pools_of
from saltus.system.expansion import expanded
from saltus.system.parts import at_phases
from saltus.system.writer import Writer

if TYPE_CHECKING:
    import sympy

    from saltus.system.derivatives import Symbolic

__all__ = ["LaneText"]


class LaneText(Writer):
    """Where a lane keeps what, as text that reads and writes it.

    Parameters
    ----------
    system : Symbolic
        The definition.
    order : int
        Last coefficient of the Taylor series.
    exact : dict of int to int
        Modes with steps by the exact flow, and the pairs of complex eigenvalues of their linear parts.
    """

    def __init__(self, system: Symbolic, order: int, exact: dict[int, int]) -> None:
        super().__init__(system)
        self.order = order
        self.has_phase = system.system.phase is not None
        self.n_states = self.n - 1 if self.has_phase else self.n
        self.pools = pools_of(system, exact)
        self.events = [
            [k for k, source in enumerate(system.source) if source == mode] for mode in range(len(system.field))
        ]
        self.n_events = max((len(events) for events in self.events), default=0)
        self.fields = {name: self.n_states + place for name, place in FIELDS.items()}
        self.n_fields = self.n_states + len(FIELDS) + 2 * self.n_events
        self.lane_numbers: dict[str, int] = {}
        self._hoisted: dict[str, str] = {}

    @cached_property
    def touches(self) -> dict[int, set[int]]:
        """Transitions out of sliding modes behind which a motion touches the surface of an event, by that event."""
        s, found = self.system, dict[int, set[int]]()
        for way, transition in enumerate(s.system.transitions):
            surface = s.surface[s.source[way]]
            if surface is None or any(g != x for g, x in zip(s.reset[way], s.x, strict=True)):
                continue
            for k, event in enumerate(s.event):
                enters = s.system.mode_names[s.source[k]] == transition.target and s.surface[s.source[k]] is None
                if enters and any(expanded(event + sign * surface) == 0 for sign in (-1, 1)):
                    found.setdefault(k, set()).add(way)
        return found

    @cached_property
    def two_sided(self) -> set[int]:
        """Events with a direction whose surface a motion may pass without a transition.

        Their condition fails, or the phase alone comes back to the surface from the other side.
        """
        s, about = self.system, {pool.form.transition for pool in self.pools if pool.form is not None}
        return {
            k
            for k, transition in enumerate(s.system.transitions)
            if (s.when[k] != 1 or at_phases(s.system, transition))
            and transition.direction and k not in about and k not in self.touches
        }  # fmt: skip

    def on(self, j: int) -> int:
        """Field that is 1 where a motion starts on the surface of event j of its mode, 2 where it touches it there."""
        return self.n_states + len(FIELDS) + j

    def side(self, j: int) -> int:
        """Field with the side of the surface of event j, where it has no direction, or may be passed without it."""
        return self.n_states + len(FIELDS) + self.n_events + j

    def side_of(self, j: int, transition: int) -> str:
        """Sign of an event function in its mode: against its direction, or as the motion began."""
        direction = self.system.system.transitions[transition].direction
        return self.load(self.side(j)) if not direction or transition in self.two_sided else repr(-float(direction))

    def load(self, name: str | int) -> str:
        """Text that reads a field of lane l."""
        return f"ld(S, {self._field(name)}*NL, l)"

    def store(self, name: str | int, value: str) -> str:
        """Statement that writes a field of lane l."""
        return f"st(S, {self._field(name)}*NL, l, {value})"

    def _field(self, name: str | int) -> int:
        return self.fields[name] if isinstance(name, str) else name

    def number(self, name: str) -> str:
        """Local variable that holds one of the numbers in ``q``, read before the loop over lanes."""
        place = self.lane_numbers.setdefault(name, len(self.lane_numbers))
        return self._hoisted.setdefault(name, f"q{place}")

    def place(self, name: str) -> str:
        """The same where it is read in place."""
        return f"q[{self.lane_numbers.setdefault(name, len(self.lane_numbers))}]"

    def reads(self) -> list[str]:
        """Statements that read the numbers asked for since last time."""
        lines = [f"{local} = q[{self.lane_numbers[name]}]" for name, local in self._hoisted.items()]
        self._hoisted = {}
        return lines

    def text_of(self, expression: sympy.Expr, names: dict[sympy.Expr, str] | None = None) -> str:
        """An expression in parameters, and in a state whose components have the given names."""
        kept = self._names
        self._names = {**kept, **(names or {})}
        try:
            return self._text(self._hoist(expression))
        finally:
            self._names = kept
