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

__all__ = ["Settling", "with_rests"]

_SLOWLY = 10.0  # times that the pull towards the surface may not change by itself within the time left
_MOMENT = 1e-3  # time behind the end of a rest at which a motion goes on, over the time left to a sequence
_PLACES = 3  # places at which it is seen whether an impact changes the pull
_SPEEDS = (1e-6, 1e-3)  # rates of the event there, over an ordinary one
_ALIKE = 1e-12  # change by an impact that is rounding
_SHARE_OF_SIDES = 1e-6  # the same as the next one, for impacts that lead from side to side
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
        The resting mode is unknown; the event counts in either direction, or leads to a mode without a way back; its
        reset turns no velocity back; nothing pulls to the surface; an impact without velocity changes a state or the
        pull.
    """
    made, leaving = dict(modes), []
    listed: list[Transition] = []
    for transition in transitions:
        if transition.rests is None:
            listed.append(transition)
            continue
        settling = _settling(transition, transitions, modes, states, names, phase)
        made[f"{transition.name}_settling"] = settling.mode()
        last, *out = settling.transitions()
        listed += [last, replace(transition, rests=None, rest_time=None), *out]
        leaving.append(settling)
    for settling in leaving:
        listed = [settling.leaving(transition) for transition in listed]
    return made, tuple(listed)


def _settling(
    transition: Transition, transitions: tuple[Transition, ...], modes: Mapping[str, Mode], states: tuple[str, ...],
    names: tuple[str, ...], phase: tuple[str, str] | None,
) -> Settling:  # fmt: skip
    """Return what is made of one transition: of impacts within a mode, or of those that lead from side to side."""
    if transition.target == transition.source:
        return Settling(transition, modes, states, names, phase)
    way = (transition.target, transition.source, transition.event, -transition.direction)
    back = next((t for t in transitions if (t.source, t.target, t.event, t.direction) == way), None)
    if back is None or not transition.direction:
        wanted = "a transition from a mode to itself, with a direction, or one with another back at the same event"
        where = f"transition {transition.name!r}"
        raise DefinitionError(where, transition.rests, f"left out, or {wanted}", "as an impact is")
    return _Rocking(transition, back, modes, states, names, phase)


class Settling:
    """What is made of one transition, whose impacts stay in their mode."""

    share = _SHARE  # time left at which a sequence is summed up, over the period of the phase

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
        if transition.source not in modes or not transition.direction:
            wanted = "a transition between known modes, with a direction"
            raise DefinitionError(self.where, transition.rests, f"left out, or {wanted}", "as an impact is")
        self.x = {name: sympy.Symbol(name, real=True) for name in states}
        self.field, self.resting = (
            {name: self.read(modes[mode].field.get(name, "0")) for name in states}
            for mode in (transition.source, rests)
        )
        self.reset = {self.x[name]: self.read(text) for name, text in transition.reset.items() if name in states}
        self.domain = modes[transition.source].domain if transition.target == transition.source else None
        self.modes = modes
        self._prepare()
        self._complete_rest(set(states) - set(modes[rests].states or states))

    def read(self, text: str) -> sympy.Expr:
        """Return an expression of the definition."""
        return parse(text, self.names, self.where)

    def along(self, value: sympy.Expr, field: Mapping[str, sympy.Expr] | None = None) -> sympy.Expr:
        """Return the rate of a function along a field, by default the source's."""
        import sympy

        known = self.field if field is None else field
        rate = sum(sympy.diff(value, self.x[name]) * known[name] for name in self.states)
        if self.phase is not None:
            rate += sympy.diff(value, sympy.Symbol(self.phase[0], real=True)) * self.read(self.phase[1])
        return rate

    def after(self, value: sympy.Expr) -> sympy.Expr:
        """Return a function of the state behind the reset."""
        return value.xreplace(self.reset)

    def _prepare(self) -> None:
        """Work out the event's height, its rate and pull along the source, and what the reset does to the rate."""
        import sympy

        self.height = self.read(self.t.event)
        self.rate = self.along(self.height)
        self.pull = self.along(self.rate)
        jump = self.after(self.rate) - self.rate
        if self.rate == 0 or jump == 0:
            raise DefinitionError(self.where, self.t.reset, "a reset that turns the velocity of the event back")
        self.restitution = sympy.cancel(sympy.together(-self.after(self.rate) / self.rate))
        self.turn = {
            name: sympy.cancel(sympy.together((self.reset[symbol] - symbol) / jump))
            for name, symbol in self.x.items()
            if symbol in self.reset
        }
        self._check_pull()
        left = self.t.rest_time
        if left is None:
            left = self.share if self.phase is None else f"{self.share * 2.0 * math.pi!r}/({self.phase[1]})"
        self.left = self.read(text_of(left, self.where, self.names))

    def _complete_rest(self, lacking: set[str]) -> None:
        """Give states that the resting mode lacks a rate for the time of settling.

        The velocity of the impacts moves as the surface does, so that the event's rate stays 0; other states move as in
        flight.
        """
        import sympy

        turned = dict.fromkeys(lacking & set(self.turn), sympy.S.Zero)
        self.resting |= {name: self.field[name] for name in lacking} | turned
        drift = self.along(self.rate, self.resting)
        self.resting |= {name: -self.turn[name] * drift for name in turned}

    def _check_pull(self) -> None:
        """Raise `DefinitionError` where an impact without velocity changes state or pull: flights are not alike then.

        What an impact changes must vanish with its velocity.
        """
        import sympy

        if self.pull == 0:
            wanted = "left out, or a force that pulls to the surface"
            raise DefinitionError(self.where, self.t.rests, wanted, "the velocity of the event does not change")
        # changes of the pull, over its size; of a state, as of a sign that changes with each impact
        changes = [(self.after(self.pull) - self.pull) / self.pull, *(p * self.rate for p in self.turn.values())]
        used = [self.pull, self.rate, *changes, *self.x.values()]
        symbols = sorted(set().union(*(part.free_symbols for part in used)), key=str)
        own = next(symbol for symbol in self.reset if self.rate.has(symbol))
        for k in range(_PLACES):
            place = {symbol: 0.3 + 0.57 * ((7 * i + 3 * k) % 11) / 11 for i, symbol in enumerate(symbols)}
            start, rate, slope = place[own], self.rate.subs(place), sympy.diff(self.rate, own).subs(place)
            for change in changes:
                slower, slow = (
                    abs(float(change.subs({**place, own: start + (speed * rate - rate) / slope}))) for speed in _SPEEDS
                )
                if slower > max(0.1 * slow, _ALIKE):
                    wanted = "a reset that changes no state and no pull of a motion without velocity"
                    raise DefinitionError(self.where, dict(self.t.reset), wanted, "the flights are not alike then")

    def mode(self) -> Mode:
        """Return the mode in which the velocity of the impacts dies away as their sequence does."""
        import sympy

        slowing = self.pull * (1 - self.restitution) / 2 + self.along(self.pull) / (3 * self.pull) * self.rate
        # the resting field holds on the surface, without the velocity that dies away
        still = {self.x[name]: self.x[name] - part * self.rate for name, part in self.turn.items()}
        rates = {
            name: sympy.expand(self.resting[name].xreplace(still)) + self.turn.get(name, 0) * slowing
            for name in self.states
        }
        return Mode({name: self.text(rate) for name, rate in rates.items()}, self.domain)

    def transitions(self) -> list[Transition]:
        """Return the last impact that is followed, and the ways out of the mode for settling."""
        import sympy

        t, sign = self.t, -self.t.direction
        changing = _SLOWLY * self.left * sympy.Abs(self.after(self.along(self.pull)))
        pressing = (-sign * self.after(self.pull) - changing) * (1 - self.after(self.restitution))
        when = self.asked(self.left * pressing - 2 * sign * self.after(self.rate))
        settling, rests = f"{t.name}_settling", str(t.rests)
        last = replace(
            t, target=settling, when=self.text(when), name=f"{t.name}_last", rests=None, rest_time=None, sums=True
        )
        out = [Transition(settling, rests, self.text(self.rate), t.direction)]
        if self.pull.free_symbols & self._varying():
            out.append(Transition(settling, t.source, self.text(self.pull), -t.direction))
        return [last, *out]

    def asked(self, *conditions: sympy.Expr) -> sympy.Expr:
        """Return a condition that holds where some hold, and that of the impact itself."""
        import sympy

        return sympy.Min(*conditions, *([] if self.t.when is None else [self.read(self.t.when)]))

    def leaving(self, transition: Transition) -> Transition:
        """Return a transition; one from the resting mode gets the velocity that a motion has a moment behind it.

        Where the surface lets a motion go, height, rate and pull of the event are 0. Rounding alone would decide
        whether the next impact happens at once.
        """
        if (transition.source, transition.target) != (self.t.rests, self.t.source) or transition.reset:
            return transition
        moment = self.left * _MOMENT
        gained = self.along(self.pull) * moment**2 / 2 - self.rate
        reset = {name: self.text(self.x[name] + part * gained) for name, part in self.turn.items()}
        return replace(transition, reset=reset)

    def _varying(self) -> set[sympy.Symbol]:
        import sympy

        return {*self.x.values(), *([] if self.phase is None else [sympy.Symbol(self.phase[0], real=True)])}

    def text(self, value: sympy.Expr) -> str:
        """Return an expression as text."""
        return text_of(value, self.where, self.names)


