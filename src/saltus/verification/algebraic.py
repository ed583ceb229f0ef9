"""Checks of equilibria and of orbits of maps: residuals, eigenvalues and critical conditions, by SymPy's Jacobians."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.equilibria.pseudo import beside_two_fold
from saltus.scales import (
    ALL_AT_ZERO,
    EIGENVALUE_DIGITS,
    NEWTON_REFUSED,
    RESTING,
    VERIFIED_STATE,
    VERIFIED_SURFACE,
    VERIFIED_VALUE,
)
from saltus.verification.reference import MapReference, Reference
from saltus.verification.spectra import matched, multiplier_condition, spectrum
from saltus.verification.table import Row, compared, equal, unchecked

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.equilibria import Equilibrium
    from saltus.maps.orbit import MapOrbit

__all__ = ["EquilibriumCheck", "MapOrbitCheck", "sizes_of"]

_STEPS = 6  # steps of Newton's method


class EquilibriumCheck:
    """The checks of an equilibrium.

    Parameters
    ----------
    equilibrium : Equilibrium
        The equilibrium.
    sizes : ndarray, shape (states,), optional
        Sizes of the states; by default those of the equilibrium.
    """

    shrinks_at: tuple[str, ...] = ()

    def __init__(self, equilibrium: Equilibrium, sizes: NDArray[np.float64] | None = None) -> None:
        self.equilibrium = equilibrium
        self.sizes = sizes_of(equilibrium.state) if sizes is None else sizes
        self.reference = Reference(equilibrium.system, equilibrium.parameters)
        self.mode = equilibrium.system.mode_index(equilibrium.mode)
        problem = equilibrium.problem()
        self.at_two_fold = beside_two_fold(problem, np.array(equilibrium.state), self.sizes) is not None
        if self.at_two_fold:
            self.values, self.uncertain = equilibrium.eigenvalues, np.abs(equilibrium.eigenvalues)
            return
        A = self.reference.field_slope(self.mode, equilibrium.state)
        values, uncertain = spectrum([A], np.ones(len(A)), least=EIGENVALUE_DIGITS * self._rate(A))
        order = np.argsort(-values.real, kind="stable")
        self.values, self.uncertain = values[order], uncertain[order]

    def rows(self) -> list[Row]:
        """Return the claims of the equilibrium with their checks."""
        equilibrium, reference, mode, sizes = self.equilibrium, self.reference, self.mode, self.sizes
        if self.at_two_fold:
            reason = "both fields beside it are tangent to the surface: the sliding field is 0/0"
            return [unchecked("eigenvalues", complex(equilibrium.eigenvalues[0]), reason)]
        rows = _place(
            lambda x: reference.field(mode, x[:, None])[:, 0], lambda x: reference.field_slope(mode, x),
            equilibrium.state, sizes, self._conserved,
        )  # fmt: skip
        values, uncertain = self.values, self.uncertain
        rows += [
            compared(f"eigenvalue {i + 1}", complex(one), complex(other), allowed)
            for i, (one, other, allowed) in enumerate(matched(equilibrium.eigenvalues, values, uncertain))
        ]
        if np.all(np.abs(values.real) > uncertain):
            rows.append(equal("unstable directions", _unstable(equilibrium.eigenvalues), _unstable(values)))
        rows.append(_regularity(reference, equilibrium, mode, sizes))
        return rows

    @property
    def _conserved(self) -> NDArray[np.float64] | None:
        """Coefficients of the totals at which the equilibrium is isolated, shape (totals, states); None without any."""
        system = self.equilibrium.system
        return system.laws.matrix(system.parameter_vector(self.equilibrium.parameters)) if system.laws else None

    def unstable(self) -> tuple[int, bool]:
        """Return the number of unstable directions, and whether it is known."""
        return _unstable(self.values), bool(np.all(np.abs(self.values.real) > self.uncertain))

    def _rate(self, A: NDArray[np.float64]) -> float:
        """Return the largest rate in the Jacobian, here and one size away: at a multiple point it may be 0 here."""
        with np.errstate(all="ignore"):
            beside = [
                self.reference.field_slope(self.mode, self.equilibrium.state + side * self.sizes)
                for side in (-1.0, 1.0)
            ]
        return max((float(np.abs(matrix).max()) for matrix in [A, *beside] if np.all(np.isfinite(matrix))), default=0.0)

    def condition(self, kind: str, multiplicity: int = 1) -> list[Row]:
        """Return the check that the equilibrium is critical in the way that a special point says."""
        values, uncertain = self.values, self.uncertain
        top = float(np.abs(values).max())
        least = float(uncertain.max())
        real = np.sort(np.abs(values))
        pairs = np.sort(np.abs(values.real[values.imag > 1e-6 * top]))
        name = "critical eigenvalue" if multiplicity == 1 else f"critical eigenvalues, {multiplicity} of them"
        allowed = max(VERIFIED_VALUE * top if multiplicity == 1 else math.sqrt(VERIFIED_VALUE) * top, least)
        match kind:
            case "SN" | "BP" | "CP":
                return [compared(name, 0.0, float(real[multiplicity - 1]), allowed)]
            case "HB" | "GH":
                if pairs.size < multiplicity:
                    return [compared(name, 0.0, math.nan, allowed)]
                return [compared(name, 0.0, float(pairs[multiplicity - 1]), allowed)]
            case "BT":
                return [compared("two eigenvalues 0", 0.0, float(real[1]), max(math.sqrt(VERIFIED_VALUE) * top, least))]
            case "SNSN":
                return [compared("two eigenvalues 0", 0.0, float(real[1]), allowed)]
            case "ZH":
                return [compared("eigenvalue 0", 0.0, float(real[0]), allowed), *_first_pair(pairs, allowed)]
            case "HH":
                return [compared("two imaginary pairs", 0.0, float(pairs[1]) if pairs.size > 1 else math.nan, allowed)]
            case "BE":
                return [_on_surface(self.equilibrium)]
        return [unchecked(f"type {kind}", kind, "no independent condition")]


class MapOrbitCheck:
    """The checks of an orbit of a map.

    Parameters
    ----------
    orbit : MapOrbit
        The orbit.
    sizes : ndarray, shape (states,), optional
        Sizes of the states; by default those of the orbit's points.
    """

    shrinks_at: tuple[str, ...] = ()

    def __init__(self, orbit: MapOrbit, sizes: NDArray[np.float64] | None = None) -> None:
        self.orbit = orbit
        self.sizes = sizes_of(orbit.points) if sizes is None else sizes
        self.reference = MapReference(orbit.system, orbit.parameters)
        places = zip(orbit.itinerary, orbit.points, strict=True)
        steps = [self.reference.image_slope(piece, x) for piece, x in places]
        self.values, self.uncertain = spectrum(steps, sizes_of(orbit.points))

    def rows(self) -> list[Row]:
        """Return the claims of the orbit with their checks."""
        orbit, reference, sizes = self.orbit, self.reference, self.sizes
        rows = _place(
            lambda x: _gap(orbit, _image(reference, orbit, x), x),
            lambda x: _image_slope(reference, orbit, x) - np.eye(x.size),
            orbit.points[0], sizes,
        )  # fmt: skip
        gaps = [
            _gap(orbit, reference.image(piece, x[:, None])[:, 0], orbit.points[(i + 1) % orbit.period])
            for i, (piece, x) in enumerate(zip(orbit.itinerary, orbit.points, strict=True))
        ]
        rows.append(compared("image of each point", 0.0, float(np.max(np.abs(gaps) / sizes)), VERIFIED_STATE))
        values, uncertain = self.values, self.uncertain
        rows += [
            compared(f"multiplier {i + 1}", complex(one), complex(other), allowed)
            for i, (one, other, allowed) in enumerate(matched(orbit.multipliers, values, uncertain))
        ]
        if np.all(np.abs(np.abs(values) - 1.0) > uncertain):
            rows.append(equal("stable", orbit.stable, bool(np.all(np.abs(values) < 1.0))))
        holds = all(
            reference.holds(piece, x[:, None]) for piece, x in zip(orbit.itinerary, orbit.points, strict=True)
        )  # fmt: skip
        rows.append(equal("regular", orbit.regular, holds))
        return rows

    def unstable(self) -> tuple[int, bool]:
        """Return the number of unstable directions, and whether it is known."""
        sizes = np.abs(self.values)
        return int(np.sum(sizes > 1.0)), bool(np.all(np.abs(sizes - 1.0) > self.uncertain))

    def condition(self, kind: str, multiplicity: int = 1) -> list[Row]:
        """Return the check that the orbit is critical in the way that a special point says."""
        return multiplier_condition(self.values, kind, multiplicity)


def _first_pair(pairs: NDArray[np.float64], allowed: float) -> list[Row]:
    return [compared("imaginary pair", 0.0, float(pairs[0]) if pairs.size else math.nan, allowed)]


def sizes_of(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest moduli of the states; those that are nearly 0 have the size of the largest, or 1."""
    sizes = np.abs(np.atleast_2d(states)).max(axis=0)
    top = float(sizes.max()) if float(sizes.max()) > ALL_AT_ZERO else 1.0
    return np.asarray(np.where(sizes > RESTING * top, sizes, top))


