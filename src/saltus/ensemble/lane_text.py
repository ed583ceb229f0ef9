"""Text that reads and writes the fields of a lane and the numbers of a run, for all writers of steps."""

from __future__ import annotations

import re
from functools import cached_property
from typing import TYPE_CHECKING

from saltus.ensemble.labels import FIELDS
from saltus.ensemble.lane_kinds import pools_of
from saltus.system.expansion import expanded
from saltus.system.faces import FACE, kinds_of
from saltus.system.parts import at_phases
from saltus.system.writing.writer import Writer

if TYPE_CHECKING:
    import sympy

    from saltus.system.derivatives import Symbolic

__all__ = ["LaneText"]

PARAMETER = re.compile(r"\bp\[(\d+)\]")  # text that reads a parameter, or a constant of parameters
_LEAST_SIZE = 1e-300  # size of a state that never crosses 0, below which it is nothing: 1 over it is finite
PERTURBED = 1e-3  # weight of the error of a perturbation, over that of a state
OWN = {"rate", "period", "longest"}  # numbers besides parameters that a lane may have of its own


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
    own : bool, optional
        Whether each lane has parameters, and a rate of the phase, of its own. Its tolerance is then relative to the
        size of a state, and the last transition is kept.
    """

    def __init__(self, system: Symbolic, order: int, exact: dict[int, int], *, own: bool = False) -> None:
        super().__init__(system)
        self.own = own
        self.order = order
        self.has_phase = system.system.phase is not None
        self.n_states = self.n - 1 if self.has_phase else self.n
        self.pools = pools_of(system, exact)
        self.events = [
            [k for k, source in enumerate(system.source) if source == mode] for mode in range(len(system.field))
        ]
        self.n_events = max((len(events) for events in self.events), default=0)
        self.fields = {name: self.n_states + place for name, place in FIELDS.items()}
        if own:
            self.fields["taken"] = self.n_states + len(FIELDS) + 2 * self.n_events
        self.n_fields = self.n_states + len(FIELDS) + 2 * self.n_events + own
        self.own_numbers: dict[str, int] = {}
        self.lane_numbers: dict[str, int] = {}
        self._hoisted: dict[str, str] = {}

    @cached_property
    def _kinds(self) -> tuple[int, ...]:
        return kinds_of(self.system)

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

        Their condition fails, or a phase or an angle comes back to the surface from the other side, or nothing changes.
        """
        s, about = self.system, {pool.form.transition for pool in self.pools if pool.form is not None}
        return {
            k
            for k, transition in enumerate(s.system.transitions)
            if (s.when[k] != 1 or self.comes_round(k) or self.is_counted(k))
            and transition.direction and k not in about and k not in self.touches
        }  # fmt: skip

    def comes_round(self, k: int) -> bool:
        """Whether a motion that goes on comes back to the surface of a transition: it is at phases, or at angles."""
        s = self.system
        angles = {s.x[place] for place in s.system.angle_places}
        return at_phases(s.system, s.system.transitions[k]) or bool(angles & s.event[k].free_symbols)

    def is_counted(self, k: int) -> bool:
        """Whether a transition changes nothing, as a section does: a motion goes on beyond its surface."""
        s, transition = self.system, self.system.system.transitions[k]
        return transition.target == transition.source and all(g == x for g, x in zip(s.reset[k], s.x, strict=True))

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
        """Local variable that holds one of the numbers of a run, read before the statements of a lane."""
        local = f"own_{name}" if self._is_own(name) else self.place(name)[:-1].replace("[", "")
        return self._hoisted.setdefault(name, local)

    def place(self, name: str) -> str:
        """The same where it is read in place."""
        if self._is_own(name):
            return self.load(self.own_numbers.setdefault(name, self.n_fields + len(self.own_numbers)))
        return f"q[{self.lane_numbers.setdefault(name, len(self.lane_numbers))}]"

    def reads(self, body: list[str]) -> tuple[list[str], list[str], list[str]]:
        """Return statements that read what a step needs, before the loop over lanes and in it, and those of the step.

        Parameters
        ----------
        body : list of str
            Statements of a step.
        """
        named = {f"p{place}": f"p[{place}]" for place in sorted({int(i) for x in body for i in PARAMETER.findall(x)})}
        named |= {local: name for name, local in self._hoisted.items()}
        self._hoisted = {}
        each = [f"{local} = {self.place(name)}" for local, name in named.items() if self._is_own(name)]
        once = [
            f"{local} = {name if PARAMETER.fullmatch(name) else self.place(name)}"
            for local, name in named.items()
            if not self._is_own(name)
        ]
        return once, each, [PARAMETER.sub(r"p\1", line) for line in body]

    def in_lane(self, text: str) -> str:
        """Return a text done for one lane, with its own parameters in the place of those of all lanes."""
        return PARAMETER.sub(lambda found: self.place(found[0]), text) if self.own else text

    def _is_own(self, name: str) -> bool:
        return self.own and (name in OWN or PARAMETER.fullmatch(name) is not None)

    def weight(self, i: int) -> str:
        """Inverse of the size against which the error of state i is measured: its own where it never crosses 0."""
        if i < len(self.system.system.states) and self._kinds[i] == FACE:
            return f"1.0/({_LEAST_SIZE!r} + abs(x{i}))"
        if not self.own:
            return self.number(f"iscale{i}")
        n = len(self.system.system.states)
        if i < n:
            return f"1.0/({self.number('floor')} + abs(x{i}))"
        first = i // n * n
        return f"{PERTURBED!r}/(1e-300 + {' + '.join(f'abs(x{j})' for j in range(first, first + n))})"

    def event_weight(self, k: int) -> str:
        """Inverse of the size against which the error of an event function is measured, that of transition k."""
        if not self.own:
            return self.number(f"escale{k}")
        size = "abs(x0)"
        for i in range(1, len(self.system.system.states)):
            size = f"max({size}, abs(x{i}))"
        return f"1.0/({self.number('floor')} + {size})"

    def text_of(self, expression: sympy.Expr, names: dict[sympy.Expr, str] | None = None) -> str:
        """An expression in parameters, and in a state whose components have the given names."""
        kept = self._names
        self._names = {**kept, **(names or {})}
        try:
            return self._text(self._hoist(expression))
        finally:
            self._names = kept
