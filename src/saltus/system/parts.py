"""Modes and transitions, and how the parts of a definition are checked: all expressions become texts."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, ParamSpec, Self, TypeVar

import numpy as np

from saltus import checks
from saltus.errors import DefinitionError, InputError
from saltus.system.expressions import NAME, Names, check_name, text_of
from saltus.system.mechanics import Held, lagrangian_field, mass_matrix_field
from saltus.system.once import once

__all__ = [
    "ENDS",
    "NOWHERE",
    "NO_FIELD",
    "NO_WAY",
    "TWO_FOLD",
    "Mode",
    "Transition",
    "at_phases",
    "clean_bounds",
    "clean_mode",
    "clean_phase",
    "clean_transitions",
    "interval_text",
    "kept_data",
    "listed",
    "mapping_of",
    "names_of",
    "not_negative",
    "number_of",
    "sequence_of",
    "texts_of",
]

_P = ParamSpec("_P")
_T = TypeVar("_T")

NOWHERE = "-1"  # domain of a mode in which no motion goes on
NO_WAY = "no single way on"  # mode in which a motion ends where surfaces meet
NO_FIELD = "no field there"  # mode in which a motion ends that comes into a region without a field
# What a motion does that ends where both fields are tangent to the surface.
TWO_FOLD = "it comes to a two-fold, where motions leave the surface {} = 0 to either side: there is no single way on"
# What a motion does that ends in one of these, in words: for users they are ends, and no modes.
ENDS = {
    NO_WAY: "it comes to where surfaces meet, and motions leave in several ways: there is no single way on",
    NO_FIELD: "it comes to a region without a field",
}
_NOT_NEGATIVE = re.compile(r"Min\((?:1e\+300, (.*)|(.*), 1e\+300)\) \+ 1e-300")  # as `not_negative` writes it
_DIRECTIONS = {-1: "falls", 0: "passes", 1: "rises"}


@dataclass(frozen=True)
class Mode:
    """Smooth dynamics that hold until a transition.

    Parameters
    ----------
    field : mapping of str to expression
        Time derivative of each state.
    domain : expression, optional
        Positive where the field is defined; a state outside is refused, an orbit that leaves it is not admissible.
    surface : expression, optional
        Zero on the surface along which motions of this mode slide; the field is tangent to it. A start off the surface
        is refused.
    states : sequence of str, optional
        The states that the mode has, of the system's; by default all. A transition to it from a mode that lacks one of
        them must reset this one. In results a state that a mode lacks is NaN where it is seen along a motion.

    Examples
    --------
    >>> Mode({"z": "v", "v": "-g"}, domain="z")
    Mode(z' = v, v' = -g; domain z > 0)
    """

    field: Mapping[str, Any]
    domain: Any = None
    surface: Any = None
    states: Sequence[str] | None = None
    _held: ClassVar[Held | None] = None  # of a mode that `lagrangian` has made

    @classmethod
    def lagrangian(
        cls,
        lagrangian: Any,
        velocities: Mapping[str, str],
        forces: Mapping[str, Any] | None = None,
        *,
        phase: tuple[str, Any] | None = None,
        let: Mapping[str, Any] | None = None,
        domain: Any = None,
    ) -> Self:
        """Return a mode whose field follows from a Lagrangian, kinetic minus potential energy.

        Parameters
        ----------
        lagrangian : expression
            Function of coordinates, velocities and parameters, and of the phase.
        velocities : mapping of str to str
            The velocity of each coordinate, up to 5 of them.
        forces : mapping of str to expression, optional
            Generalised forces that are not in the Lagrangian, by coordinate, such as friction and torques of motors.
        phase : (str, expression), optional
            The phase of the system, if moments of a moving support depend on it.
        let : mapping of str to expression, optional
            Names of sub-expressions of the Lagrangian, as in `HybridSystem`.
        domain : expression, optional
            As in `Mode`.

        Returns
        -------
        Mode

        Raises
        ------
        DefinitionError
            The Lagrangian has no kinetic energy in a velocity. Its mass matrix is singular everywhere. A name is that
            of a coordinate and of a velocity. A force is that of no coordinate. A name or an expression cannot be used.

        Notes
        -----
        The mass matrix M has the second derivatives of L by the velocities. With the momenta P = dL/dv and generalised
        forces Q, accelerations solve M v' = dL/dq - dP/dq v - dP/dtheta theta' + Q.

        All other names in the momenta are constants. A system in which one of them varies is refused.

        References
        ----------
        H. Goldstein, C. Poole, J. Safko, Classical Mechanics, 3rd ed., Addison-Wesley 2002, sections 1.4 and 1.5.

        Examples
        --------
        >>> Mode.lagrangian("m*l**2*v**2/2 + m*g*l*cos(q)", {"q": "v"}, {"q": "-c*v"})
        Mode(q' = v, v' = -(c*v/(l*m) + g*sin(q))/l)
        """
        rates, held = lagrangian_field(lagrangian, velocities, forces, phase, let)
        mode = cls(rates, domain)
        object.__setattr__(mode, "_held", held)
        return mode

    @classmethod
    def mass_matrix(
        cls,
        mass: Sequence[Sequence[Any]],
        forces: Mapping[str, Any] | Sequence[Any],
        velocities: Mapping[str, str],
        *,
        domain: Any = None,
    ) -> Self:
        """Return a mode whose accelerations solve M(q) q'' = f.

        Parameters
        ----------
        mass : sequence of sequences of expression
            The mass matrix M, symmetric, in the order of `velocities`.
        forces : mapping of str to expression, or sequence of expression
            The right-hand sides f, by coordinate or in the order of `velocities`.
        velocities : mapping of str to str
            The velocity of each coordinate, up to 5 of them.
        domain : expression, optional
            As in `Mode`.

        Returns
        -------
        Mode

        Raises
        ------
        DefinitionError
            The matrix is not square, not symmetric, or singular everywhere. A name is a coordinate and a velocity. A
            force is missing, or that of no coordinate. A name or an expression cannot be used.

        References
        ----------
        H. Goldstein, C. Poole, J. Safko, Classical Mechanics, 3rd ed., Addison-Wesley 2002, section 6.2.

        Examples
        --------
        >>> Mode.mass_matrix([["m + M", "m"], ["m", "m"]], {"x": "F", "y": "-k*y"}, {"x": "u", "y": "v"})
        Mode(x' = u, y' = v, u' = (F + k*y)/M, v' = (-F - k*y*(M + m)/m)/M)
        """
        return cls(mass_matrix_field(mass, forces, velocities), domain)

    def __repr__(self) -> str:
        text = repr(self.field)
        if isinstance(self.field, Mapping):
            own = {name: rate for name, rate in self.field.items() if name in (self.states or self.field)}
            text = listed(own, ", {}' = {}").removeprefix(", ")
        text += f"; domain {self.domain} > 0" if self.domain is not None else ""
        return f"Mode({text}" + (f"; surface {self.surface} = 0)" if self.surface is not None else ")")


@dataclass(frozen=True)
class Transition:
    """A jump from one mode to another when an event function vanishes.

    Parameters
    ----------
    source, target : str
        Modes.
    event : expression
        Function of state, phase and parameters whose zero is the event. It is left out where `at_phase` is given.
    direction : {-1, 0, 1}
        The event counts when its function falls through zero (-1), rises (1), or both (0).
    reset : mapping of str to expression, optional
        New values of states, in terms of the values before; states not named keep theirs.
    when : expression, optional
        Must be positive at the crossing for the transition to happen.
    name : str, optional
        By default ``source_to_target``.
    at_phase : expression of parameters, optional
        The phase, in radians, at which the event happens once a period, in place of `event` and `direction`.
    otherwise : str, optional
        The mode to which the event leads where `when` is not positive. The definition has a second transition for it,
        ``source_to_otherwise``, or the name with ``_otherwise`` behind it.

    rests : str, optional
        The mode in which a motion rests behind a sequence of impacts that accumulate. Without it such a motion ends
        with an error. The definition has a mode for settling, ``name_settling``, and a transition into it,
        ``name_last``: docs/theory/chatter.md.
    rest_time : expression of parameters, optional
        The time left to a sequence of impacts at which it is summed up; by default 1e-5 of the period of the phase, or
        1e-5. The error is of the order of its cube, in units of the time in which the motion changes. For impacts that
        lead from side to side the default is 1e-6, and the error of first order.
    sums : bool, optional
        Whether the transition sums up a sequence of impacts; set by a definition.

    Examples
    --------
    >>> Transition("off", "on", at_phase=0)
    Transition('off_to_on': off -> on at phase 0)
    >>> Transition("flight", "flight", event="z", direction=-1, reset={"v": "-e*v"}, name="impact")
    Transition('impact': flight -> flight when z falls through 0, v := -e*v)
    """

    source: str
    target: str
    event: Any = None
    direction: int = 0
    reset: Mapping[str, Any] = field(default_factory=dict)
    when: Any = None
    name: str = ""
    at_phase: Any = None
    otherwise: str | None = None
    rests: str | None = None
    rest_time: Any = None
    sums: bool = False

    def __post_init__(self) -> None:
        if all(isinstance(name, str) for name in (self.name, self.source, self.target)) and not self.name:
            object.__setattr__(self, "name", f"{self.source}_to_{self.target}")

    def __repr__(self) -> str:
        return f"Transition({self.name!r}: {self._sentence()})"

    def _sentence(self) -> str:
        passes = _DIRECTIONS.get(self.direction) if isinstance(self.direction, int) else None
        passes = passes or f"passes, in direction {self.direction!r},"
        happens = f"when {self.event} {passes} through 0" if self.at_phase is None else f"at phase {self.at_phase}"
        text = f"{self.source} {happens}" if self.target in ENDS else f"{self.source} -> {self.target} {happens}"
        if self.when is not None:
            closed = _NOT_NEGATIVE.fullmatch(str(self.when))
            text += f" and {closed[1] or closed[2]} >= 0" if closed else f" and {self.when} > 0"
            text += f", otherwise -> {self.otherwise}" if self.otherwise is not None else ""
        return text + (listed(self.reset, ", {} := {}") if isinstance(self.reset, Mapping) else f", {self.reset!r}")


def names_of(names: Sequence[str], where: str) -> tuple[str, ...]:
    """Return names, at least one, each usable in expressions."""
    if isinstance(names, str) or not isinstance(names, Iterable) or not (listed := tuple(names)):
        raise DefinitionError(where, names, "a sequence of names, at least one")
    return tuple(check_name(name, where) for name in listed)


def mapping_of(value: Any, where: str, what: str) -> Mapping[Any, Any]:
    """Return a mapping."""
    return as_definition(checks.mapping, where, value, what.removeprefix("of "))


def kept_data(value: Any, where: str) -> dict[str, Any]:
    """Return a copy of plain data that a definition keeps, as they come back from a file.

    Examples
    --------
    >>> kept_data({"probe": {"Q": (100.0, 400.0)}}, "made_of")
    {'probe': {'Q': [100.0, 400.0]}}
    """
    data = mapping_of(value, where, "of texts to plain data")
    try:
        kept: dict[str, Any] = json.loads(json.dumps(dict(data)))
    except (TypeError, ValueError) as error:
        raise DefinitionError(where, list(data), "plain data, as JSON holds them", str(error)) from None
    return kept


def sequence_of(value: Any, where: str, what: str) -> tuple[Any, ...]:
    """Return a sequence that is no text."""
    if isinstance(value, str | Mapping) or not isinstance(value, Iterable):
        raise DefinitionError(where, value, f"a sequence {what}")
    return tuple(value)


def texts_of(value: Any, where: str, what: str) -> tuple[str, ...]:
    """Return a tuple of texts."""
    return as_definition(checks.names, where, value, what)


def number_of(value: Any, name: str, *, finite: bool = True) -> float:
    """Return a number."""
    return as_definition(checks.number, name, value, "a finite number" if finite else "a number", finite=finite)


def as_definition(check: Callable[_P, _T], *arguments: _P.args, **options: _P.kwargs) -> _T:
    """Return what a check returns; what it refuses is a fault of the definition."""
    try:
        return check(*arguments, **options)
    except InputError as error:
        raise DefinitionError(*error.args) from None


def clean_phase(phase: Any, names: tuple[str, ...], let: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return name and rate of the phase, None where there is none; `let` as a definition takes it."""
    if phase is None:
        return None
    if not isinstance(phase, tuple | list) or len(phase) != 2:
        raise DefinitionError("phase", phase, "a name and a rate, as in ('theta', 'w')")
    name = check_name(phase[0], "phase")
    return name, text_of(phase[1], "phase", Names((*names, name)).with_let(let))


