"""Periods of a definition's expressions: 2 pi in angles, and how often its drive repeats in a turn.

How often a drive repeats is told by the harmonics of the phase in all formulas. Most systems repeat once, which values
at random states show. Where these agree a part of the turn on, harmonics decide. A formula is a Laurent polynomial in
``z = exp(i*phase)``, whose coefficients know no phase. Its harmonics are the exponents. A function of a formula repeats
as often as that. Parameters are symbols: a harmonic is absent only where its coefficient is 0 whatever their values.
What is no such polynomial repeats once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import DefinitionError, InputError
from saltus.system.angles import TURN
from saltus.system.evaluate import check_expression, evaluate, read_expression
from saltus.system.expressions import parse
from saltus.system.grammar import clipped
from saltus.system.once import once
from saltus.system.own_states import faded

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import sympy
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.definition import Definition
    from saltus.system.parts import Mode

__all__ = [
    "PRIMES", "check_angles", "check_phase_in", "drive_repeats", "evaluate_along", "fade_rates", "faded_modes",
    "is_periodic", "repeats_with_drive",
]  # fmt: skip

_SAMPLES = 24  # states at which an expression is compared with itself a turn on
_ALIKE = 1e-9  # difference a turn on, over the largest value seen, up to which an expression has the period
_WIDTHS = (0.3, 1.0, 3.0)  # sizes of the states of the samples
_SEED = 2718281828
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61)  # of what is looked at
_LARGEST = 2000  # operations of a formula from which on its harmonics are not looked for


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


@once
def drive_repeats(system: Definition) -> int:
    """Return how many times the drive of a forced system repeats while its phase turns once; 1 without a phase.

    Every field, event, condition, reset, domain and output counts.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> drive_repeats(HybridSystem.smooth({"x": "v", "v": "-x - v + sin(s)**2"}, {"w": 1.0}, phase=("s", "w")))
    2
    """
    if system.phase is None:
        return 1
    name = system.phase[0]
    texts = list(dict.fromkeys(text for text in _texts(system) if name in text))
    if not texts or not _may_repeat(system, name, texts):
        return 1
    import sympy

    names = (*system.all_states, *system.parameters)
    known = _Harmonics(sympy.Symbol(name, real=True))
    found = 0
    for text in texts:
        found = math.gcd(found, known.repeats(parse(text, names, "formula")))
        if found == 1:
            return 1
    return max(found, 1)


@once
def repeats_with_drive(system: Definition, text: str) -> bool:
    """Return whether an expression in states, parameters and outputs repeats as often as the drive does.

    The phase by itself does: it is an angle on the drive's circle.
    """
    count = drive_repeats(system)
    if count == 1 or system.phase is None or text.strip() == system.phase[0] or system.phase[0] not in text:
        return True
    import sympy

    known = _Harmonics(sympy.Symbol(system.phase[0], real=True))
    names = (*system.all_states, *system.parameters, *system.output_names)
    return known.repeats(parse(text, names, "expression")) % count == 0


def check_phase_in(system: Definition, text: str) -> None:
    """Raise `InputError` where an expression repeats less often than the drive, on whose circle the phase is."""
    if not repeats_with_drive(system, text):
        count = drive_repeats(system)
        hint = "an output of this formula makes the period of the system that of a whole turn"
        allowed = f"one that repeats {count} times in a turn of the phase, as the drive does"
        raise InputError("expression", clipped(text), allowed, hint)


def evaluate_along(
    system: Definition, text: str, states: ArrayLike, modes: ArrayLike, parameters: Mapping[str, float] | None = None
) -> NDArray[np.float64]:
    """Return what `saltus.system.evaluate.evaluate` does, of an expression that repeats as often as the drive."""
    check_expression(system, text)
    check_phase_in(system, text)
    return evaluate(system, text, states, modes, parameters)


def faded_modes(system: Definition) -> dict[str, Mode]:
    """Return the modes, in which states that they lack fade within a period of the drive, as in a turn before."""
    count = 1 if all(mode.states is None for mode in system.modes.values()) else drive_repeats(system)
    if count == 1:
        return system.modes
    lacking = {
        key: [] if mode.states is None else [name for name in system.states if name not in mode.states]
        for key, mode in system.modes.items()
    }
    return {key: faded(mode, lacking[key], system.phase, count) for key, mode in system.modes.items()}


def fade_rates(system: Definition) -> dict[str, dict[str, str]]:
    """Return the rates of states that modes lack, which a definition does not have; none where a turn is a period."""
    partial = {key: mode for key, mode in system.modes.items() if mode.states is not None}
    if not partial or drive_repeats(system) == 1:
        return {}
    return {
        key: {name: text for name, text in mode.field.items() if name not in (mode.states or ())}
        for key, mode in partial.items()
    }


def _may_repeat(system: Definition, phase: str, texts: list[str]) -> bool:
    """Return whether the values of formulas at random states agree a part of a turn on, for one part at least.

    Formulas that have no value there do not tell.
    """
    chosen = np.random.default_rng(_SEED)
    here = {name: chosen.uniform(0.3, 1.7, _SAMPLES) for name in (*system.parameters, *system.states)}
    angle, parts = chosen.uniform(0.0, TURN, _SAMPLES), list(PRIMES)
    with np.errstate(all="ignore"):
        for text in texts:
            expression = read_expression(text, _names(system))
            first = np.broadcast_to(expression.value(here | {phase: angle}), _SAMPLES)
            size = float(np.max(np.abs(first), initial=0.0, where=np.isfinite(first)))
            apart = ((part, expression.value(here | {phase: angle + TURN / part}) - first) for part in parts)
            parts = [part for part, gaps in apart if not np.any(np.abs(gaps) > _ALIKE * size)]
            if not parts:
                return False
    return True


def _texts(system: Definition) -> Iterator[str]:
    """Go through all formulas of a system."""
    for mode in system.modes.values():
        yield from (str(rate) for rate in mode.field.values())
        yield from (str(part) for part in (mode.domain, mode.surface) if part is not None)
    for transition in system.transitions:
        yield str(transition.event)
        yield from (str(value) for value in (transition.reset or {}).values())
        if transition.when is not None:
            yield str(transition.when)
    for by_mode in system.outputs.values():
        yield from (str(text) for text in by_mode.values())
    yield str(system.phase[1]) if system.phase is not None else ""


class _VariesError(Exception):
    """A formula is no polynomial in the phase's exponential."""


