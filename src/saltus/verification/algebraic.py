"""Checks of equilibria and of cycles of maps: residuals, eigenvalues and critical conditions, by differences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.verification.reference import MapReference, Reference, slopes
from saltus.verification.spectra import matched, spectrum
from saltus.verification.table import Row, compared, equal, unchecked

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.cycles.orbit import MapOrbit
    from saltus.equilibria import Equilibrium

__all__ = ["cycle_condition", "cycle_rows", "equilibrium_condition", "equilibrium_rows", "spectrum_of"]

_STATE = 1e-8  # allowed distance of a solution from the one that Newton's method finds, over the states' sizes
_STEPS = 6  # steps of Newton's method
_CRITICAL = 1e-6  # allowed distance of a critical eigenvalue from its place, over the largest modulus
_SURFACE = 1e-7  # the same of an event function, over its variation with the states' sizes
_DEGENERATE = 1e-13  # relative size of a Jacobian's least singular value, from which on Newton's method is not asked


def equilibrium_rows(equilibrium: Equilibrium) -> list[Row]:
    """Return the claims of an equilibrium with their checks."""
    reference = Reference(equilibrium.system, equilibrium.parameters)
    mode = equilibrium.system.mode_index(equilibrium.mode)
    sizes = _sizes(equilibrium.state)
    rows = _place(lambda x: _own(reference, mode, x, sizes.size), equilibrium.state, sizes)
    values, uncertain = spectrum_of(equilibrium)
    rows += [
        compared(f"eigenvalue {i + 1}", complex(one), complex(other), allowed)
        for i, (one, other, allowed) in enumerate(matched(equilibrium.eigenvalues, values, uncertain))
    ]
    if np.all(np.abs(values.real) > uncertain):
        rows.append(equal("unstable directions", _unstable(equilibrium.eigenvalues), _unstable(values)))
    rows.append(_regularity(reference, equilibrium, mode, sizes))
    return rows


def cycle_rows(orbit: MapOrbit) -> list[Row]:
    """Return the claims of a cycle of a map with their checks."""
    reference = MapReference(orbit.system, orbit.parameters)
    sizes = _sizes(orbit.points)
    rows = _place(lambda x: _image(reference, orbit, x) - x, orbit.points[0], sizes)
    gaps = [
        _gap(orbit, reference.image(piece, x[:, None])[:, 0], orbit.points[(i + 1) % orbit.period])
        for i, (piece, x) in enumerate(zip(orbit.itinerary, orbit.points, strict=True))
    ]
    rows.append(compared("image of each point", 0.0, float(np.max(np.abs(gaps) / sizes)), _STATE))
    values, uncertain = spectrum_of(orbit)
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


def spectrum_of(solution: Any) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return eigenvalues of an equilibrium, or multipliers of a cycle, and how far each may be off."""
    if hasattr(solution, "points"):
        reference = MapReference(solution.system, solution.parameters)
        sizes = _sizes(solution.points)
        steps = [
            slopes(lambda y, piece=piece: reference.image(piece, y), x, sizes)  # type: ignore[misc]
            for piece, x in zip(solution.itinerary, solution.points, strict=True)
        ]
        return spectrum(steps, sizes)
    flow = Reference(solution.system, solution.parameters)
    sizes = _sizes(solution.state)
    mode = solution.system.mode_index(solution.mode)
    A = slopes(lambda y: _own(flow, mode, y, sizes.size), solution.state, sizes)
    return spectrum([A], sizes)


def equilibrium_condition(equilibrium: Equilibrium, kind: str, multiplicity: int = 1) -> list[Row]:
    """Return the check that an equilibrium is critical in the way that a special point says."""
    values, uncertain = spectrum_of(equilibrium)
    top = float(np.abs(values).max())
    least = float(uncertain.max())
    real = np.sort(np.abs(values))
    pairs = np.sort(np.abs(values.real[values.imag > 1e-6 * top]))
    name = "critical eigenvalue" if multiplicity == 1 else f"critical eigenvalues, {multiplicity} of them"
    allowed = max(_CRITICAL * top if multiplicity == 1 else math.sqrt(_CRITICAL) * top, least)
    match kind:
        case "SN" | "BP" | "CP":
            return [compared(name, 0.0, float(real[multiplicity - 1]), allowed)]
        case "HB" | "GH":
            if pairs.size < multiplicity:
                return [compared(name, 0.0, math.nan, allowed)]
            return [compared(name, 0.0, float(pairs[multiplicity - 1]), allowed)]
        case "BT":
            return [compared("two eigenvalues 0", 0.0, float(real[1]), math.sqrt(_CRITICAL) * top)]
        case "ZH":
            return [compared("eigenvalue 0", 0.0, float(real[0]), allowed), *_first_pair(pairs, allowed)]
        case "HH":
            return [compared("two imaginary pairs", 0.0, float(pairs[1]) if pairs.size > 1 else math.nan, allowed)]
        case "BE":
            return [_on_surface(equilibrium)]
    return [unchecked(f"type {kind}", kind, "no independent condition")]


def cycle_condition(orbit: MapOrbit, kind: str, multiplicity: int = 1) -> list[Row]:
    """Return the check that a cycle is critical in the way that a special point says."""
    goals = {"SN": 1.0, "BP": 1.0, "CP": 1.0, "PD": -1.0, "GPD": -1.0}
    values, _ = spectrum_of(orbit)
    return multiplier_condition(values, kind, goals, multiplicity)


