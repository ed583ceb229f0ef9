"""Normal forms of the Poincare map at saddle-nodes, period doublings and torus bifurcations."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError
from saltus.orbits.stability.critical import closing, scaling
from saltus.scales import AT_CRITICAL, COEFFICIENT_ROUNDED
from saltus.system.angles import TURN

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.orbits.orbit import PeriodicOrbit
    from saltus.orbits.problem import OrbitProblem

__all__ = ["NORMAL_FORMS", "NormalForm", "flip_coefficient", "fold_coefficient", "normal_form", "torus_coefficient"]

NORMAL_FORMS = ("SN", "PD", "TR")  # types of special points that have a normal form here
_STEP = 2e-3  # length of the arcs along which third derivatives are taken, in sizes of the orbit


@dataclass(frozen=True)
class NormalForm:
    """Normal form of the Poincare map at a critical orbit, on its centre manifold."""

    type: str  # ``SN``: x -> x + a x^2; ``PD``: x -> -x + c x^3; ``TR``: z -> exp(i angle) z (1 + d abs(z)^2)
    # a, c, or the real part of d. The critical eigenvector has unit length at the first segment's start, in the states
    # and the phase, of which a period of the drive has 2 pi. Another length keeps the signs of c and d; a changes sign
    # with the eigenvector.
    coefficient: float
    angle: float  # angle of the critical multipliers, in radians
    # how many multipliers are critical at once, or pairs. With more than one, coefficient and angle are NaN.
    count: int = 1

    @property
    def criticality(self) -> str:
        """What is born: for PD and TR ``supercritical`` (attracting within the centre manifold) or ``subcritical``.

        A saddle-node is ``nondegenerate``. Where the coefficient vanishes exactly, ``degenerate``. Where several
        multipliers are critical at once, ``undetermined``.
        """
        if self.count > 1:
            return "undetermined"
        if self.coefficient == 0.0:
            return "degenerate"
        if self.type == "SN":
            return "nondegenerate"
        attracting = self.coefficient > 0.0 if self.type == "PD" else self.coefficient < 0.0
        return "supercritical" if attracting else "subcritical"

    def __repr__(self) -> str:
        if self.count > 1:
            return f"NormalForm {self.type}: {self.criticality}, {self.count} are critical at once"
        angle = f", angle {self.angle:.6g} rad" if self.type == "TR" else ""
        return f"NormalForm {self.type}: {self.criticality}, coefficient {self.coefficient:.6g}{angle}"


def normal_form(orbit: PeriodicOrbit, kind: str) -> NormalForm:
    """Return the normal form at a critical orbit.

    Second derivatives are exact; the third ones are differences of exact second ones along curves that leave the orbit
    tangentially to the centre manifold, to order 4.

    Parameters
    ----------
    orbit : PeriodicOrbit
        A saddle-node, a period doubling or a torus bifurcation, located.
    kind : {"SN", "PD", "TR"}
        Type of the orbit.

    Raises
    ------
    InputError
        `kind` is another, or no multiplier is near the critical value.

    References
    ----------
    Kuznetsov, Elements of Applied Bifurcation Theory, Springer 2004, sec. 4.5-4.7 and 5.4 (maps, centre manifolds).
    Departs from it in the map, which is given implicitly: (A - mu B) takes the place of (A - mu I).

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, solve_orbit
    >>> logistic = HybridSystem(
    ...     ("x", "s"), {"r": 3.0}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> orbit = solve_orbit(logistic, {}, [("carry", "map", [2 / 3, 0.0], 1.0)])
    >>> normal_form(orbit, "PD")
    NormalForm PD: supercritical, coefficient 9
    """
    if kind not in NORMAL_FORMS:
        raise InputError("type", kind, f"one of {', '.join(NORMAL_FORMS)}")
    if orbit.fixed is not None and orbit.fixed.family:
        raise InputError("orbit", "one of a family of orbits", "an orbit that is isolated at its parameters")
    problem = orbit.problem()
    u = orbit.unknowns
    J = problem.resolve(u)[1]
    mu = _critical_multiplier(orbit, kind)
    if kind == "SN":
        q, p, twist = null_vectors(problem, u, J, 1.0)
        return NormalForm(kind, fold_coefficient(problem, u, q.real, p.real) / twist.real, 0.0)
    if kind == "PD":
        q, p, twist = null_vectors(problem, u, J, -1.0)
        return NormalForm(kind, flip_coefficient(problem, u, J, q.real, p.real) / twist.real, math.pi)
    q, p, twist = null_vectors(problem, u, J, mu)
    return NormalForm(kind, torus_coefficient(problem, u, J, mu, q, p).real, abs(cmath.phase(mu)))


def _critical_multiplier(orbit: PeriodicOrbit, kind: str) -> complex:
    """Return the orbit's multiplier nearest to the critical value, on the circle."""
    autonomous = orbit.system.phase is None
    values = [v for v in (orbit.multipliers[:-1] if autonomous else orbit.multipliers).tolist() if abs(v) < 1e300]
    goals: dict[str, Callable[[complex], float]] = {
        "SN": lambda v: abs(v - 1.0),
        "PD": lambda v: abs(v + 1.0),
        "TR": lambda v: abs(abs(v) - 1.0),
    }
    goal = goals[kind]
    if kind == "TR":
        values = [v for v in values if v.imag > 0.0]
    if not values or goal(min(values, key=goal)) > AT_CRITICAL:
        wanted = {"SN": "at 1", "PD": "at -1", "TR": "on the unit circle"}[kind]
        found = ", ".join(f"{v:.6g}" for v in orbit.multipliers.tolist())
        raise InputError("orbit", found, f"an orbit with a multiplier {wanted}, as a located {kind} has")
    nearest = complex(min(values, key=goal))
    return nearest / abs(nearest)


def null_vectors(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], mu: complex
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], complex]:
    """Return the right and left null vectors of A - mu B, and the left times B times the right one.

    The right one is of unit length at the first segment's start, the left one in scaled equations.
    """
    columns, equations = scaling(problem, J, u)
    B = closing(problem)
    size = problem.size
    matrix = equations[:, None] * (J[:, :size] + (1.0 - mu) * B) * columns
    left, _, right = np.linalg.svd(matrix)
    q, p = columns * right[-1].conj(), equations * left[:, -1].conj()
    head = q[: problem.n].copy()
    if problem.system.phase is not None:
        head[-1] *= TURN / problem.system.turn
    q = q / np.linalg.norm(head)
    turn = head[int(np.argmax(np.abs(head)))]
    q *= abs(turn) / turn
    return q.astype(complex), p.astype(complex), complex(p @ (B @ q))


