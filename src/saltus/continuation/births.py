"""The other solutions at special points of equilibria: cycles of a Hopf point, equilibria of a branch point.

docs/theory/equilibria.md, "Other branches", derives the first guesses.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.equilibrium_problem import EquilibriumZeroProblem
from saltus.continuation.orbit_problem import Interest, OrbitZeroProblem
from saltus.continuation.zero_problem import Point, correct
from saltus.equilibria import Equilibrium
from saltus.equilibria.equilibrium import equilibrium_at
from saltus.equilibria.find import solve_equilibrium, without_rounding
from saltus.equilibria.normal_forms import HopfTerms, hopf_terms
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import ConvergenceError, InputError
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, Signature

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["cycle_born", "equilibrium_of_cycle", "other_equilibrium"]

_AMPLITUDES = (1e-2, 3e-3, 1e-3, 3e-4, 3e-2)  # amplitudes of a first cycle, over that at which other terms matter
_ROOM = 0.3  # share of the distance from a surface that a first cycle may take
_CRITICAL = 1e-6  # real part of a critical pair, over the largest modulus, above which there is no Hopf point
_TOLERANCE = 1e-12  # relative tolerance of the flow of a cycle that is born
_SHIFTS = (1e-3, 1e-4, 1e-5, 1e-2)  # changes of the parameter by a first step, over the one that alters the Jacobian
_ALIKE = 1e-9  # difference of a cosine from 1 up to which two branches have the same direction
_FAINT = 1e-12  # size of an equation's terms, over the largest, up to which it has no size of its own
_ITERATIONS = 12  # most Newton steps to a first solution


def cycle_born(equilibrium: Equilibrium, parameter: str, sizes: NDArray[np.float64]) -> PeriodicOrbit:
    """Return a small cycle near a Hopf point, on the branch that is born there as the parameter varies.

    Parameters
    ----------
    equilibrium : Equilibrium
        The Hopf point, located.
    parameter : str
        The parameter that is free.
    sizes : ndarray, shape (n,)
        Sizes of the states along the point's own branch.

    Raises
    ------
    InputError
        There is no imaginary pair, or the pair does not cross the axis as the parameter varies.
    ConvergenceError
        No cycle was found near the point.
    """
    problem, n = equilibrium.problem(parameter), equilibrium.state.size
    scale = _parameter_scale(problem, equilibrium, parameter, sizes)
    problem.scales[0] = scale
    u = np.append(equilibrium.state, equilibrium.parameters[parameter] / scale)
    J = problem.evaluate(u)[1]
    A, values = J[:, :n], equilibrium.eigenvalues
    pairs = values[values.imag > 0.0]
    if not pairs.size or float(np.abs(pairs.real).min()) > _CRITICAL * float(np.abs(values).max()):
        raise InputError("point", f"eigenvalues {values}", "an equilibrium with an imaginary pair, as every HB has")
    w = float(pairs[np.argmin(np.abs(pairs.real))].imag)
    terms = hopf_terms(problem, u, A, w)
    tangent = np.append(-np.linalg.solve(A, J[:, n]), 1.0)
    speed = complex(terms.p.conj() @ (problem.second(u, tangent)[:, :n] @ terms.q)).real
    size = _nonlinear_size(sizes, terms)
    reason = ""
    for share in _AMPLITUDES:
        z = 0.5 * share * min(size, _room(problem, u, terms.q))
        shift = -w * terms.l1 * z * z / speed if speed != 0.0 else 0.0
        if not abs(shift) < 1.0:
            continue
        start = 2.0 * z * terms.q.real + z * z * (terms.mean + terms.double.real) + shift * tangent[:n]
        guess = np.concatenate([u[:n] + start, [2.0 * math.pi / w, u[n] + shift]])
        found = _corrected(problem, guess, 2.0 * z * terms.q.real, scale)
        if isinstance(found, PeriodicOrbit):
            return found
        reason = found
    raise ConvergenceError("cycle at the Hopf point", _AMPLITUDES[0], len(_AMPLITUDES), reason)


def _nonlinear_size(states: NDArray[np.float64], terms: HopfTerms) -> float:
    """Return the amplitude along q at which other terms matter; where there are none, that of the states' sizes."""
    if math.isfinite(terms.reach):
        return terms.reach
    q = np.abs(terms.q)
    return float(np.min(states[q > 1e-6] / q[q > 1e-6]))


