"""Orbits of the other branches that meet at a special point of a map: doubled ones, those of a branch point."""

from __future__ import annotations

import numpy as np

from saltus.continuation.core.multiple import branches_at, crossing
from saltus.continuation.problems.map import MapZeroProblem
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.branching import everywhere, other_branches, parameter_scale, stepped
from saltus.errors import ConvergenceError, InputError
from saltus.maps.halves import half_of
from saltus.maps.normal_forms import null_vectors
from saltus.maps.orbit import MapOrbit
from saltus.maps.solve import sizes_of

__all__ = ["doubled_map_orbit", "other_orbits"]

_AMPLITUDES = tuple(1e-3 * 0.25**k for k in range(8))  # steps onto the doubled branch, in sizes of the states, in turn


def other_orbits(point: SpecialPoint[MapOrbit]) -> list[MapOrbit]:
    """Return an orbit of each other branch that meets the point's own one.

    Raises
    ------
    InputError
        The point is no PD or BP.
    ConvergenceError
        No orbit of the other branch was found.
    """
    if point.type == "PD":
        return doubled_orbits(point)
    if point.type != "BP":
        raise InputError("point", point.type, "of type PD or BP", "no other branch meets there")
    orbit, name = point.map_orbit, point.varied[-1]
    problem = orbit.problem(name)
    u = np.append(orbit.points.ravel(), orbit.parameters[name])
    if point.tangent is not None and (half := half_of(orbit)) is not None:
        return [half]
    return [
        MapOrbit.from_unknowns(problem, *found)
        for found in other_branches(problem, u, point.tangent, MapZeroProblem, point.scale)
    ]


def doubled_orbits(point: SpecialPoint[MapOrbit]) -> list[MapOrbit]:
    """Return the orbits of doubled period beside a period doubling: several where several multipliers are -1."""
    orbit, name = point.map_orbit, point.varied[-1]
    single = orbit.problem(name)
    u = np.append(orbit.points.ravel(), orbit.parameters[name])
    doubled = single.along(single.itinerary * 2)
    start = np.concatenate([u[:-1], u[:-1], u[-1:]])
    known = sizes_of(doubled, start) if point.scale is None else np.tile(point.scale, 2)
    J, scale = doubled.evaluate(start)[1], parameter_scale(single, u, point.scale)
    scaled = J[:, :-1] * known
    scaled /= np.abs(scaled).max(axis=1, keepdims=True)
    if crossing(np.linalg.svd(scaled, compute_uv=False)) < 2:
        return [doubled_map_orbit(point)]
    doubled.scales[0], start[-1] = scale, start[-1] / scale
    A = single.evaluate(u)[1]
    own = -np.linalg.solve(A[:, :-1], A[:, -1]) * scale
    found = branches_at(
        doubled.evaluate, start, np.append(known, 1.0), np.concatenate([own, own, [1.0]]), "doubled orbit"
    )
    return [MapOrbit.from_unknowns(doubled, v, known) for v in found]


def doubled_map_orbit(point: SpecialPoint[MapOrbit], level: int = 0) -> MapOrbit:
    """Return the orbit of doubled period beside a period doubling, the `level`-th of a cascade, counted from 0."""
    orbit, name = point.map_orbit, point.varied[-1]
    single = orbit.problem(name)
    u = np.append(orbit.points.ravel(), orbit.parameters[name])
    q = null_vectors(single, single.evaluate(u)[1], -1.0)[0].real
    scale = parameter_scale(single, u, point.scale)
    problem = single.along(single.itinerary * 2)
    problem.scales[0] = scale
    start = np.concatenate([u[:-1], u[:-1], [u[-1] / scale]])
    sizes = sizes_of(problem, start) if point.scale is None else np.tile(point.scale, 2)
    direction = np.concatenate([q, -q, [0.0]])
    direction = direction / float(np.abs(direction[:-1] / sizes).max())
    reason = ""
    for amplitude in _AMPLITUDES:
        branch = MapZeroProblem(problem, sizes, everywhere(scale))
        found = stepped(branch, start, 0.5**level * amplitude * direction, sizes)
        if isinstance(found, str):
            reason = found
            continue
        doubled = MapOrbit.from_unknowns(problem, found, sizes)
        if doubled.regular or not orbit.regular:
            return doubled
        reason = "; ".join(doubled.reasons)
    raise ConvergenceError("doubled orbit", _AMPLITUDES[-1], len(_AMPLITUDES), reason)
