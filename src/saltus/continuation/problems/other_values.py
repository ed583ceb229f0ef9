"""Values beside the critical ones of a locus: where another one becomes critical, and steps that pass over this.

docs/theory/loci.md, "Other values", explains the monitor functions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.value_tests import Tested, border_tests, bounded, circle_tests
from saltus.continuation.core.within_step import searched
from saltus.continuation.core.zero_problem import Event, Point, hermite
from saltus.orbits.stability.floquet import height
from saltus.scales import (
    CROWDED,
    DOUBLE_AT_START,
    DOUBLE_SHADOW,
    GROWTH_CRITICAL,
    GROWTH_TOUCHED,
    PAIRED_ON_LOCUS,
    SAME_POINT,
    TWIN,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    _Spectrum = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

__all__ = [
    "GOALS",
    "KIND",
    "SEVERAL",
    "OtherValues",
    "critical_pair",
    "eigenvalues_beside",
    "multipliers_beside",
    "without_critical",
    "without_nearest",
]

SEVERAL = "events: other values become critical at more than one place within the step"
GOALS = {"SN": 1.0, "PD": -1.0, "BP": 1.0}  # the critical multiplier on a locus
# types of the points at which another multiplier becomes critical on a locus; other test functions tell of the rest
_TYPES = {
    "SN": {"fold": "SNSN", "pair": "FNS"},
    "PD": {"flip": "PDPD", "pair": "PDNS"},
    "BP": {"fold": "SN", "flip": "PD", "pair": "TR"},
    "TR": {"fold": "FNS", "flip": "PDNS", "pair": "NSNS"},
    "BC": {"fold": "SN", "flip": "PD", "pair": "TR"},
    "CH": {"fold": "SN", "flip": "PD", "pair": "TR"},
    "value": {"pair": "TR"},
}
# types of points at which a further value is as critical as the one of the locus, and the points at which both are one
_DOUBLE = {"SNSN": ("R1", "BT"), "PDPD": ("R2",)}
# Points whose function has a factor that vanishes at another point, and that point. Coefficients have a pole there, and
# are followed times a function that vanishes. At a cusp all parameters' components of the tangent vanish.
_FACTORS = {"GPD": "FF", "CH": "FNS", "TP": "CP"}
KIND = "other"  # kind of the monitor functions, one for each place in the order of growth


def eigenvalues_beside(types: Mapping[str, str]) -> OtherValues:
    """Return the test functions of eigenvalues, which are critical on the imaginary axis; see `OtherValues`."""
    return OtherValues(lambda values: values.real, border_tests, types, rounding=1e-12)


def multipliers_beside(kind: str) -> OtherValues:
    """Return the test functions of multipliers along a locus of a type; they are critical on the unit circle."""
    return OtherValues(_heights, circle_tests, _TYPES.get(kind, {}), rounding=1e-9)


def without_critical(kind: str, values: NDArray[np.complex128], cosine: float) -> NDArray[np.complex128]:
    """Return the multipliers without the critical ones of a locus of a type, none where all depend on its side.

    cosine: that of the critical pair's angle on a TR locus.
    """
    if kind not in _TYPES:
        return values[:0]
    if kind == "TR":
        known = bounded(values)
        away = np.abs(np.abs(known) - 1.0) + np.abs(known.real - cosine)
        return np.delete(values, critical_pair(known, away, lambda one, other: abs(one * other - 1.0)))
    return without_nearest(values, GOALS[kind]) if kind in GOALS else values


def without_nearest(values: NDArray[np.complex128], goal: float) -> NDArray[np.complex128]:
    """Return the values without the critical one, which is at a goal.

    One that is as near but for a factor is its twin, as all along a locus of an area-preserving map: it is at the goal,
    too, since a double value of a matrix is known to the root of rounding only.
    """
    away = np.abs(values - goal)
    nearest = int(np.argmin(away))
    return np.delete(np.where(away <= TWIN * away[nearest], goal, values), nearest)


def critical_pair(
    values: NDArray[np.complex128], away: NDArray[np.float64], apart: Callable[[complex, complex], float]
) -> list[int]:
    """Return the places of the critical pair of values: two conjugates, or two real ones.

    Parameters
    ----------
    values : ndarray of complex
        The values.
    away : ndarray
        Distance of each from its place as one of the critical pair.
    apart : callable
        Distance of two real values from those that a critical pair becomes beyond the locus' end.
    """
    known: list[complex] = values.tolist()
    signs = np.sign(np.where(np.abs(values.imag) > PAIRED_ON_LOCUS * np.abs(values), values.imag, 0.0)).tolist()
    for i in np.argsort(away, kind="stable").tolist():
        mates = [j for j, sign in enumerate(signs) if j != i and sign == -signs[i]]
        if mates and signs[i]:
            return [i, min(mates, key=lambda j: abs(known[j] - known[i].conjugate()))]
        if mates:
            return [i, min(mates, key=lambda j: apart(known[i], known[j]))]
    raise AssertionError("two values of a real matrix are conjugates, or real")


def _heights(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.array([height(value) for value in values.tolist()])


@dataclass
class OtherValues:
    """The values that are not critical along a locus, in the order of their growth.

    The k-th largest growth is a monitor function. It is continuous, and vanishes wherever the number of unstable values
    passes k: several values that become critical at once hide none of them.

    Parameters
    ----------
    growth : callable
        Growth of each value, 0 where it is critical; values are in units.
    tests : callable
        `circle_tests` or `border_tests`.
    types : mapping of str to str
        Type of the point at which a value becomes critical: ``"fold"`` a real one at 0 or 1, ``"flip"`` one at -1,
        ``"pair"`` a complex pair. Another monitor function of the locus tells of those that are left out.
    rounding : float
        Growth up to which it is rounding.
    """

    growth: Callable[[NDArray[np.complex128]], NDArray[np.float64]]
    tests: Callable[[list[complex]], Tested]
    types: Mapping[str, str]
    rounding: float
    unit: float | None = None  # of eigenvalues: by default the largest modulus at the first point
    neutral: int | None = field(default=None, init=False)  # values that are critical all along the locus
    crossing: bool = field(default=False, init=False)  # whether a point of one of the types may lie in the last step
    doubled: bool = field(default=False, init=False)  # whether the locus starts at a double value
    # whether the signs at the last step's ends do not tell all that becomes critical within
    _untold: bool = field(default=False, init=False)

    def measured(
        self,
        values: NDArray[np.complex128],
        before: Point | None,
        largest: float = 1.0,
        known: Mapping[Monitor, float] | None = None,
    ) -> dict[Monitor, float]:
        """Return the monitor functions at a point, and give those at the point before the same names.

        largest: modulus of the largest value, the critical ones among them. known: the locus' other monitor functions.
        """
        self.unit = self.unit or largest or 1.0
        close = int(np.sum(np.abs(self._growth(values)) < self.rounding))
        self.neutral = close if self.neutral is None else min(self.neutral, close)
        found, told = self.named(values), known or {}
        if before is None:
            self.doubled = any(abs(told.get(name, np.nan)) < DOUBLE_AT_START for name in self._doubles())
        if before is None or before.examined.data is None:
            return found
        old = before.examined.data.others
        if sum(name.kind == KIND for name in before.examined.monitors) != len(found):
            ranked = {name: np.nan if self.is_critical(g) else g for name, g in self.named(old).items()}
            before.examined = replace(before.examined, monitors={**before.examined.monitors, **ranked})
        (pairs, *first), (others, *second) = self._counts(old), self._counts(values)
        moves = [(b - a) * size for a, b, size in zip(first, second, (2, 1, 1), strict=True)]
        total = sum(map(abs, moves)) if pairs == others else 0
        band = GROWTH_TOUCHED * self.rounding
        start = before.examined.monitors
        touched = any(abs(growth) < band <= abs(start[name]) for name, growth in found.items())
        further = dict(zip(("pair", "fold", "flip"), map(abs, moves), strict=True))
        missed = False
        for what, kind in self.types.items():
            if any(start.get(name, np.nan) * told.get(name, np.nan) < 0.0 for name in self._doubles(kind)):
                further[what] -= 1
                missed = further[what] != 0
        self.crossing = pairs != others or 0.0 in found.values() or any(further[what] for what in self.types)
        self._untold = touched or missed or total != abs(sum(moves))
        return found

    def named(self, values: NDArray[np.complex128]) -> dict[Monitor, float]:
        """Return the monitor functions of some values."""
        growth = self._growth(values)
        return {Monitor(KIND, k): float(growth[i]) for k, i in enumerate(self._order(growth))}

    def _growth(self, values: NDArray[np.complex128]) -> NDArray[np.float64]:
        return self.growth(self._scaled(values))

    def _scaled(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return eigenvalues in units, multipliers without the size of infinite ones."""
        return bounded(values) if self.tests is circle_tests else values / (self.unit or 1.0)

    def is_critical(self, growth: float) -> bool:
        """Return whether a value with a growth is critical at a located point."""
        return abs(growth) < GROWTH_CRITICAL * self.rounding

    def tells(self, name: Monitor) -> bool:
        """Return whether a monitor function is one of these."""
        return name.kind == KIND

    def _order(self, growth: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the places of the values by their growth, without those that are critical all along."""
        kept = np.sort(np.argsort(np.abs(growth), kind="stable")[self.neutral or 0 :])
        return kept[np.argsort(-growth[kept], kind="stable")]

    def _counts(self, values: NDArray[np.complex128]) -> tuple[int, int, int, int]:
        """Return how many complex pairs there are, and how many pairs, positive and negative values grow."""
        paired = pairs = positive = negative = 0
        growth, known = self._growth(values), values.tolist()
        for i in self._order(growth).tolist():
            value, grows = known[i], bool(growth[i] > 0.0)
            if self._turns(value):
                paired, pairs = paired + 1, pairs + grows
            else:
                positive, negative = positive + (grows and value.real > 0.0), negative + (grows and value.real <= 0.0)
        return paired // 2, pairs // 2, positive, negative

    def leading(self, names: list[Monitor]) -> list[Monitor]:
        """Return the names without those of values of which other monitor functions tell."""
        return names if self.crossing else [name for name in names if name.kind != KIND]

    def typed(self, events: list[Event]) -> list[Event]:
        """Return the events by the types of their points: each once, whatever becomes critical there."""
        found: list[Event] = []
        for event in events:
            if event.name.kind != KIND:
                found.append(event)
                continue
            values = event.point.examined.data.others
            value = complex(values[self._order(self._growth(values))[event.name.segment]])
            kind = self.types.get(self._what(value))
            if kind is not None and not self._known(kind, event, found):
                found.append(replace(event, name=Monitor(kind)))
        return [event for event in found if not (self._by_its_factor(event, found) or self._is_double(event, found))]

    def _doubles(self, *kinds: str) -> list[Monitor]:
        """Return the functions that vanish at double values, of some types of points or of all that are told here."""
        return [Monitor(name) for kind in kinds or self.types.values() for name in _DOUBLE.get(kind, ())]

    def _is_double(self, event: Event, events: list[Event]) -> bool:
        """Return whether a value is as critical as that of the locus since both become one double value there."""
        names = self._doubles(event.name.kind)
        places = [e.point.arc for e in events if e.name in names] + [0.0] * (self.doubled and bool(names))
        return any(abs(place - event.point.arc) < DOUBLE_SHADOW for place in places)

    @staticmethod
    def _by_its_factor(event: Event, events: list[Event]) -> bool:
        """Return whether a function vanishes since its factor does, as a coefficient that has no pole there."""
        factor = _FACTORS.get(event.name.kind)
        return any(e.name.kind == factor and abs(e.point.arc - event.point.arc) < SAME_POINT for e in events)

    def _turns(self, value: complex) -> bool:
        """Return whether a value is one of a complex pair."""
        return abs(value.imag) > max(PAIRED_ON_LOCUS * abs(value), GROWTH_TOUCHED * self.rounding * (self.unit or 1.0))

    def _what(self, value: complex) -> str:
        if self._turns(value):
            return "pair"
        return "flip" if self.tests is circle_tests and value.real < 0.0 else "fold"

    def _known(self, kind: str, event: Event, found: list[Event]) -> bool:
        """Return whether the value of an event is critical at another one of its type as well."""
        for other in found:
            if other.name == Monitor(kind):
                there = self.named(other.point.examined.data.others)
                if self.is_critical(there.get(event.name, np.inf)):
                    return True
        return False

    def overlooked(self, a: Point, b: Point, others: NDArray[np.complex128], spectrum: _Spectrum) -> bool:
        """Return whether values may become critical at several places of the step measured last, or come back within.

        Parameters
        ----------
        a, b : Point
            Ends of the step; `a` is examined.
        others : ndarray of complex
            The values at `b`.
        spectrum : callable
            The values at unknowns near the locus, in any order.
        """
        length = b.arc - a.arc
        if length <= CROWDED or others.size == 0:
            return False
        if self._untold:
            return True

        def spectra(shares: NDArray[np.float64]) -> NDArray[np.complex128]:
            return np.array([self._scaled(spectrum(hermite(a, b, length, share))) for share in shares.tolist()])

        back, before = a.examined.data.behind or (length, None)
        rows = [self._scaled(row) for row in (before, a.examined.data.others, others) if row is not None]
        return searched(spectra, rows, (back, length), self.tests) is not False