def _image(reference: MapReference, orbit: MapOrbit, x: NDArray[np.float64]) -> NDArray[np.float64]:
    for piece in orbit.itinerary:
        x = reference.image(piece, x[:, None])[:, 0]
    return x


def _image_slope(reference: MapReference, orbit: MapOrbit, x: NDArray[np.float64]) -> NDArray[np.float64]:
    product = np.eye(x.size)
    for piece in orbit.itinerary:
        product = reference.image_slope(piece, x) @ product
        x = reference.image(piece, x[:, None])[:, 0]
    return product


def _gap(orbit: MapOrbit, image: NDArray[np.float64], following: NDArray[np.float64]) -> NDArray[np.float64]:
    gap = image - following
    for i, name in enumerate(orbit.system.states):
        if name in orbit.system.angles:
            gap[i] = math.remainder(gap[i], 2.0 * math.pi)
    return np.asarray(gap)


def _place(
    equations: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    slope: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    x: NDArray[np.float64],
    sizes: NDArray[np.float64],
    conserved: NDArray[np.float64] | None = None,
) -> list[Row]:
    """Return how far Newton's method moves a solution, over the sizes; with totals that are conserved, at these.

    conserved: (totals, unknowns), coefficients of the totals. As many of the equations follow from the others.
    """
    u, condition = x.astype(float), 1.0
    for _ in range(_STEPS):
        scaled, gap = slope(u) * sizes, equations(u)
        if conserved is not None:
            scaled = np.vstack([scaled, conserved * sizes])
            gap = np.append(gap, conserved @ (u - x))
        rows = np.abs(scaled).max(axis=1, keepdims=True)
        rows = np.where(rows > 0.0, rows, 1.0)
        values = np.linalg.svd(scaled / rows, compute_uv=False)
        if values[-1] <= NEWTON_REFUSED * values[0]:
            return [unchecked("place", 0.0, "the Jacobian is singular")]
        condition = float(values[0] / values[-1])
        if conserved is None:
            step = np.linalg.solve(scaled, gap) * sizes
        else:
            step = np.linalg.lstsq(scaled / rows, gap / rows[:, 0], rcond=None)[0] * sizes
        u = u - step
        if float(np.max(np.abs(step) / sizes)) < 1e-15:
            break
    allowed = VERIFIED_STATE * max(1.0, 1e-8 * condition)
    return [compared("distance from Newton's solution", 0.0, float(np.max(np.abs(u - x) / sizes)), allowed)]


