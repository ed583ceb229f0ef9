"""What is integrated and sought along an orbit, so that observables and their derivatives follow: read once, then used.

docs/theory/sensitivities.md derives the formulas.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from saltus.flow.formulas import Formula, Observable, read_formula
from saltus.orbits.observables.quantities import Quantity, read_quantity
from saltus.orbits.records import Observed
from saltus.scales import AMPLITUDE_ROUNDED
from saltus.system.once import once

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["Differentiated", "Plan", "Sums", "planned"]

_NODES = 5  # fewest nodes in a step, but where steps are divided; one through a wide angle has more
_UNSETTLED = "its integral does not converge: the slope of the expression grows without bound"
_NO_HARMONIC = "there is no harmonic of this order, so that its phase and the direction of its growth are unknown"
_BENT = "the expression jumps within a segment: make an event of it"
_EXTREMES = {
    1: "the extreme is attained at two places, whose derivatives differ",
    2: "the extreme is at a jump of the expression",
}


class Differentiated(NamedTuple):
    """A value, its derivatives by the parameters, and why some are NaN."""

    value: float
    slopes: NDArray[np.float64]
    note: str = ""


@dataclass(frozen=True)
class Sums:
    """What is found along an orbit."""

    system: HybridSystem
    period: Differentiated
    durations: NDArray[np.float64]  # shape (segments, 1 + parameters): the durations with their derivatives
    modes: tuple[int, ...]  # the segments' modes
    turns: int  # forcing periods in the period, 1 without a phase
    # sums, extremes, kinds, segments: as in `saltus.orbits.records.Seen`
    sums: NDArray[np.float64]
    extremes: NDArray[np.float64]
    kinds: NDArray[np.int64]
    segments: NDArray[np.int64]
    # shape (integrals,): whether what is integrated jumps within a segment; empty where nothing does
    bent: NDArray[np.bool_]
    # shape (integrals,): whether the derivatives of an integral hang on the places; empty where none does
    unsettled: NDArray[np.bool_]
    rates: Callable[[int], Differentiated]  # returns the mean rate of a transition's event function
    slides: bool  # whether the start of the orbit, where the angle is 0, is arbitrary

    @cached_property
    def averages(self) -> NDArray[np.complex128]:
        """Integrals over the period, with derivatives, shape (integrals, 1 + parameters)."""
        found = (self.sums[:, 0] + 1j * self.sums[:, 1]) / self.period.value
        found[:, 1:] -= found[:, :1] * (self.period.slopes / self.period.value)
        return np.asarray(found)

    @cached_property
    def turned(self) -> NDArray[np.complex128]:
        """Derivatives of harmonics in the direction of the harmonic and across, shape (integrals, parameters)."""
        found = 2j * self.averages
        with np.errstate(all="ignore"):
            return np.asarray(found[:, 1:] * (found[:, :1].conjugate() / np.abs(found[:, :1])))


_Part: TypeAlias = "tuple[str, int, Observable]"  # kind, index of the sum or extreme, what is observed


@dataclass(frozen=True)
class Plan:
    """Observables of an orbit, taken apart."""

    names: tuple[str, ...]  # their names
    expressions: tuple[str, ...]  # expressions that are not states
    # of each a state or, behind these, an expression; the order of the harmonic, or 0
    integrals: tuple[tuple[int, float], ...]
    extremes: tuple[tuple[int, float], ...]  # of each a state or an expression; 1 for a maximum, -1 for a minimum
    parts: dict[str, _Part]  # where what is observed is found
    formulas: dict[str, Formula]  # of each name

    @property
    def composed(self) -> tuple[str, ...]:
        """Names of those that are formulas in observables."""
        return tuple(name for name in self.names if self.formulas[name].expression is not None)

    def texts(self, system: HybridSystem) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Return the formulas with the names in them, as `HybridSystem.gradients` takes them."""
        further = () if "period" in system.parameters else ("period",)
        return tuple((self.formulas[name].text, (*self.formulas[name].symbols, *further)) for name in self.composed)

    def observed(
        self, system: HybridSystem, p: NDArray[np.float64], scale: NDArray[np.float64], advance: float, first: bool,
        nodes: int = _NODES,
    ) -> Observed:  # fmt: skip
        """Return what kernels look at.

        scale: sizes of the states; advance: the widest angle of a step, in radians; first: as in `Observed`; nodes:
        fewest places in a step.
        """
        highest = max((order for _, order in self.integrals), default=0.0)
        places, weights = _rule(nodes + math.floor(highest * advance))
        quantities = sorted({what for what, _ in self.integrals})
        address, cornered, constants = 0, False, np.empty(0)
        if self.expressions:
            code = system.gradients(self.expressions, self.texts(system))
            address, cornered, constants = code.address, code.cornered, code.extended(p)
        return Observed(
            address,
            len(self.expressions),
            p.size,
            constants,
            cornered,
            system.phase is not None,
            first,
            np.array(quantities, dtype=np.int64),
            np.array([quantities.index(what) for what, _ in self.integrals], dtype=np.int64),
            np.array([order for _, order in self.integrals]),
            np.array([what for what, _ in self.extremes], dtype=np.int64),
            np.array([sign for _, sign in self.extremes]),
            places,
            weights,
            scale,
        )

    def values(self, found: Sums, p: NDArray[np.float64], chosen: Sequence[int]) -> dict[str, Differentiated]:
        """Return the observables by name; chosen: of each column the parameter, -1 for none."""
        known = {text: _part(found, *part) for text, part in self.parts.items()}
        out: dict[str, Differentiated] = {}
        for name in self.names:
            formula = self.formulas[name]
            out[name] = known[next(iter(formula.parts))] if formula.expression is None else _NOTHING
        if self.composed:
            code = found.system.gradients(self.expressions, self.texts(found.system))
            constants, period = code.extended(p), [] if "period" in found.system.parameters else [found.period]
            for k, name in enumerate(self.composed):
                behind = [*(known[part] for part in self.formulas[name].parts), *period]
                value, by, own = code.formula(k, np.array([one.value for one in behind]), constants)
                slopes = np.append(own, 0.0)[list(chosen)]
                for share, one in zip(by.tolist(), behind, strict=True):
                    slopes = slopes + (share * one.slopes if share != 0.0 else 0.0)
                out[name] = Differentiated(value, slopes, next((one.note for one in behind if one.note), ""))
        return out


