"""Numbers that a person may set: steps, tolerances, how long a motion settles, and where a sweep takes its points."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from saltus.errors import InputError
from saltus.explorer.kinds import kind_of
from saltus.explorer.steps import Cascade, Continue, FindOrbit, Follow, Move, Sweep, Switch

if TYPE_CHECKING:
    from saltus.explorer.steps import Step
    from saltus.system import HybridSystem, Map

__all__ = ["Numerics", "section_names", "section_of", "with_numerics"]

_MAXIMUM = ("max(", ")")  # how a section at a state's maximum is written
_Positive = Annotated[float, Field(gt=0.0)]


class Numerics(BaseModel):
    """Numbers that were set; None for those of the package.

    Attributes
    ----------
    largest, deviation : float or None
        Of the steps along a branch; see `saltus.StepControl`.
    max_points : int or None
        Most points of each direction of a branch.
    settle : float or None
        How long a motion settles before an orbit is looked for; see `saltus.find_orbit`.
    tolerance : float or None
        Relative tolerance of motions and sweeps.
    discard, keep : int or None
        Returns that a sweep drops at each value, and those that it keeps.
    section : str
        Where a sweep takes its points: the name of a transition, ``max(x)`` of a state, ``x = 0.5``, or an expression
        that vanishes there; empty for phase 0.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    largest: _Positive | None = None
    deviation: _Positive | None = None
    max_points: Annotated[int, Field(ge=1, le=100_000)] | None = None
    settle: _Positive | None = None
    tolerance: _Positive | None = None
    discard: Annotated[int, Field(ge=0, le=1_000_000)] | None = None
    keep: Annotated[int, Field(ge=1, le=100_000)] | None = None
    section: str = ""


def with_numerics(step: Step, numerics: Numerics, system: HybridSystem | Map) -> Step:
    """Return a step with the numbers that concern it.

    Raises
    ------
    InputError
        No such section.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> still = HybridSystem.smooth({"x": "v", "v": "-x"})
    >>> with_numerics(FindOrbit(), Numerics(settle=50.0, keep=3), still).text()
    'saltus.find_orbit(system, {}, x0=[], settle=50.0)'
    """
    update: dict[str, Any] = {}
    if isinstance(step, FindOrbit):
        update = _set(numerics, "settle")
    elif isinstance(step, Continue | Switch | Follow | Cascade):
        steps = _set(numerics, "largest", "deviation", "max_points")
        update = {"steps": {**steps, **step.steps}} if steps else {}
    elif isinstance(step, Move):
        update = _set(numerics, "tolerance")
    elif isinstance(step, Sweep):
        update = _set(numerics, "tolerance", "discard", "keep")
        update |= {"section": section_of(numerics.section or _usual(system), system)}
    return step.model_copy(update=update)


def _set(numerics: Numerics, *names: str) -> dict[str, Any]:
    return {name: value for name in names if (value := getattr(numerics, name)) is not None}


def section_names(system: HybridSystem | Map) -> list[str]:
    """Return sections that can be chosen by name, the usual one first.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> section_names(HybridSystem.smooth({"x": "v", "v": "-x"}))
    ['max(x)', 'max(v)', 'x = 0', 'v = 0']
    """
    maxima = [name.join(_MAXIMUM) for name in system.states]
    return [*dict.fromkeys([*system.transition_names, *maxima, *(f"{name} = 0" for name in system.states)])]


def _usual(system: HybridSystem | Map) -> str:
    return section_names(system)[0] if kind_of(system).section else ""


def section_of(told: str, system: HybridSystem | Map) -> str | tuple[str, Literal[-1, 0, 1]] | None:
    """Return a section as a sweep takes it: a transition, an expression with a direction, or None for phase 0.

    Raises
    ------
    InputError
        A maximum of what is no state, or of one whose rate differs from mode to mode.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> still = HybridSystem.smooth({"x": "v", "v": "-x"})
    >>> section_of("max(x)", still), section_of("v = 0.5", still), section_of("x - v", still)
    (('v', -1), ('v - (0.5)', 1), ('x - v', 1))
    """
    text = told.strip()
    if not text:
        return None
    if text in system.transition_names:
        return text
    if text.startswith(_MAXIMUM[0]) and text.endswith(_MAXIMUM[1]):
        return _rate(text.removeprefix(_MAXIMUM[0]).removesuffix(_MAXIMUM[1]).strip(), system), -1
    left, equals, right = text.partition("=")
    return (f"{left.strip()} - ({right.strip()})" if equals else text), 1


def _rate(state: str, system: HybridSystem | Map) -> str:
    """Return the rate of a state, which falls through zero at its maxima."""
    modes: Mapping[str, Any] = json.loads(json.dumps(system.definition()))["modes"]
    rates = {str(mode["field"].get(state)) for mode in modes.values()}
    if state not in system.states:
        raise InputError("section", f"max({state})", f"the maximum of one of {', '.join(system.states)}")
    if len(rates) > 1:
        raise InputError(
            "section", f"max({state})", "of a state whose rate is the same in all modes", "name a transition"
        )
    return rates.pop()
