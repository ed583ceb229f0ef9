"""Impacts that accumulate: the rest of the sequence summed up, and a mode in which the motion then rests.

docs/theory/chatter.md derives the sum, and its error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from saltus.errors import DefinitionError, nearest
from saltus.system.expressions import parse, text_of
from saltus.system.parts import Mode, Transition

if TYPE_CHECKING:
    import sympy

__all__ = ["with_rests"]

_SHARE = 1e-5  # time left in which a sequence of impacts is summed up, over the period of the phase


def with_rests(
    modes: Mapping[str, Mode], transitions: tuple[Transition, ...], states: tuple[str, ...], names: tuple[str, ...],
    phase: tuple[str, str] | None,
) -> tuple[dict[str, Mode], tuple[Transition, ...]]:  # fmt: skip
    """Return modes and transitions in which each transition that comes to rest has its mode for settling.

    Parameters
    ----------
    modes, transitions
        Those of a definition, their expressions texts, each mode with an equation for every state.
    states, names : tuple of str
        The states; all names that expressions may use.
    phase : (str, str) or None
        Name and rate of the phase.

    Raises
    ------
    DefinitionError
        The resting mode is unknown; the event counts in either direction, or leads to another mode; its reset turns no
        velocity back.
    """
    made, listed = dict(modes), []
    for transition in transitions:
        if transition.rests is None:
            listed.append(transition)
            continue
        mode, parts = _Settling(transition, modes, states, names, phase).parts()
        made[f"{transition.name}_settling"] = mode
        listed += [parts[0], replace(transition, rests=None, rest_time=None), *parts[1:]]
    return made, tuple(listed)


class _Settling:
    """What is made of one transition."""

    def __init__(
        self, transition: Transition, modes: Mapping[str, Mode], states: tuple[str, ...], names: tuple[str, ...],
        phase: tuple[str, str] | None,
    ) -> None:  # fmt: skip
        import sympy

        self.t, self.where = transition, f"transition {transition.name!r}"
        self.states, self.names, self.phase = states, names, phase
        rests = str(transition.rests)
        if rests not in modes:
            hint = nearest(rests, modes)
            raise DefinitionError(self.where, transition.rests, f"a mode to rest in: {', '.join(modes)}", hint)
        if transition.source not in modes or transition.target != transition.source or not transition.direction:
            wanted = "a transition from a mode to itself, with a direction"
            raise DefinitionError(self.where, transition.rests, f"left out, or {wanted}", "as an impact is")
        self.x = {name: sympy.Symbol(name, real=True) for name in states}
        self.field, self.resting = (
            {name: self.read(modes[mode].field.get(name, "0")) for name in states}
            for mode in (transition.source, rests)
        )
        self.reset = {self.x[name]: self.read(text) for name, text in transition.reset.items() if name in states}
        self.domain = modes[transition.source].domain

    def read(self, text: str) -> sympy.Expr:
        return parse(text, self.names, self.where)

    def along(self, value: sympy.Expr) -> sympy.Expr:
        """Return the rate of a function along the source's field."""
        import sympy

        rate = sum(sympy.diff(value, self.x[name]) * self.field[name] for name in self.states)
        if self.phase is not None:
            rate += sympy.diff(value, sympy.Symbol(self.phase[0], real=True)) * self.read(self.phase[1])
        return rate

    def after(self, value: sympy.Expr) -> sympy.Expr:
        """Return a function of the state behind the reset."""
        return value.xreplace(self.reset)

    def parts(self) -> tuple[Mode, list[Transition]]:
        """Return the mode for settling, the last impact, and the ways out of the mode."""
        import sympy

        t, sign = self.t, -self.t.direction
        height = self.read(t.event)
        rate = self.along(height)
        pull = self.along(rate)
        back = sympy.cancel(sympy.together(-self.after(rate) / rate)) if rate != 0 else sympy.S.Zero
        jump = self.after(rate) - rate
        if rate == 0 or jump == 0:
            raise DefinitionError(self.where, t.reset, "a reset that turns the velocity of the event back")
        turn = {
            name: sympy.cancel(sympy.together((self.reset[symbol] - symbol) / jump))
            for name, symbol in self.x.items()
            if symbol in self.reset
        }
        left = t.rest_time
        if left is None:
            left = _SHARE if self.phase is None else f"{_SHARE * 2.0 * math.pi!r}/({self.phase[1]})"
        left = self.read(text_of(left, self.where, self.names))
        pressing = -sign * self.after(pull) * (1 - self.after(back))
        when = left * pressing - 2 * sign * self.after(rate)
        slowing = pull * (1 - back) / 2 + self.along(pull) / (3 * pull) * rate
        # the resting field holds on the surface, without the velocity that dies away
        still = {self.x[name]: self.x[name] - part * rate for name, part in turn.items()}
        field = {
            name: sympy.expand(self.resting[name].xreplace(still)) + turn.get(name, 0) * slowing for name in self.states
        }
        settling = f"{t.name}_settling"
        mode = Mode({name: self.text(value) for name, value in field.items()}, self.domain)
        last = replace(
            t, target=settling, when=self.text(when), name=f"{t.name}_last", rests=None, rest_time=None, sums=True
        )
        assert t.rests is not None
        return mode, [
            last,
            Transition(settling, t.rests, self.text(rate), t.direction),
            Transition(settling, t.source, self.text(pull), -t.direction),
        ]

    def text(self, value: sympy.Expr) -> str:
        return text_of(value, self.where, self.names)
