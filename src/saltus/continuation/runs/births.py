"""The other solutions at special points of equilibria: cycles of a Hopf point, equilibria of a branch point.

docs/theory/equilibria.md, "Other branches", derives the first guesses.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import without_rounding
from saltus.continuation.core.interest import Interest
from saltus.continuation.core.zero_problem import correct
from saltus.continuation.problems.equilibrium import EquilibriumZeroProblem
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.runs.branching import other_branches, parameter_scale
from saltus.equilibria import Equilibrium
from saltus.equilibria.find import solve_equilibrium
from saltus.equilibria.normal_forms import HopfTerms, check_no_zero, hopf_terms
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import ConvergenceError, InputError
from saltus.orbits.cuts import MOST_PIECES, STRETCHED, TAUT
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, Signature
from saltus.orbits.soundness import sound_orbit
from saltus.scales import FINEST, PAIR_CRITICAL

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["AMPLITUDES", "cycle_born", "equilibrium_of_cycle", "other_equilibria"]

AMPLITUDES = (1e-2, 3e-3, 1e-3, 3e-4, 3e-2)  # amplitudes of a first cycle, over that at which other terms matter
_ROOM = 0.3  # share of the distance from a surface that a first cycle may take
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
        There is no imaginary pair, another eigenvalue is 0, or the pair does not cross the axis.
    ConvergenceError
        No cycle was found near the point.
    """
    problem, n = equilibrium.problem(parameter), equilibrium.state.size
    scale = parameter_scale(problem, np.append(equilibrium.state, equilibrium.parameters[parameter]), sizes)
    problem.scales[0] = scale
    u = np.append(equilibrium.state, equilibrium.parameters[parameter] / scale)
    J = problem.evaluate(u)[1]
    A, values = J[:, :n], equilibrium.eigenvalues
    pairs = values[values.imag > 0.0]
    if not pairs.size or float(np.abs(pairs.real).min()) > PAIR_CRITICAL * float(np.abs(values).max()):
        raise InputError("point", f"eigenvalues {values}", "an equilibrium with an imaginary pair, as every HB has")
    w = float(pairs[np.argmin(np.abs(pairs.real))].imag)
    check_no_zero(values, w)
    alike = int(np.sum(np.abs(pairs - 1j * w) < PAIR_CRITICAL * w))
    if alike > 1:
        hint = (
            f"{alike} equal pairs cross at once, as by symmetry, and many branches of cycles meet; find_orbit beside it"
        )
        raise ConvergenceError("cycle at the Hopf point", 0.0, 0, hint)
    terms = hopf_terms(problem, u, A, w)
    tangent = np.append(-np.linalg.solve(A, J[:, n]), 1.0)
    speed = complex(terms.p.conj() @ (problem.second(u, tangent)[:, :n] @ terms.q)).real
    size, pieces = _nonlinear_size(sizes, terms), _pieces(values, w)
    reason = ""
    for share in AMPLITUDES:
        z = 0.5 * share * min(size, _room(problem, u, terms.q))
        shift = -w * terms.l1 * z * z / speed if speed != 0.0 else 0.0
        if not abs(shift) < 1.0:
            continue
        turns = np.exp(2j * math.pi * np.arange(pieces) / pieces)[:, None]
        along = 2.0 * z * (terms.q * turns).real
        states = u[:n] + along + z * z * (terms.mean + (terms.double * turns**2).real) + shift * tangent[:n]
        rows = np.column_stack([states, np.full(pieces, 2.0 * math.pi / (w * pieces))])
        found = _corrected(problem, np.append(rows, u[n] + shift), along, scale)
        if not isinstance(found, str):
            return found
        reason = found
    raise ConvergenceError("cycle at the Hopf point", AMPLITUDES[0], len(AMPLITUDES), reason)


def _nonlinear_size(states: NDArray[np.float64], terms: HopfTerms) -> float:
    """Return the amplitude along q at which other terms matter; where there are none, that of the states' sizes."""
    if math.isfinite(terms.reach):
        return terms.reach
    q = np.abs(terms.q)
    return float(np.min(states[q > 1e-6] / q[q > 1e-6]))


def _pieces(values: NDArray[np.complex128], w: float) -> int:
    """Return into how many pieces a cycle of a frequency is cut, by what grows along the equilibrium meanwhile."""
    growth = 2.0 * math.pi / w * float(values.real.max())
    return 1 if growth < math.log(STRETCHED) else min(math.ceil(growth / math.log(TAUT)), MOST_PIECES)


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
    """Return the cycle near a guess, of the guess' amplitude along a direction, or why there is none.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations of the Hopf point.
    guess : ndarray, shape (pieces (n + 1) + 1,)
        State at the start and duration of each piece of the cycle, and the parameter.
    direction : ndarray, shape (pieces, n)
        The first order of the guess' states.
    scale : float
        Unit of the parameter.
    """
    system, pieces = problem.system, len(direction)
    kinds = (CLOSED_END,) + (CUT_END,) * (pieces - 1)
    signature = Signature((problem.mode,) * pieces, (-1,) * pieces, kinds, 0)
    orbits = OrbitProblem(system, signature, problem.p.copy(), list(problem.active), np.array([scale]), FINEST)
    if orbits.start(guess) is not None:
        return "the flow cannot be followed round the guess"
    branch = OrbitZeroProblem(orbits, guess, Interest(-math.inf, math.inf, scale))
    weights = branch.metric(guess)
    tangent = np.append(np.column_stack([direction, np.zeros(pieces)]), 0.0)
    length = math.sqrt(float(weights @ tangent**2))
    point = correct(branch, guess, tangent / length, weights, _ITERATIONS)
    if isinstance(point, str):
        return point
    states = weights[:-1] * (np.arange(guess.size - 1) % (problem.n + 1) < problem.n)
    if math.sqrt(float(states @ (point.u - guess)[:-1] ** 2)) > 0.5 * length:
        return "the cycle bends too sharply"
    return sound_orbit(orbits, point.u, orbits.evaluate(point.u)[1])


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


def other_equilibria(
    equilibrium: Equilibrium,
    parameter: str,
    tangent: NDArray[np.float64] | None,
    known: NDArray[np.float64],
) -> list[Equilibrium]:
    """Return an equilibrium of each other branch at a branch point, a short step from the point.

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
    problem = equilibrium.problem(parameter)
    u = np.append(equilibrium.state, equilibrium.parameters[parameter])
    return [
        Equilibrium.from_unknowns(problem, without_rounding(problem, found, sizes), sizes)
        for found, sizes in other_branches(problem, u, tangent, EquilibriumZeroProblem, known)
    ]
