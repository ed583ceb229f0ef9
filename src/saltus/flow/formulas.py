"""Names of observables taken apart: what is observed, and formulas in observables and parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.errors import InputError, nearest
from saltus.system.evaluate import check_expression, read_expression
from saltus.system.periodicity import check_phase_in, is_periodic

if TYPE_CHECKING:
    from saltus.system.definition import Definition
    from saltus.system.evaluate import Expression

__all__ = ["Formula", "Observable", "check_observables", "check_rotating", "read_formula", "read_observable"]

_FORMS = {
    "max": "max(expression)",
    "min": "min(expression)",
    "mean": "mean(expression)",
    "amplitude": "amplitude(expression, order)",
    "phase": "phase(expression, order)",
    "fraction": "fraction(mode)",
    "velocity": "velocity(transition)",
}


class Observable(NamedTuple):
    """An observable's name, taken apart."""

    kind: str  # what is observed, as in ``amplitude``
    of: str  # the expression, mode or transition that is observed
    order: Fraction | None = None  # order of the harmonic


@dataclass(frozen=True)
class Formula:
    """A formula in observables and parameters; one observable alone is a formula, too."""

    parts: Mapping[str, Observable]  # the observables in it, by their texts
    expression: Expression | None = None  # what is made of their values; None for the value of the only one
    text: str = ""  # the expression's text, with `symbols` in the places of the observables

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names that stand for the observables in `text`."""
        return tuple(_name(i) for i in range(len(self.parts)))

    @property
    def turn(self) -> float:
        """Angle up to which a phase is defined, in radians; 0 of all other observables, and of formulas."""
        if self.expression is not None:
            return 0.0
        (only,) = self.parts.values()
        return 2.0 * math.pi / only.order.denominator if only.kind == "phase" and only.order else 0.0

    def value(self, values: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        """Return the formula's value.

        Parameters
        ----------
        values : mapping of str to float or ndarray
            Values of the observables by their texts.
        parameters : mapping of str to float or ndarray
            All parameters, and ``period`` of a periodic motion.

        Returns
        -------
        float or ndarray
            Infinite or NaN where the formula has no value.

        Raises
        ------
        InputError
            The formula has the period of a motion that has none.
        """
        if self.expression is None:
            (only,) = self.parts
            return values[only]
        if "period" in self.expression.names and "period" not in parameters:
            raise InputError("observable", "period", "of a periodic motion")
        known = {symbol: values[part] for symbol, part in zip(self.symbols, self.parts, strict=True)}
        with np.errstate(all="ignore"):
            return self.expression.value(dict(parameters) | known)


def read_formula(system: Definition, text: str) -> Formula:
    """Return a formula in observables taken apart, and checked.

    Parameters
    ----------
    text : str
        An observable, or an expression in observables, parameters and ``period``.

    Raises
    ------
    InputError
        The text is neither, or there is no such name.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> formula = read_formula(HybridSystem(("z",), {"a": 2.0}, {"free": Mode({"z": "-z"})}), "(max(z) - min(z))/a")
    >>> list(formula.parts), float(formula.value({"max(z)": 3.0, "min(z)": 1.0}, {"a": 2.0}))
    (['max(z)', 'min(z)'], 1.0)
    """
    calls = _calls(text)
    alone = isinstance(text, str) and not calls and re.search(r"(?<![\w.])period(?!\w)", text) is not None
    if not alone and (not calls or calls == [(0, len(text.strip()))]):
        return Formula({text: read_observable(system, text)})
    parts: dict[str, Observable] = {}
    stripped, formula, end = text.strip(), "", 0
    for first, last in calls:
        part = stripped[first:last]
        parts.setdefault(part, read_observable(system, part))
        formula, end = formula + stripped[end:first] + _name(list(parts).index(part)), last
    names = ("period", *system.parameter_names, *(_name(i) for i in range(len(parts))))
    try:
        return Formula(parts, read_expression(formula + stripped[end:], names), formula + stripped[end:])
    except InputError as error:
        why = str(error.args[3] or error.args[2])
        for i, part in enumerate(parts):
            why = why.replace(_name(i), part)
        raise InputError("observable", text, "a formula in observables and parameters", why) from None


def _name(index: int) -> str:
    return f"__{index}"  # a name that no definition can have


def _calls(text: object) -> list[tuple[int, int]]:
    """Where the observables of a formula begin and end; empty for what is no expression."""
    if not isinstance(text, str):
        return []
    found, end, stripped = [], 0, text.strip()
    for match in re.finditer(rf"(?<![\w.])({'|'.join(_FORMS)})\s*\(", stripped):
        if match.start() < end:
            continue
        depth, end = 1, match.end()
        while depth and end < len(stripped):
            depth += {"(": 1, ")": -1}.get(stripped[end], 0)
            end += 1
        if depth:
            return []
        found.append((match.start(), end))
    return found


def check_observables(system: Definition, names: Iterable[str]) -> None:
    """Raise `InputError` for a name that is no observable of the system, nor a formula in them."""
    for name in names:
        read_formula(system, name)


def read_observable(system: Definition, name: str) -> Observable:
    """Return an observable's name taken apart, and checked.

    Raises
    ------
    InputError
        The name is no observable, or the system has no such mode, transition, state, parameter or output.

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> read_observable(HybridSystem(("z",), {}, {"free": Mode({"z": "-z"})}), "amplitude(z, 1/2)")
    Observable(kind='amplitude', of='z', order=Fraction(1, 2))
    """
    found = re.fullmatch(r"\s*(\w+)\s*\((.*)\)\s*", name, re.DOTALL) if isinstance(name, str) else None
    if found is None or found[1] not in _FORMS or not _balanced(found[2]):
        hint = nearest(found[1], _FORMS) if found is not None and found[1] not in _FORMS else ""
        raise InputError("observable", name, f"one of {', '.join(_FORMS.values())}", hint)
    kind, of = found[1], found[2].strip()
    for role, known in (("fraction", system.mode_names), ("velocity", system.transition_names)):
        if kind == role and of not in known:
            what = "modes" if role == "fraction" else "transitions"
            allowed = f"{_FORMS[role]} of one of the {what} {', '.join(known) or '(there is none)'}"
            raise InputError("observable", name, allowed, nearest(of, known))
    if kind in ("fraction", "velocity"):
        return Observable(kind, of)
    if kind not in ("amplitude", "phase"):
        check_expression(system, of)
        check_phase_in(system, of)
        return Observable(kind, of)
    of, _, number = of.rpartition(",")
    order = re.fullmatch(r"\s*(\d+)\s*(?:/\s*(\d+)\s*)?", number)
    if order is None or int(order[1]) == 0 or (order[2] is not None and int(order[2]) == 0):
        raise InputError("observable", name, f"{_FORMS[kind]} with an order > 0, a whole number or a fraction of two")
    check_expression(system, of.strip())
    check_phase_in(system, of)
    return Observable(kind, of.strip(), Fraction(int(order[1]), int(order[2] or 1)))


def _balanced(text: str) -> bool:
    """Whether every parenthesis is closed, and none before it is opened."""
    depth = 0
    for character in text:
        depth += {"(": 1, ")": -1}.get(character, 0)
        if depth < 0:
            return False
    return depth == 0


def check_rotating(system: Definition, rotating: Sequence[str], parts: Mapping[str, Observable]) -> None:
    """Raise `InputError` where an observable of a periodic motion is not periodic: it grows with a rotating angle."""
    for angle in rotating:
        for text, part in parts.items():
            if part.of in (*system.mode_names, *system.transition_names):
                continue
            if not is_periodic(system, part.of, angle):
                hint = f"write cos({angle}), sin({angle}) or a rate"
                raise InputError("observable", text, f"of period 2 pi in {angle!r}, which rotates on this orbit", hint)