class _Harmonics:
    """Formulas as Laurent polynomials in the exponential of a phase."""

    def __init__(self, phase: sympy.Symbol) -> None:
        import sympy

        self.phase, self.z = phase, sympy.Symbol("z", positive=True)
        self._parts: dict[Any, tuple[sympy.Symbol, int]] = {}

    def repeats(self, expression: sympy.Expr) -> int:
        """Return how often a formula repeats in a turn; 0 for one that does not know the phase."""
        if self.phase not in expression.free_symbols:
            return 0
        if expression.count_ops() > _LARGEST:
            return 1
        try:
            return self._common(self._polynomial(expression))
        except _VariesError:
            return 1

    def _common(self, polynomial: sympy.Expr) -> int:
        """Return the greatest common divisor of the harmonics of a polynomial."""
        import sympy

        known, found = dict(self._parts.values()), 0
        for term in sympy.Add.make_args(sympy.expand(polynomial)):
            found = math.gcd(found, int(term.as_coeff_exponent(self.z)[1]))
            for symbol in term.free_symbols & known.keys():
                found = math.gcd(found, known[symbol])
        return found

    def _polynomial(self, e: sympy.Expr) -> sympy.Expr:
        import sympy

        if self.phase not in e.free_symbols:
            return e
        if isinstance(e, sympy.Add | sympy.Mul):
            return sympy.expand(e.func(*(self._polynomial(part) for part in e.args)))
        if isinstance(e, sympy.Pow) and e.exp.is_Integer:
            power = sympy.expand(self._polynomial(e.base) ** abs(int(e.exp)))
            return power if e.exp > 0 else self._part(e, self._common(power))
        if isinstance(e, sympy.sin | sympy.cos):
            return self._wave(e)
        if isinstance(e, sympy.Abs):  # an even function repeats as the square does
            return self._part(e, self._common(self._polynomial(e.args[0] ** 2)))
        if e.is_Symbol:
            raise _VariesError
        common = 0
        for part in e.args:
            if self.phase in part.free_symbols:
                if not isinstance(part, sympy.Expr):
                    raise _VariesError
                common = math.gcd(common, self._common(self._polynomial(part)))
        return self._part(e, common)

    def _wave(self, e: sympy.Expr) -> sympy.Expr:
        """Return a sine or cosine of a multiple of the phase, and of what knows no phase."""
        import sympy

        angle = sympy.expand(e.args[0])
        count, rest = angle.coeff(self.phase), sympy.expand(angle - angle.coeff(self.phase) * self.phase)
        count = sympy.nsimplify(count)
        if not count.is_Integer or self.phase in rest.free_symbols:
            return self._part(e, self._common(self._polynomial(e.args[0])))
        wave = self.z**count
        cosine = (wave + 1 / wave) / 2
        sine = (wave - 1 / wave) / (2 * sympy.I)
        if isinstance(e, sympy.sin):
            return sympy.expand(sine * sympy.cos(rest) + cosine * sympy.sin(rest))
        return sympy.expand(cosine * sympy.cos(rest) - sine * sympy.sin(rest))

    def _part(self, e: sympy.Expr, count: int) -> sympy.Symbol:
        """Return a symbol for a part that repeats so often in a turn."""
        import sympy

        if e not in self._parts:
            self._parts[e] = sympy.Dummy(), count
        return self._parts[e][0]