def _unstable(values: NDArray[np.complex128]) -> int:
    return int(np.sum(values.real > 0.0))


def _regularity(reference: Reference, equilibrium: Equilibrium, mode: int, sizes: NDArray[np.float64]) -> Row:
    x = equilibrium.state[:, None]
    regular = bool(reference.domain(mode, x)[0])
    for k in reference.ways_out(mode):
        height = float(reference.event(k, x)[0]) * equilibrium.system.transitions[k].direction
        gradient = reference.event_slope(k, equilibrium.state)
        if height > VERIFIED_SURFACE * float(np.abs(gradient) @ sizes) and reference.allows(k, x)[0]:
            regular = False
    return equal("regular", equilibrium.regular, regular)


def _on_surface(equilibrium: Equilibrium) -> Row:
    reference = Reference(equilibrium.system, equilibrium.parameters)
    sizes, x = sizes_of(equilibrium.state), equilibrium.state
    mode = equilibrium.system.mode_index(equilibrium.mode)
    heights = []
    for k in reference.ways_out(mode):
        gradient = reference.event_slope(k, x)
        heights.append(abs(float(reference.event(k, x[:, None])[0])) / (float(np.abs(gradient) @ sizes) or 1.0))
    return compared("distance from the nearest surface", 0.0, min(heights, default=math.nan), VERIFIED_SURFACE)