def clean_bounds(parameter: str, interval: Any) -> tuple[float, float]:
    """Return an interval of a parameter, the lower end first."""
    where = f"parameter_bounds of {parameter!r}"
    if not isinstance(interval, tuple | list) or len(interval) != 2:
        raise DefinitionError(where, interval, "the two ends of an interval, as in (0.0, 1.0)")
    low, high = (number_of(end, where, finite=False) for end in interval)
    if not low <= high:
        raise DefinitionError(where, interval, "an interval with the lower end first")
    return low, high


def clean_mode(
    key: str, mode: Mode, names: tuple[str, ...], part: str = "mode", *, states: Collection[str] = (), phase: Any = None
) -> Mode:
    """Return a mode whose expressions are texts that can be read; `states` are all that vary in time."""
    where = f"{part} {key!r}"
    if not isinstance(mode, Mode):
        raise DefinitionError(where, mode, "a Mode")
    if not isinstance(mode.field, Mapping):
        raise DefinitionError(where, mode.field, "a mapping of each state to its rate as the field")
    if mode._held is not None:
        mode._held.check(where, states, phase, getattr(names, "let", ()))
    field_ = {name: text_of(rate, where, names) for name, rate in mode.field.items()}
    domain, surface = (None if part is None else text_of(part, where, names) for part in (mode.domain, mode.surface))
    return Mode(field_, domain, surface, None if mode.states is None else names_of(mode.states, where))


