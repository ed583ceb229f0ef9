"""One orbit with its Floquet multipliers, and the way to it from a guess and from a simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show
from peers import OMEGA, START, scipy_segment, tapping_orbit

import saltus
from saltus.flow import saltation_matrix
from saltus.orbits.stability.floquet import multipliers

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOL = 1e-12


def main() -> None:
    """Print the tables."""
    print(machine())
    orbit = tapping_orbit()
    guess = [(s.mode, s.transition, s.state, s.duration) for s in orbit.segments]
    exact = saltus.solve_orbit(orbit.system, {"Omega": OMEGA}, guess, tolerance=1e-14).multipliers
    problem, u = orbit.problem(), orbit.unknowns

    def ours() -> NDArray[np.complex128]:
        return multipliers(problem, u, problem.evaluate(u)[1])

    def theirs() -> NDArray[np.complex128]:
        return scipy_multipliers(orbit)

    seconds = interleaved({"saltus": ours, "SciPy DOP853": theirs}, 15)
    notes = {"saltus": f"error {_apart(ours(), exact):.0e}", "SciPy DOP853": f"error {_apart(theirs(), exact):.0e}"}
    show(f"multipliers of a known orbit, tolerance {TOL:g}", seconds, {"saltus": "SciPy DOP853"}, notes)

    rough = [(s.mode, s.transition, s.state * (1.0 + 1e-3), s.duration) for s in orbit.segments]
    works = {
        "solve_orbit, from a guess 1e-3 away": lambda: saltus.solve_orbit(orbit.system, {"Omega": OMEGA}, rough),
        "find_orbit, from another state": lambda: saltus.find_orbit(orbit.system, {"Omega": OMEGA}, x0=START),
    }
    show("the way to the orbit, admissibility and extremes with it", interleaved(works, 10), {}, {})


def scipy_multipliers(orbit: saltus.results.PeriodicOrbit) -> NDArray[np.complex128]:
    """Multipliers by SciPy's flow between event locations and saltation matrices; the one nearest to 1 is dropped."""
    system = orbit.system
    n = len(system.all_states)
    p = system.compiled.extended(system.parameter_vector(orbit.parameters))
    product, x = np.eye(n), np.ascontiguousarray(orbit.segments[0].state)
    for segment in orbit.segments:
        k = system.transition_names.index(segment.transition)
        mode = system.mode_index(segment.mode)

        def surface(t: float, y: NDArray[np.float64], *args: object, k: int = k) -> float:
            out = np.empty(2)
            system.compiled.call("event", k, 0, np.ascontiguousarray(y), p, out)
            return float(out[0])

        surface.terminal = True  # type: ignore[attr-defined]
        surface.direction = system.transitions[k].direction  # type: ignore[attr-defined]
        y = scipy_segment(orbit, mode, x, 2.0 * segment.duration, TOL, surface).y[:, -1]
        x = np.ascontiguousarray(y[:n])
        product = saltation_matrix(system, orbit.parameters, segment.transition, x) @ y[n:].reshape(n, n) @ product
    values = np.linalg.eigvals(product).astype(np.complex128)
    return np.delete(values, np.argmin(np.abs(values - 1.0)))


def _apart(values: NDArray[np.complex128], exact: NDArray[np.complex128]) -> float:
    return float(np.abs(np.sort(np.abs(values)) - np.sort(np.abs(exact))).max())


if __name__ == "__main__":
    main()
