"""Flow of one flight and one contact with sensitivities, against SciPy and heyoka at the same tolerance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show
from peers import heyoka_flight, scipy_segment, tapping_orbit

from saltus.flow.kernels import segment as kernels
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import pointer

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import saltus
    from saltus.orbits import Segment

TOL = 1e-12
OURS = ("saltus, on its mesh", "saltus, with a new mesh")


@njit(cache=True, error_model="numpy")
def sensitivities(functions, mode, x0, duration, p, active, mesh, y, errors):
    """State and sensitivities at the end of a segment without roots, on its mesh."""
    n = x0.size
    segment = kernels.Segment(pointer(functions, 0), mode, duration, pointer(p, 0), n)
    sensitive = kernels.Sensitive(0, False, False, pointer(active, 0), active.size, n + active.size)
    start, end, places = pointer(x0, 0), pointer(y, 0), pointer(mesh, 0)
    kernels.flow(segment, sensitive, start, places, mesh.size - 1, TOL, TOL, end, pointer(errors, 0))


def main() -> None:
    """Print the tables of both segments."""
    print(machine())
    orbit = tapping_orbit()
    for segment in orbit.segments:
        report(orbit, segment)
    print("\nheyoka has no row in contact: (a0 - z)^(3/2) has no Taylor series where the contact begins.")


def report(orbit: saltus.results.PeriodicOrbit, segment: Segment) -> None:
    """Print the table of one segment, with errors against the flow at tolerance 1e-14."""
    compiled, mode = orbit.system.compiled, orbit.system.mode_index(segment.mode)
    x0, duration = np.ascontiguousarray(segment.state), segment.duration
    n, functions = x0.size, compiled.addresses
    p = compiled.extended(orbit.system.parameter_vector(orbit.parameters))
    no_parameter = np.zeros(0, np.int64)

    def mesh_of(tol: float) -> NDArray[np.float64]:
        room = np.empty(kernels.MOST_STEPS + 1)
        count = kernels.adapt(functions, mode, x0, duration, p, tol, tol, room)
        return room[: count + 1].copy()

    def run(mesh: NDArray[np.float64]) -> NDArray[np.float64]:
        y, errors = np.empty(n * (1 + n)), np.empty(mesh.size)
        sensitivities(functions, mode, x0, duration, p, no_parameter, mesh, y, errors)
        return y

    mesh, exact = mesh_of(TOL), run(mesh_of(1e-14))
    works = {
        OURS[0]: lambda: run(mesh),
        OURS[1]: lambda: run(mesh_of(TOL)),
        "SciPy DOP853": lambda: scipy_segment(orbit, mode, x0, duration, TOL).y[:, -1],
    }
    if segment.mode == "flight" and (taylor := heyoka_flight(orbit, TOL)) is not None:
        works["heyoka"] = taylor
    notes = {name: _errors(work(), exact, n) for name, work in works.items()}
    notes[OURS[0]] += f", {mesh.size - 1} steps"
    seconds = interleaved(works, 15)
    title = f"{segment.mode}, {n} + {n * n} equations, tolerance {TOL:g}"
    show(title, seconds, dict.fromkeys(OURS, "SciPy DOP853"), notes)
    if "heyoka" in seconds:
        show("the same seconds, against heyoka", seconds, dict.fromkeys(OURS, "heyoka"), {})


def _errors(y: NDArray[np.float64], exact: NDArray[np.float64], n: int) -> str:
    state, sensitivity = np.abs(y - exact)[:n].max(), np.abs(y - exact)[n:].max() / np.abs(exact[n:]).max()
    return f"error of state {state:.0e}, of sensitivities {sensitivity:.0e}"


if __name__ == "__main__":
    main()