def not_negative(value: str) -> str:
    """Return a condition that is positive where a value is 0 or positive.

    The bound keeps the terms of the value together, so that the small number is added last.
    """
    return f"Min({value}, 1e+300) + 1e-300"


def clean_transitions(transition: Transition, names: Names, phase: str | None) -> list[Transition]:
    """Return a transition, and that of its `otherwise`, with events and expressions that are texts."""
    clean = _clean_transition(transition, names, phase)
    if transition.otherwise is None:
        return [clean]
    where = f"transition {clean.name!r}"
    if clean.when is None:
        raise DefinitionError(where, transition.otherwise, "left out without a condition: pass when=")
    named = transition.name != f"{transition.source}_to_{transition.target}"
    name = f"{clean.name}_otherwise" if named else f"{clean.source}_to_{transition.otherwise}"
    when = not_negative(f"-({clean.when})")
    return [clean, replace(clean, target=transition.otherwise, when=when, name=name, rests=None, rest_time=None)]


def _at_phase(transition: Transition, names: Names, phase: str | None, where: str) -> tuple[Any, int]:
    """Return event function and direction of a transition at a phase."""
    if transition.event is not None or transition.direction != 0:
        raise DefinitionError(where, transition.event, "left out beside at_phase=, with the direction")
    if phase is None:
        raise DefinitionError(where, transition.at_phase, "left out of a system without a phase")
    at = text_of(transition.at_phase, where, names)
    return (f"sin({phase} - ({at}))" if at != "0" else f"sin({phase})"), 1