def fold_coefficient(
    problem: OrbitProblem, u: NDArray[np.float64], q: NDArray[np.float64], p: NDArray[np.float64]
) -> float:
    """Return p times half the second derivative along the right null vector q, which p B q makes the coefficient a."""
    S = problem.second(u, _wide(problem, u, q))
    return 0.5 * float(p @ S[:, : problem.size] @ q)


def flip_coefficient(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    q: NDArray[np.float64],
    p: NDArray[np.float64],
) -> float:
    """Return what p B q makes the coefficient c of a period doubling."""
    bend = problem.second(u, _wide(problem, u, q))[:, : problem.size] @ q
    h = -_solve(problem, u, J, 1.0, bend)
    third, size = _third(problem, u, q, h)
    return _above_noise(float(p @ third), float(np.abs(p) @ size)) / 6.0


def torus_coefficient(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    mu: complex,
    q: NDArray[np.complex128],
    p: NDArray[np.complex128],
) -> complex:
    """Return the coefficient d of a torus bifurcation, z -> mu z (1 + d abs(z)^2).

    Take a real curve through the orbit at an angle in the critical plane. Its cubic terms are a trigonometric
    polynomial in the angle. The first harmonic is wanted; four angles separate it from the third.
    """
    wide = problem.size
    x, y = q.real, q.imag
    along_x, along_y = (problem.second(u, _wide(problem, u, part))[:, :wide] for part in (x, y))
    twice = along_x @ x - along_y @ y + 1j * (along_x @ y + along_y @ x)
    mixed = along_x @ x + along_y @ y
    h20 = -_solve(problem, u, J, mu * mu, twice)
    h11 = -_solve(problem, u, J, 1.0, mixed).real
    total, noise = 0j, 0.0
    for k in range(4):
        turn = cmath.exp(0.25j * math.pi * k)
        # z = s turn: s 2 Re(turn q) + s^2 (Re(turn^2 h20) + h11)
        straight = 2.0 * (turn * q).real
        bent = 2.0 * ((turn * turn * h20).real + h11)
        third, size = _third(problem, u, straight, bent)
        total += complex(p @ third) / turn / 24.0
        noise += float(np.abs(p) @ size) / 24.0
    twist = complex(p @ (closing(problem) @ q))
    rate = total / twist / mu
    return complex(_above_noise(rate.real, noise / abs(twist)), rate.imag)


def _above_noise(value: float, size: float) -> float:
    """Return a sum, or zero where it is rounding of its terms."""
    return value if abs(value) > COEFFICIENT_ROUNDED * size else 0.0


def _wide(problem: OrbitProblem, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a direction of the orbit's unknowns, the parameters at rest."""
    return np.append(v, np.zeros(u.size - problem.size))


def _solve(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], mu: complex, rhs: NDArray[Any]
) -> NDArray[Any]:
    """Return (A - mu B)^-1 rhs, in scaled unknowns and equations."""
    columns, equations = scaling(problem, J, u)
    matrix = J[:, : problem.size] + (1.0 - mu) * closing(problem)
    solution = np.linalg.solve(equations[:, None] * matrix * columns, equations * rhs)
    return np.asarray(columns * solution)


def _third(
    problem: OrbitProblem, u: NDArray[np.float64], straight: NDArray[np.float64], bent: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the third derivative of the equations along u + s straight + s^2 bent / 2, and sizes of its terms.

    Both are of shape (size,). To order s^3 the curve keeps to the surfaces at which segments begin and end. So
    half-integer powers of their event functions do no harm.
    """
    columns, _ = scaling(problem, np.ones((problem.size, problem.size)), u)
    sizes = np.abs(np.concatenate([straight, np.sqrt(np.abs(bent) * columns)]) / np.tile(columns, 2))
    per = float(sizes.max())
    terms = np.zeros(problem.size)

    def second(s: float) -> NDArray[np.float64]:
        at = u.copy()
        at[: problem.size] += s * straight + 0.5 * s * s * bent
        slope = straight + s * bent
        J = problem.evaluate(at)[1][:, : problem.size]
        S = problem.second(at, _wide(problem, at, slope))[:, : problem.size]
        np.maximum(terms, np.abs(S @ slope) + np.abs(J @ bent), out=terms)
        return np.asarray(S @ slope + J @ bent)

    third = _derivative(second, _STEP / per)
    return third, np.abs(third) + per * terms


def _derivative(function: Callable[[float], NDArray[np.float64]], step: float) -> NDArray[np.float64]:
    """Return the derivative at 0 by central differences of order 4."""
    one, two = (function(k * step) - function(-k * step) for k in (1.0, 2.0))
    return np.asarray((8.0 * one - two) / (12.0 * step))
