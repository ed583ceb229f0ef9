"""Normal forms of a map at its critical orbits: saddle-nodes, period doublings, Neimark-Sacker points.

docs/theory/map_orbits.md, "Normal forms", lists the formulas.

References
----------
Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, sections 4.5 to 4.7 and 5.4. Departs from it in the
map: the equations of all points of an orbit take the place of the iterate.
"""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.maps.orbit import MapOrbit
    from saltus.maps.problem import MapOrbitProblem

__all__ = ["flip_terms", "fold_terms", "map_normal_form", "null_vectors", "rotation_terms"]

_FAR = 1e-3  # distance of a multiplier from the critical one above which an orbit is not critical
_NOISE = 1e-10  # size of a coefficient, over its terms, up to which it is rounding
_WANTED = {"SN": "at 1", "PD": "at -1", "TR": "on the unit circle"}  # where the critical multiplier is


def map_normal_form(orbit: MapOrbit, kind: str) -> tuple[float, float]:
    """Return the coefficient of the normal form of a critical orbit, and the angle of its multipliers.

    Parameters
    ----------
    orbit : MapOrbit
        A saddle-node, a period doubling or a Neimark-Sacker point, located.
    kind : {"SN", "PD", "TR"}
        Type of the orbit.

    Raises
    ------
    InputError
        `kind` is another, or no multiplier is near the critical value.
    """
    if kind not in _WANTED:
        raise InputError("type", kind, f"one of {', '.join(_WANTED)}", "no normal form belongs to it")
    values = [v for v in orbit.multipliers.tolist() if abs(v) < 1e300 and (kind != "TR" or v.imag > 0.0)]

    def distance(mu: complex) -> float:
        return abs(abs(mu) - 1.0) if kind == "TR" else abs(mu - (1.0 if kind == "SN" else -1.0))

    if not values or distance(min(values, key=distance)) > _FAR:
        found = ", ".join(f"{v:.6g}" for v in orbit.multipliers.tolist())
        raise InputError("point", found, f"an orbit with a multiplier {_WANTED[kind]}, as a located {kind} has")
    mu = complex(min(values, key=distance))
    problem, u = orbit.problem(), orbit.points.ravel().copy()
    A = problem.evaluate(u)[1]
    if kind == "SN":
        q, p, twist = null_vectors(problem, A, 1.0)
        return fold_terms(problem, u, q.real, p.real) / twist.real, 0.0
    if kind == "PD":
        q, p, twist = null_vectors(problem, A, -1.0)
        return flip_terms(problem, u, A, q.real, p.real) / twist.real, math.pi
    mu /= abs(mu)
    q, p, twist = null_vectors(problem, A, mu)
    return rotation_terms(problem, u, A, mu, (q, p, twist)).real, abs(cmath.phase(mu))


def null_vectors(
    problem: MapOrbitProblem, A: NDArray[np.float64], mu: complex
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], complex]:
    """Return the right and left null vectors of A + (1 - mu) B, and the left times B times the right one.

    Here B is `MapOrbitProblem.closing`. The right vector is of unit length at the first point.
    """
    n = problem.n
    matrix = A[:, :n] + (1.0 - mu) * problem.closing
    left, _, right = np.linalg.svd(matrix)
    q, p = right[-1].conj(), left[:, -1].conj()
    head = q[: problem.states]
    turn = head[int(np.argmax(np.abs(head)))]
    q = q / np.linalg.norm(head) * abs(turn) / turn
    return q.astype(complex), p.astype(complex), complex(p @ (problem.closing @ q))


def _above_noise(value: float, *terms: float) -> float:
    return value if abs(value) > _NOISE * sum(abs(term) for term in terms) else 0.0


def _along(problem: MapOrbitProblem, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the second derivative of the equations along a direction of the points, shape (n, n)."""
    return problem.second(u, np.append(v, np.zeros(u.size - problem.n)))[:, : problem.n]


def fold_terms(
    problem: MapOrbitProblem, u: NDArray[np.float64], q: NDArray[np.float64], p: NDArray[np.float64]
) -> float:
    """Return <p, F2(q, q)> / 2, which <p, B q> makes the coefficient a."""
    bend = _along(problem, u, q)
    return _above_noise(0.5 * float(p @ bend @ q), *(0.5 * p * (np.abs(bend) @ np.abs(q))))


def flip_terms(
    problem: MapOrbitProblem,
    u: NDArray[np.float64],
    A: NDArray[np.float64],
    q: NDArray[np.float64],
    p: NDArray[np.float64],
) -> float:
    """Return <p, F3(q, q, q) + 3 F2(q, h)> / 6 with A h = -F2(q, q), which <p, B q> makes the coefficient c."""
    bend = _along(problem, u, q)
    h = -np.linalg.solve(A[:, : problem.n], bend @ q)
    terms = float(p @ problem.third(u, q, q, q)) / 6.0, 0.5 * float(p @ bend @ h)
    return _above_noise(sum(terms), *terms)


def rotation_terms(
    problem: MapOrbitProblem,
    u: NDArray[np.float64],
    A: NDArray[np.float64],
    mu: complex,
    vectors: tuple[NDArray[np.complex128], NDArray[np.complex128], complex],
) -> complex:
    """Return the coefficient d of z -> mu z (1 + d abs(z)^2); `vectors` are those of `null_vectors`."""
    q, p, twist = vectors
    n, a, b = problem.n, q.real.copy(), q.imag.copy()
    along_a, along_b = _along(problem, u, a), _along(problem, u, b)
    along: NDArray[Any] = along_a + 1j * along_b
    cubes = {key: problem.third(u, *ways) for key, ways in
             {"aaa": (a, a, a), "abb": (a, b, b), "aab": (a, a, b), "bbb": (b, b, b)}.items()}  # fmt: skip
    cubic = cubes["aaa"] + cubes["abb"] + 1j * (cubes["aab"] + cubes["bbb"])
    mean = -np.linalg.solve(A[:, :n], (along @ q.conj()).real)
    double = -np.linalg.solve(A[:, :n] + (1.0 - mu * mu) * problem.closing, along @ q)
    parts = [complex(p @ cubic), 2.0 * complex(p @ (along @ mean)), complex(p @ (along.conj() @ double))]
    found = [part / (2.0 * twist * mu) for part in parts]
    total = sum(found)
    return complex(_above_noise(total.real, *(abs(part) for part in found)), total.imag)
