"""Observables of a motion of a map: extremes and means of expressions, shares of pieces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError
from saltus.flow.formulas import read_formula
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.maps import Map

__all__ = ["check_map_observables", "observe_states"]

_KINDS: Mapping[str, Callable[[NDArray[np.float64]], Any]] = {"max": np.max, "min": np.min, "mean": np.mean}


def check_map_observables(system: Map, names: Sequence[str]) -> None:
    """Raise `InputError` where a name is no observable of a map's motion."""
    for name in names:
        if any(part.kind not in (*_KINDS, "fraction") for part in read_formula(system, name).parts.values()):
            allowed = "max(expression), min(expression), mean(expression) or fraction(piece)"
            raise InputError("observable", name, allowed, "a map has no phase and no transitions")


def observe_states(
    system: Map,
    parameters: Mapping[str, float],
    states: NDArray[np.float64],
    pieces: NDArray[np.int64],
    names: Sequence[str],
) -> list[float]:
    """Return the values of observables along states, in the order of their names.

    Raises
    ------
    InputError
        No observable of a map, or an unknown name in it.
    """
    check_map_observables(system, names)
    formulas, values = [read_formula(system, name) for name in names], {}
    for formula in formulas:
        for part, observable in formula.parts.items():
            if observable.kind == "fraction":
                values[part] = float(np.mean(pieces == system.piece_names.index(observable.of)))
            else:
                along = evaluate(system, observable.of, states, pieces, parameters)
                values[part] = float(_KINDS[observable.kind](along))
    return [float(formula.value(values, parameters)) for formula in formulas]