def _room(problem: EquilibriumProblem, u: NDArray[np.float64], q: NDArray[np.complex128]) -> float:
    """Return an amplitude along q at which a cycle stays clear of the mode's surfaces, times 100."""
    room = math.inf
    for k in problem.ways_out:
        height, gradient = problem.event(k, u)
        reach = abs(complex(gradient[: problem.n] @ q))
        if reach > 0.0 and height != 0.0:
            room = min(room, 100.0 * _ROOM * abs(height) / reach)
    return room


def _corrected(
    problem: EquilibriumProblem, guess: NDArray[np.float64], direction: NDArray[np.float64], scale: float
) -> PeriodicOrbit | str:
    """Return the cycle near a guess, of the guess' amplitude along a direction, or why there is none."""
    system, n = problem.system, problem.n
    signature = Signature((problem.mode,), (-1,), (CLOSED_END,), 0)
    orbits = OrbitProblem(system, signature, problem.p.copy(), list(problem.active), np.array([scale]), _TOLERANCE)
    if orbits.start(guess) is not None:
        return "the flow cannot be followed round the guess"
    branch = OrbitZeroProblem(orbits, guess, Interest(-math.inf, math.inf, scale))
    weights = branch.metric(guess)
    tangent = np.append(direction, [0.0, 0.0])
    length = math.sqrt(float(weights @ tangent**2))
    point = correct(branch, guess, tangent / length, weights, _ITERATIONS)
    if isinstance(point, str):
        return point
    if math.sqrt(float(weights[:n] @ (point.u - guess)[:n] ** 2)) > 0.5 * length:
        return "the cycle bends too sharply"
    return orbit_at(orbits, point.u, orbits.evaluate(point.u)[1])


def _parameter_scale(
    problem: EquilibriumProblem, equilibrium: Equilibrium, parameter: str, known: NDArray[np.float64]
) -> float:
    """Return the change of the parameter that alters the Jacobian by its own size, along the branch.

    A Jacobian may vanish as a whole, as at a branch point of one state. It then has the size of its change over `known`
    sizes of the states.
    """
    n = problem.n
    u = np.append(equilibrium.state, equilibrium.parameters[parameter])
    J = problem.evaluate(u)[1]
    sizes = np.maximum(known, 1e-300)
    moved = np.linalg.lstsq(J[:, :n], -J[:, n], rcond=1e-8)[0]
    ways = [np.append(moved, 1.0), np.append(known, 0.0)]
    change, *bend = (problem.second(u, way)[:, :n] for way in ways)
    own, by_parameter, *rest = (
        float(np.linalg.norm(part * sizes / sizes[:, None])) for part in (J[:, :n], change, *bend)
    )
    own = max([own, *rest])
    value = abs(equilibrium.parameters[parameter])
    return own / by_parameter if own > 0.0 and by_parameter > 0.0 else value or 1.0


def equilibrium_of_cycle(orbit: PeriodicOrbit) -> Equilibrium:
    """Return the equilibrium to which a cycle has shrunk at a Hopf point.

    Raises
    ------
    ConvergenceError
        There is no equilibrium there, or it has no imaginary pair.
    """
    system = orbit.system
    p = system.parameter_vector(orbit.parameters)
    found = solve_equilibrium(EquilibriumProblem(system, orbit.form.modes[0], p), np.array(orbit.x0))
    values = found.eigenvalues[found.eigenvalues.imag > 0.0]
    w = 2.0 * math.pi / orbit.period
    if not values.size or float(np.abs(values - 1j * w).min()) > 1e-3 * w:
        raise ConvergenceError("equilibrium at the Hopf point", found.residual, 0, "it has no imaginary pair")
    return found