def _clean_transition(transition: Transition, names: Names, phase: str | None) -> Transition:
    """Return a transition whose expressions are texts that can be read."""
    if not isinstance(transition, Transition):
        raise DefinitionError("transitions", transition, "a sequence of Transition")
    if not isinstance(transition.name, str):
        raise DefinitionError("transition", transition.name, "text as its name")
    where = f"transition {transition.name!r}"
    if not isinstance(transition.reset, Mapping):
        raise DefinitionError(where, transition.reset, "a mapping of states to new values as its reset")
    if not isinstance(transition.direction, int | float | np.integer) or transition.direction not in _DIRECTIONS:
        raise DefinitionError(where, transition.direction, "-1 (falling), 0 (either) or 1 (rising) as its direction")
    event, direction = transition.event, int(transition.direction)
    if transition.at_phase is not None:
        event, direction = _at_phase(transition, names, phase, where)
    return Transition(
        transition.source,
        transition.target,
        text_of(event, where, names),
        direction,
        {name: text_of(value, where, names) for name, value in transition.reset.items()},
        None if transition.when is None else text_of(transition.when, where, names),
        transition.name,
        rests=transition.rests,
        rest_time=transition.rest_time,
        sums=transition.sums,
    )


def listed(values: Mapping[str, Any], form: str) -> str:
    """Return names and values in a form, one behind the other."""
    return "".join(form.format(name, value) for name, value in values.items())


def interval_text(low: float, high: float) -> str:
    """Return an interval in words."""
    if math.isinf(high):
        return f">= {low:g}"
    return f"<= {high:g}" if math.isinf(low) else f"between {low:g} and {high:g}"


def at_phases(system: Any, transition: Any) -> bool:
    """Return whether an event function knows the phase alone, and no state: the event comes again and again."""
    return system.phase is not None and _knows_no_state(system, transition.event)


@once
def _knows_no_state(system: Any, event: str) -> bool:
    return not set(system.states) & set(NAME.findall(event))