_NOTHING = Differentiated(math.nan, np.empty(0))


@once
def planned(system: HybridSystem, names: tuple[str, ...]) -> Plan:
    """Return a plan for observables.

    Parameters
    ----------
    names : tuple of str
        As `PeriodicOrbit.sensitivity` takes them.

    Raises
    ------
    InputError
        A name is no observable.
    """
    formulas = {name: _formula(system, name) for name in names}
    wanted = {part: one for formula in formulas.values() for part, one in formula.parts.items()}
    texts = sorted({one.of for one in wanted.values() if one.kind in _ALONG and one.of not in system.all_states})
    index = {text: i for i, text in enumerate((*system.all_states, *texts))}
    integrals = {(index[o.of], float(o.order or 0)) for o in wanted.values() if o.kind in _INTEGRATED}
    ordered = sorted(integrals, key=lambda one: (one[1], one[0]))
    extremes = sorted({(index[o.of], _SIGNS[o.kind]) for o in wanted.values() if o.kind in _SIGNS})
    parts: dict[str, _Part] = {}
    for text, one in wanted.items():
        at = -1
        if one.kind in _INTEGRATED:
            at = ordered.index((index[one.of], float(one.order or 0)))
        elif one.kind in _SIGNS:
            at = extremes.index((index[one.of], _SIGNS[one.kind]))
        parts[text] = (one.kind, at, one)
    return Plan(names, tuple(texts), tuple(ordered), tuple(extremes), parts, formulas)


_SIGNS = {"max": 1.0, "min": -1.0}
_INTEGRATED = ("mean", "amplitude", "phase")
_ALONG = (*_SIGNS, *_INTEGRATED)


def _formula(system: HybridSystem, name: str) -> Formula:
    """Return an observable's formula; ``max_x`` and ``min_x`` are ``max(x)`` and ``min(x)``."""
    if not isinstance(name, str) or not name.isidentifier():
        return read_formula(system, name)
    quantity: Quantity = read_quantity(system, name)
    if quantity.kind == "period":
        return Formula({name: Observable("period", "")})
    if quantity.kind == "constant":
        return Formula({name: Observable("mean", name)})
    kind, _, of = name.partition("_")
    return Formula({name: Observable(kind, of)})


def _part(found: Sums, kind: str, at: int, one: Observable) -> Differentiated:
    """Return an observable from what is found along the orbit."""
    period = found.period
    if kind in _SIGNS:
        row, note = found.extremes[at], _EXTREMES.get(int(found.kinds[at]), "")
        if not note and not np.all(np.isfinite(row)):
            note = "the extreme is where the expression grows without bound in a state, as a root on its surface"
        return Differentiated(float(row[0]), np.where(np.isfinite(row[1:]), row[1:], math.nan), note)
    if kind == "period":
        return period
    if kind == "velocity":
        return found.rates(found.system.transition_names.index(one.of))
    if kind == "fraction":
        mode = found.system.mode_names.index(one.of)
        inside = found.durations[[i for i, other in enumerate(found.modes) if other == mode]].sum(axis=0)
        share = float(inside[0]) / period.value
        return Differentiated(share, (inside[1:] - share * period.slopes) / period.value)
    value, slopes, note = _integrated(found, kind, at, one)
    if found.bent.size and found.bent[at]:
        slopes, note = np.full(period.slopes.size, math.nan), _BENT
    elif found.unsettled.size and found.unsettled[at]:
        slopes, note = np.full(period.slopes.size, math.nan), _UNSETTLED
    return Differentiated(value, slopes, note)


def _integrated(found: Sums, kind: str, at: int, one: Observable) -> Differentiated:
    """Return a mean, or the amplitude or phase of a harmonic."""
    if kind == "mean":
        row = found.averages[at].real
        return Differentiated(float(row[0]), row[1:])
    assert one.order is not None
    period, nothing = found.period, np.full(found.period.slopes.size, math.nan)
    if found.turns % one.order.denominator and kind == "amplitude":
        return Differentiated(0.0, np.zeros(period.slopes.size))
    harmonic, turned = complex(2j * found.averages[at, 0]), found.turned[at]
    size = abs(harmonic)
    if found.turns % one.order.denominator or not size > AMPLITUDE_ROUNDED * found.sums[at, 2, 0] / period.value:
        return Differentiated(size if kind == "amplitude" else math.nan, nothing, _NO_HARMONIC)
    if kind == "amplitude":
        return Differentiated(size, turned.real)
    angle = math.atan2(harmonic.imag, harmonic.real)
    if found.slides:
        return Differentiated(angle, nothing, "the start of the orbit, where the angle is 0, is arbitrary")
    return Differentiated(angle, turned.imag / size)


@lru_cache(maxsize=32)
def _rule(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places and weights of Gauss and Legendre over [0, 1]."""
    places, weights = np.polynomial.legendre.leggauss(nodes)
    return 0.5 * (places + 1.0), 0.5 * weights
