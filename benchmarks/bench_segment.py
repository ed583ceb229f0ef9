"""Flow of one flight and one contact with sensitivities, against SciPy and heyoka at the same tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show
from peers import heyoka_flight, scipy_segment, tapping_orbit

from saltus.flow import _segment_kernels as kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOL = 1e-12
NONE = np.zeros(0, np.int64)


def main() -> None:
    """Print a table for each segment."""
    print(machine())
    orbit = tapping_orbit()
    for segment in orbit.segments:
        mode, x0 = orbit.system.mode_index(segment.mode), np.ascontiguousarray(segment.state)
        n, duration = x0.size, segment.duration
        compiled = orbit.system.compiled
        p = compiled.extended(orbit.system.parameter_vector(orbit.parameters))

        def mesh_of(
            tol: float, mode: int = mode, x0: NDArray[np.float64] = x0, duration: float = duration, p=p, compiled=compiled
        ) -> NDArray[np.float64]:
            room = np.empty(kernels.MOST_STEPS + 1)
            count = kernels.adapt(compiled.addresses, mode, x0, duration, p, tol, tol, room)
            return room[: count + 1].copy()

        def run(
            mesh: NDArray[np.float64], mode: int = mode, x0: NDArray[np.float64] = x0, duration: float = duration, p=p,
            compiled=compiled, n: int = n,
        ) -> NDArray[np.float64]:  # fmt: skip
            count, y = mesh.size - 1, np.empty(n * (1 + n))
            kernels.flow(
                compiled.addresses, mode, 0, False, x0, 0, duration, p, NONE, TOL, TOL, mesh, 0, count, n, y,
                np.empty(mesh.size),
            )  # fmt: skip
            return y

        mesh = mesh_of(TOL)
        exact = run(mesh_of(1e-14))
        works = {
            "saltus, on its mesh": lambda run=run, mesh=mesh: run(mesh),
            "saltus, with a new mesh": lambda run=run, mesh_of=mesh_of: run(mesh_of(TOL)),
            "SciPy DOP853": lambda mode=mode, x0=x0, duration=duration: scipy_segment(orbit, mode, x0, duration, TOL).y[:, -1],
        }
        taylor = heyoka_flight(orbit, TOL) if segment.mode == "flight" else None
        if taylor is not None:
            works["heyoka"] = taylor
        notes = {name: _errors(work(), exact, n) for name, work in works.items()}
        notes["saltus, on its mesh"] += f", {mesh.size - 1} steps"
        seconds = interleaved(works, 15)
        names = ("saltus, on its mesh", "saltus, with a new mesh")
        show(f"{segment.mode}, {n} + {n * n} equations, tolerance {TOL:g}", seconds, dict.fromkeys(names, "SciPy DOP853"), notes)
        if taylor is not None:
            show("the same against heyoka", seconds, dict.fromkeys(names, "heyoka"), {})
    print("\nheyoka has no row in contact: (a0 - z)^(3/2) has no Taylor series where the contact begins.")


def _errors(y: NDArray[np.float64], exact: NDArray[np.float64], n: int) -> str:
    state, sensitivity = np.abs(y - exact)[:n].max(), np.abs(y - exact)[n:].max() / np.abs(exact[n:]).max()
    return f"error of state {state:.0e}, of sensitivities {sensitivity:.0e}"


if __name__ == "__main__":
    main()