def multiplier_condition(
    values: NDArray[np.complex128], kind: str, goals: dict[str, float], multiplicity: int = 1
) -> list[Row]:
    """Return the check that multipliers lie at the place that a type of special points has."""
    allowed = 1e-6 if multiplicity == 1 else 1e-3
    name = "critical multiplier" if multiplicity == 1 else f"critical multipliers, {multiplicity} of them"
    if kind in goals:
        distance = np.sort(np.abs(values - goals[kind]))
        found = float(distance[multiplicity - 1]) if distance.size >= multiplicity else math.nan
        return [compared(f"{name}, from {goals[kind]:g}", 0.0, found, allowed)]
    if kind in ("TR", "CH"):
        pairs = np.sort(np.abs(np.abs(values[values.imag > 0.0]) - 1.0))
        found = float(pairs[multiplicity - 1]) if pairs.size >= multiplicity else math.nan
        return [compared(f"{name}, from the unit circle", 0.0, found, allowed)]
    if kind in ("R1", "R2", "R3", "R4"):
        angle = {"R1": 0.0, "R2": math.pi, "R3": 2.0 * math.pi / 3.0, "R4": 0.5 * math.pi}[kind]
        place = complex(math.cos(angle), math.sin(angle))
        loose = 1e-3 if kind in ("R1", "R2") else 1e-5  # a double multiplier has half the digits
        return [compared(f"{name}, from that of {kind}", 0.0, float(np.abs(values - place).min()), loose)]
    return [unchecked(f"type {kind}", kind, "no independent condition")]


def _first_pair(pairs: NDArray[np.float64], allowed: float) -> list[Row]:
    return [compared("imaginary pair", 0.0, float(pairs[0]) if pairs.size else math.nan, allowed)]


def _sizes(states: NDArray[np.float64]) -> NDArray[np.float64]:
    sizes = np.abs(np.atleast_2d(states)).max(axis=0)
    return np.asarray(np.where(sizes > 0.0, sizes, float(sizes.max()) or 1.0))


def _own(reference: Reference, mode: int, x: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Return the field without the phase; an equilibrium's system has none."""
    return reference.field(mode, x)[:n]


def _image(reference: MapReference, orbit: MapOrbit, x: NDArray[np.float64]) -> NDArray[np.float64]:
    for piece in orbit.itinerary:
        x = reference.image(piece, x)
    return x


def _gap(orbit: MapOrbit, image: NDArray[np.float64], following: NDArray[np.float64]) -> NDArray[np.float64]:
    gap = image - following
    for i, name in enumerate(orbit.system.states):
        if name in orbit.system.angles:
            gap[i] = math.remainder(gap[i], 2.0 * math.pi)
    return np.asarray(gap)


def _place(
    equations: Callable[[NDArray[np.float64]], NDArray[np.float64]], x: NDArray[np.float64], sizes: NDArray[np.float64]
) -> list[Row]:
    """Return how far Newton's method, with derivatives by differences, moves a solution; whole turns do not count."""
    turns = 2.0 * math.pi * np.round(equations(x[:, None])[:, 0] / (2.0 * math.pi))
    far = np.abs(equations(x[:, None])[:, 0]) > 1.0  # only a map's angles gain whole turns
    u = x.astype(float)
    for _ in range(_STEPS):
        A = slopes(equations, u, sizes)
        values = np.linalg.svd(A * sizes, compute_uv=False)
        if values[-1] <= _DEGENERATE * values[0]:
            return [unchecked("place", 0.0, "the Jacobian is singular")]
        step = np.linalg.solve(A, equations(u[:, None])[:, 0] - np.where(far, turns, 0.0))
        u = u - step
        if float(np.max(np.abs(step) / sizes)) < 1e-15:
            break
    allowed = _STATE * max(1.0, 1e-8 * float(values[0] / values[-1]))
    return [compared("distance from Newton's solution", 0.0, float(np.max(np.abs(u - x) / sizes)), allowed)]


def _unstable(values: NDArray[np.complex128]) -> int:
    return int(np.sum(values.real > 0.0))


def _regularity(reference: Reference, equilibrium: Equilibrium, mode: int, sizes: NDArray[np.float64]) -> Row:
    x = equilibrium.state[:, None]
    regular = bool(reference.domain(mode, x)[0])
    for k in reference.ways_out(mode):
        height = float(reference.event(k, x)[0]) * equilibrium.system.transitions[k].direction
        gradient = slopes(lambda y, k=k: reference.event(k, y), equilibrium.state, sizes)[0]  # type: ignore[misc]
        if height > _SURFACE * float(np.abs(gradient) @ sizes) and reference.allows(k, x)[0]:
            regular = False
    return equal("regular", equilibrium.regular, regular)


def _on_surface(equilibrium: Equilibrium) -> Row:
    reference = Reference(equilibrium.system, equilibrium.parameters)
    sizes, x = _sizes(equilibrium.state), equilibrium.state
    mode = equilibrium.system.mode_index(equilibrium.mode)
    heights = []
    for k in reference.ways_out(mode):
        gradient = slopes(lambda y, k=k: reference.event(k, y), x, sizes)[0]  # type: ignore[misc]
        heights.append(abs(float(reference.event(k, x[:, None])[0])) / (float(np.abs(gradient) @ sizes) or 1.0))
    return compared("distance from the nearest surface", 0.0, min(heights, default=math.nan), _SURFACE)
