"""Lyapunov exponents of the tapping cantilever by the period, beside its motion alone by the same Runge-Kutta steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show
from peers import settle

from saltus import afm
from saltus.flow.variational import Average, growth_along

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import saltus

PERIODS = 300  # of one run
SETTLED = 400  # periods before it
REPEATS = 11
OMEGA = 1.0
TOLERANCES = (1e-10, 1e-8, 1e-7, 1e-6)
ALONE = "motion alone"


def main() -> None:
    """Print the tables."""
    print(machine())
    system = afm.tapping_mode(afm.table1(), modes=2)
    p = system.parameter_vector({"Omega": OMEGA})
    x, mode = settle(system, p, np.zeros(4), 0, SETTLED)
    for tolerance in TOLERANCES:
        start = (system, p, x, mode)
        works = {
            ALONE: lambda a=start, tol=tolerance: settle(*a, PERIODS, tol, 1e-2 * tol),
            "with 1": lambda a=start, tol=tolerance: exponents(*a, tol, 1, PERIODS),
            "with 4": lambda a=start, tol=tolerance: exponents(*a, tol, 4, PERIODS),
        }
        seconds = interleaved(works, REPEATS)
        per = {name: [value / PERIODS for value in values] for name, values in seconds.items()}
        notes = {"with 1": f"{exponents(*start, tolerance, 1, 10 * PERIODS)[0]:.7f}"}
        show(f"a period, tolerance {tolerance:g}", per, dict.fromkeys(per, ALONE), notes)


def exponents(
    system: saltus.HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    tol: float,
    count: int,
    periods: int,
) -> NDArray[np.float64]:
    """Return the largest exponents of a run."""
    average, tolerance = Average(periods=periods, discard=0), (tol, 1e-2 * tol)
    return growth_along(system, p, x, mode, average=average, exponents=count, tolerance=tolerance).exponents


if __name__ == "__main__":
    main()