def other_equilibrium(
    equilibrium: Equilibrium,
    parameter: str,
    tangent: NDArray[np.float64] | None,
    known: NDArray[np.float64],
) -> Equilibrium:
    """Return an equilibrium of the other branch at a branch point, a short step from the point.

    Parameters
    ----------
    equilibrium : Equilibrium
        The branch point, located.
    parameter : str
        The parameter that is free.
    tangent : ndarray, shape (n + 1,), or None
        Tangent of the point's own branch.
    known : ndarray, shape (n,)
        Sizes of the states along that branch; at the point itself all may be rounding of 0.

    Raises
    ------
    InputError
        The point has no branch of its own.
    ConvergenceError
        No equilibrium of the other branch was found.
    """
    if tangent is None:
        raise InputError("point", "a BP without tangent", "a branch point of a branch")
    problem, n = equilibrium.problem(parameter), equilibrium.state.size
    scale = _parameter_scale(problem, equilibrium, parameter, known)
    problem.scales[0] = scale
    u = np.append(equilibrium.state, equilibrium.parameters[parameter] / scale)
    J = problem.evaluate(u)[1]
    sizes = np.append(known, 1.0)
    terms = np.abs(J * sizes).max(axis=1)
    rows = 1.0 / np.where(terms > _FAINT * terms.max(), terms, terms.max() or 1.0)
    left, _, right = np.linalg.svd(J * sizes * rows[:, None])
    w = left[:, -1] * rows
    first, second = right[-1] * sizes, right[-2] * sizes
    bend = [w @ problem.second(u, v) for v in (first, second)]
    a, b, c = float(bend[0] @ first), float(bend[0] @ second), float(bend[1] @ second)
    far = -(b + math.copysign(math.sqrt(max(b * b - a * c, 0.0)), b))
    directions = [x * first + y * second for x, y in ((far, a), (c, far)) if (x, y) != (0.0, 0.0)]
    own = np.append(tangent[:n], tangent[n] / scale) / sizes
    likeness = [abs(float(own @ (d / sizes))) / float(np.linalg.norm(own) * np.linalg.norm(d / sizes))
                for d in directions]  # fmt: skip
    if not likeness or min(likeness) > 1.0 - _ALIKE:
        hint = "to second order both branches leave in the same direction"
        raise ConvergenceError("other branch", 0.0, 0, hint)
    chosen = directions[int(np.argmin(likeness))]
    chosen = chosen / float(np.linalg.norm(chosen / sizes))
    third = w @ problem.third(u, *(3 * [chosen[:n].copy()]))
    pull = abs(float(w @ problem.second(u, np.append(own * sizes, [])) @ chosen)) or 1.0
    reason = ""
    for share in _SHIFTS:
        # a step that moves the parameter by that share: linearly, or by its square where the branch is tangent
        steps = [share / abs(chosen[n]) if abs(chosen[n]) > 1e-6 else math.inf]
        steps += [math.sqrt(share * pull / abs(float(third)))] if float(third) != 0.0 else []
        steps += [math.sqrt(share)]  # third derivatives may vanish: no step is longer, in sizes of the states
        found = _stepped(problem, u, min(steps) * chosen, sizes, scale)
        if isinstance(found, Equilibrium):
            return found
        reason = found
    raise ConvergenceError("other branch", _SHIFTS[0], len(_SHIFTS), reason)


def _stepped(
    problem: EquilibriumProblem,
    u: NDArray[np.float64],
    step: NDArray[np.float64],
    sizes: NDArray[np.float64],
    scale: float,
) -> Equilibrium | str:
    """Return the equilibrium near `u + step`, corrected normally to the step, or why there is none."""
    n = problem.n
    branch = EquilibriumZeroProblem(problem, sizes[:n], Interest(-math.inf, math.inf, scale))
    weights = np.append(1.0 / sizes[:n] ** 2, 1.0)
    length = math.sqrt(float(weights @ step**2))
    point = correct(branch, u + step, step / length, weights, _ITERATIONS)
    if not isinstance(point, Point):
        return point
    if math.sqrt(float(weights @ (point.u - u - step) ** 2)) > 0.5 * length:
        return "the other branch bends too sharply"
    u = without_rounding(problem, point.u, sizes[:n])
    return equilibrium_at(problem, u, np.maximum(sizes[:n], np.abs(u[:n])))
