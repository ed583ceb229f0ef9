"""Impacts that accumulate just where the surface lets go: the border between motions that rest and motions thrown off.

docs/theory/chatter.md, "Where motions stop resting", derives the condition.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import DefinitionError
from saltus.system.chatter import Settling
from saltus.system.parts import Mode, Transition

if TYPE_CHECKING:
    from collections.abc import Callable

    import sympy
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["Accumulation", "accumulation"]

NEVER = "-1"  # condition of a transition that happens in no motion: an orbit is made with it


class Accumulation:
    """What decides whether impacts on a surface accumulate before it lets go.

    Parameters
    ----------
    system : HybridSystem
        The system. Its last transition leads from an impact to a mode in which the velocity dies away before it rests.
    impact : int
        The transition of the impacts.
    rest : str
        The mode in which motions rest.
    """

    def __init__(self, system: HybridSystem, impact: int, rest: str) -> None:
        self.system, self.impact, self.rest = system, impact, rest
        self.last = len(system.transitions) - 1
        self._known = _settling(system, impact, rest)

    @cached_property
    def _functions(self) -> tuple[Callable[..., Any], Callable[..., Any], Callable[..., Any]]:
        """What `values`, `slopes` and `way` return, as functions of states and parameters."""
        import sympy

        known, symbols = self._known, [sympy.Symbol(n, real=True) for n in (*self.system.all_states, *self._parameters)]
        sign = -known.t.direction
        rate, pull = sign * known.rate, sign * known.pull
        growth = known.along(pull)
        bend = known.along(growth)
        felt = sum(part * sympy.diff(known.pull, known.x[name]) for name, part in known.turn.items())
        still = {known.x[name]: known.x[name] - part * known.rate for name, part in known.turn.items()}
        root = _root(known.restitution.xreplace(still))
        left = -pull / growth
        shape = sympy.Rational(1, 6) - bend * left / growth / 16 - (1 + 2 * root) ** 2 * felt * left / 72
        condition = 1 - rate * growth / pull**2 / ((1 - root) * (2 + root) * shape)
        values = sympy.lambdify(symbols, [condition, left, rate, growth, root], "numpy", cse=True)
        slopes = sympy.lambdify(symbols, [sympy.diff(condition, symbol) for symbol in symbols], "numpy", cse=True)
        turn = [known.turn.get(name, sympy.Integer(0)) for name in self.system.all_states]
        return values, slopes, sympy.lambdify(symbols, turn, "numpy", cse=True)

    @property
    def event(self) -> str:
        """The function that vanishes on the surface."""
        return str(self._known.t.event)

    @cached_property
    def rests(self) -> tuple[int, ...]:
        """The modes in which a motion rests, or comes to rest behind impacts that are summed up."""
        system, event = self.system, self.event
        names = {self.rest, *(t.target for t in system.transitions if t.sums and t.event == event)}
        return tuple(system.mode_index(name) for name in names)

    @property
    def _parameters(self) -> tuple[str, ...]:
        return self.system.parameter_names

    def values(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return condition, time left to the release, rate and growth of the pull, and the ratio of these times.

        x : ndarray, shape (all states,): behind an impact. p : ndarray, shape (parameters,). The condition is positive
        where the impacts accumulate before the release; it is 0 where they accumulate there.
        """
        with np.errstate(all="ignore"):
            return np.array(self._functions[0](*x.tolist(), *p.tolist()), dtype=np.float64)

    def slopes(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the condition by states and parameters, shape (all states + parameters,)."""
        with np.errstate(all="ignore"):
            return np.array(self._functions[1](*x.tolist(), *p.tolist()), dtype=np.float64)

    def way(self, x: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the direction in which the impacts turn the velocity, shape (all states,)."""
        return np.array(self._functions[2](*x.tolist(), *p.tolist()), dtype=np.float64)


def _root(restitution: sympy.Expr) -> sympy.Expr:
    """Return the ratio of the times to the release at two impacts: the root of q^3 + 2 q^2 - 2 e q - e in (0, 1)."""
    import sympy

    p, m = -sympy.Rational(4, 3) - 2 * restitution, sympy.Rational(16, 27) + restitution / 3
    angle = sympy.acos(3 * m / (2 * p) * sympy.sqrt(-3 / p)) / 3
    return 2 * sympy.sqrt(-p / 3) * sympy.cos(angle) - sympy.Rational(2, 3)


def accumulation(system: HybridSystem, impact: int) -> Accumulation | None:
    """Return what decides whether the impacts of a transition accumulate; None where no motion can rest behind them.

    Its system is the given one, with a transition by which the last impact that is followed leads to the rest at once.
    Where the definition names no mode to rest in, the system has one: the surface pushes along the direction in which
    the impacts turn the velocity, as much as keeps the motion on it.
    """
    own = system.transitions[impact]
    summed = [t.target for t in system.transitions if t.sums and (t.source, t.event) == (own.source, own.event)]
    rests = [t.target for t in system.transitions if t.source in summed and t.target != own.source]
    rest = rests[0] if rests else f"{own.name}_rest"
    try:
        return Accumulation(_caught(system, impact, rest), impact, rest)
    except DefinitionError:  # the impacts are of another kind: nothing pulls to the surface, or they change the pull
        return None


def _caught(system: HybridSystem, impact: int, rest: str) -> HybridSystem:
    """Return a system whose last transition leads from an impact to rest; it has the mode `rest` in any case."""
    own, data = system.transitions[impact], system.definition()
    known = _settling(system, impact, rest)
    still = {known.x[name]: known.x[name] - part * known.rate for name, part in known.turn.items()}
    if rest not in system.modes:
        field = {name: rate - known.turn.get(name, 0) * known.pull for name, rate in known.field.items()}
        texts = {name: known.text(rate.xreplace(still)) for name, rate in field.items()}
        data["modes"][rest] = {"field": texts, "domain": None, "surface": own.event}
        leave = known.leaving(Transition(rest, own.source, known.text(known.pull), -own.direction))
        data["transitions"].append(_plain(leave))
    # the velocity dies away before the release: twice the condition's ratio is below 1
    held = rest if rest in system.modes else None
    along = known.resting if held else {n: v - known.turn.get(n, 0) * known.pull for n, v in known.field.items()}
    slows = {name: rate.xreplace(still) + known.turn.get(name, 0) * known.pull for name, rate in along.items()}
    stops = f"{own.name}_stops"
    data["modes"][stops] = {"field": {name: known.text(rate) for name, rate in slows.items()}, "domain": None}
    data["transitions"].append(_plain(Transition(stops, rest, known.text(known.rate), own.direction)))
    last = Transition(own.source, stops, own.event, own.direction, own.reset, NEVER, f"{own.name}_rests")
    data["transitions"].append(_plain(last))
    return type(system).from_definition(data)


def _settling(system: HybridSystem, impact: int, rest: str) -> Settling:
    """Return what is known of impacts behind which motions rest in a mode, which the system need not have."""
    names = (*system.all_states, *system.parameters)
    given = replace(system.transitions[impact], rests=rest)
    return Settling(given, {rest: Mode({}), **system.modes}, system.states, names, system.phase)


def _plain(transition: Transition) -> dict[str, Any]:
    """Return a transition as plain data."""
    names = ("source", "target", "event", "direction", "reset", "when", "name")
    return {name: getattr(transition, name) for name in names}