class _Rocking(Settling):
    """What is made of a transition whose impacts lead from side to side, as those of a rocking block.

    The pulls differ on both sides, and so may the restitutions. The time left is summed up to first order.
    """

    share = _SHARE_OF_SIDES

    def __init__(
        self, transition: Transition, back: Transition, modes: Mapping[str, Mode], states: tuple[str, ...],
        names: tuple[str, ...], phase: tuple[str, str] | None,
    ) -> None:  # fmt: skip
        self.back = back
        super().__init__(transition, modes, states, names, phase)

    def _prepare(self) -> None:
        """Work out rate, pulls and restitutions of both sides."""
        import sympy

        super()._prepare()
        self.beyond = {name: self.read(self.modes[self.t.target].field.get(name, "0")) for name in self.states}
        if sympy.expand(self.along(self.height, self.beyond) - self.rate) != 0:
            wanted = "an event whose rate is the same function in both modes"
            raise DefinitionError(self.where, self.t.event, wanted, "the height of a body is one")
        returns = {self.x[name]: self.read(text) for name, text in self.back.reset.items() if name in self.x}
        there = sympy.cancel(sympy.together(self.rate.xreplace(returns) / self.rate))
        own, other = self.t.direction * self.pull, -self.t.direction * self.along(self.rate, self.beyond)
        lost = 1 + self.restitution * there  # 1 less the product of both restitutions
        self.pulls = own, other
        self.slowing = own * other * lost / (2 * (own + there * other))

    def mode(self) -> Mode:
        """See `Settling.mode`."""
        import sympy

        still = {self.x[name]: self.x[name] - part * self.rate for name, part in self.turn.items()}
        rates = {
            name: sympy.expand(self.resting[name].xreplace(still))
            - self.turn.get(name, 0) * self.t.direction * self.slowing
            for name in self.states
        }
        return Mode({name: self.text(rate) for name, rate in rates.items()})

    def transitions(self) -> list[Transition]:
        """See `Settling.transitions`."""
        t, settling = self.t, f"{self.t.name}_settling"
        time = self.left * self.slowing - t.direction * self.rate
        when = self.asked(*(self.after(part) for part in (*self.pulls, time)))
        last = replace(
            t, target=settling, when=self.text(when), name=f"{t.name}_last", rests=None, rest_time=None, sums=True
        )
        return [last, Transition(settling, str(t.rests), self.text(self.rate), -t.direction)]

    def leaving(self, transition: Transition) -> Transition:
        """See `Settling.leaving`: a motion may leave the rest to either side."""
        fields = {self.t.source: self.field, self.t.target: self.beyond}
        if transition.source != self.t.rests or transition.target not in fields or transition.reset:
            return transition
        field = fields[transition.target]
        pull = self.along(self.rate, field)
        gained = self.along(pull, field) * (self.left * _MOMENT) ** 2 / 2 - self.rate
        return replace(
            transition, reset={name: self.text(self.x[name] + part * gained) for name, part in self.turn.items()}
        )
