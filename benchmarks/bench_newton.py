"""One Newton correction of the segment equations: residual, Jacobian, linear solve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show
from peers import scipy_segment, tapping_orbit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import saltus

TOL = 1e-12


def main() -> None:
    """Print the table."""
    print(machine())
    orbit = tapping_orbit()
    problem, u = orbit.problem(), orbit.unknowns

    def ours() -> NDArray[np.float64]:
        F, J = problem.evaluate(u)
        return np.linalg.solve(J, -F)

    def theirs() -> NDArray[np.float64]:
        F, J = scipy_equations(orbit, u)
        return np.linalg.solve(J, -F)

    works = {"saltus": ours, "SciPy DOP853": theirs}
    seconds = interleaved(works, 15)
    size = f"{len(orbit.segments)} segments, {u.size} unknowns"
    notes = {name: f"correction {np.abs(work()).max():.0e}" for name, work in works.items()}
    show(f"one Newton correction, {size}, tolerance {TOL:g}", seconds, {"saltus": "SciPy DOP853"}, notes)


def scipy_equations(
    orbit: saltus.results.PeriodicOrbit, u: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The same equations with SciPy's flow; every segment ends where its event function vanishes."""
    system = orbit.system
    compiled, n, m = system.compiled, len(system.all_states), u.size
    p = system.parameter_vector(orbit.parameters)
    extended = compiled.extended(p)
    F, J = np.zeros(m), np.zeros((m, m))
    event = np.empty(2 + 2 * n)
    for i, (mode, transition) in enumerate(zip(orbit.form.modes, orbit.form.transitions, strict=True)):
        row, following = i * (n + 1), (i + 1) % len(orbit.form) * (n + 1)
        y = scipy_segment(orbit, mode, np.ascontiguousarray(u[row : row + n]), float(u[row + n]), TOL).y[:, -1]
        x, x_x = np.ascontiguousarray(y[:n]), y[n:].reshape(n, n)
        f = compiled.field(mode, x, p)
        compiled.call("event_x", transition, 0, x, extended, event)
        F[row : row + n] = x - u[following : following + n]  # the resets are identities
        F[row + n] = event[0]
        J[row : row + n, row : row + n] += x_x
        J[row : row + n, row + n] += f
        J[row : row + n, following : following + n] -= np.eye(n)
        J[row + n, row : row + n] += event[2 : 2 + n] @ x_x
        J[row + n, row + n] += event[1]
        if following == 0:
            F[row + n - 1] -= 2.0 * np.pi * orbit.form.turns
    return F, J


if __name__ == "__main__":
    main()
