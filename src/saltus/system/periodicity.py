"""Whether the expressions of a definition have the period 2 pi in the angles among its states."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import DefinitionError
from saltus.system.angles import TURN
from saltus.system.evaluate import read_expression
from saltus.system.grammar import clipped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.definition import Definition

__all__ = ["check_angles", "is_periodic"]

_SAMPLES = 24  # states at which an expression is compared with itself a turn on
_ALIKE = 1e-9  # difference a turn on, over the largest value seen, up to which an expression has the period
_WIDTHS = (0.3, 1.0, 3.0)  # sizes of the states of the samples
_SEED = 2718281828


def check_angles(system: Definition) -> None:
    """Raise `DefinitionError` where an expression has not the period 2 pi in one of the angles."""
    if not system.angles:
        return
    for key, mode in system.modes.items():
        image = system.part == "piece"
        for state, text in mode.field.items():
            _check(system, f"{system.part} {key!r}", text, turns=image and state in system.angles)
        if mode.domain is not None:
            _check(system, f"{system.part} {key!r}", mode.domain)
    for transition in system.transitions:
        where = f"transition {transition.name!r}"
        _check(system, where, transition.event)
        if transition.when is not None:
            _check(system, where, transition.when)
        for state, text in transition.reset.items():
            _check(system, where, text, turns=state in system.angles)
    for key, conditions in system.conditions.items():
        for text in conditions:
            _check(system, f"{system.part} {key!r}", text)
    for key, by_mode in system.outputs.items():
        for text in by_mode.values():
            _check(system, f"output {key!r}", text)
    if system.phase is not None:
        _check(system, "phase", system.phase[1])


def _check(system: Definition, where: str, text: str, *, turns: bool = False) -> None:
    for angle in system.angles:
        if not is_periodic(system, text, angle, turns=turns):
            wanted = f"of period 2 pi in the angle {angle!r}" + (", but for whole turns" if turns else "")
            hint = (
                f"write an angle in sin and cos: {angle} = a is the event 'sin({angle} - a)', when='cos({angle} - a)'"
            )
            raise DefinitionError(where, clipped(text), wanted, hint)


def is_periodic(system: Definition, text: str, angle: str, *, turns: bool = False) -> bool:
    """Return whether an expression is the same a turn of an angle on, at random states and parameters.

    Parameters
    ----------
    text : str
        An expression in states, phase, parameters and outputs.
    angle : str
        One of the angles.
    turns : bool, optional
        Whether it may differ by whole turns.
    """
    outputs = {name: read_expression(next(iter(texts.values())), _names(system)) for name, texts in
               system.outputs.items()}  # fmt: skip
    expression = read_expression(text, (*_names(system), *outputs))
    if angle not in expression.names and not expression.names & outputs.keys():
        return True
    here = _samples(system)
    with np.errstate(all="ignore"):
        values = [
            np.broadcast_to(expression.value(point | {n: e.value(point) for n, e in outputs.items()}), _SAMPLES * 2)
            for point in (here, *(here | {angle: here[angle] + shift * TURN} for shift in (1, -2)))
        ]
    size = np.nanmax(np.abs(values[0]), initial=0.0)
    for other in values[1:]:
        apart = other - values[0]
        if turns:
            apart = apart - TURN * np.round(apart / TURN)
            size = max(float(size), 1.0)
        known = np.isfinite(values[0]) & (np.abs(values[0]) < math.inf)
        if not np.all(np.abs(apart[known & np.isfinite(other)]) <= _ALIKE * size):
            return False
        if np.count_nonzero(known != np.isfinite(other)) > 1:
            return False
    return True


def _names(system: Definition) -> tuple[str, ...]:
    return (*system.all_states, *system.parameter_names)


def _samples(system: Definition) -> dict[str, NDArray[np.float64]]:
    """Return random states, the first half at the default parameters, the others at random ones."""
    chosen = np.random.default_rng(_SEED)
    widths = np.resize(_WIDTHS, _SAMPLES * 2)
    found: dict[str, NDArray[np.float64]] = {}
    for name in system.all_states:
        circle = name in system.angles or name not in system.states
        found[name] = chosen.uniform(-1.0, 1.0, widths.size) * (math.pi if circle else widths)
    for name, value in system.parameters.items():
        factors = np.where(np.arange(widths.size) < _SAMPLES, 1.0, chosen.uniform(0.6, 1.4, widths.size))
        found[name] = value * factors
        if value == 0.0:
            found[name] = np.where(factors == 1.0, 0.0, np.abs(factors))
    return found
