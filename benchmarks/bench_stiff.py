"""Stiff flows: van der Pol's relaxation oscillation, the Oregonator, a driven reactor; SciPy's Radau beside them."""

from __future__ import annotations

import time

import numpy as np
from measure import interleaved, machine, show
from scipy.integrate import solve_ivp

import saltus

VAN_DER_POL = saltus.HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": 1.0}, name="van der Pol")
OREGONATOR = saltus.HybridSystem.smooth(
    {"x": "q*(y + x*(1 - 8.375e-6*x - y))", "y": "(z - (1 + x)*y)/q", "z": "0.161*(x - z)"},
    {"q": 77.27},
    name="Oregonator",
)
REACTOR = saltus.HybridSystem.smooth(
    {
        "a": "-0.04*a + 1e4*b*c + d*(1 + cos(s)/2)*(1 - a)", "b": "0.04*a - 1e4*b*c - 3e7*b**2 - d*(1 + cos(s)/2)*b",
        "c": "3e7*b**2 - d*(1 + cos(s)/2)*c",
    },
    {"d": 0.01, "w": 0.1}, phase=("s", "w"), name="Robertson's reaction, driven",
)  # fmt: skip


def main() -> None:
    """Print the tables."""
    print(machine())
    first = saltus.find_orbit(VAN_DER_POL, {"mu": 1.0}, x0=[2.0, 0.0])
    works = {
        "van der Pol, mu = 1000, an orbit": lambda: saltus.find_orbit(VAN_DER_POL, {"mu": 1000.0}, x0=[2.0, 0.0]),
        "its branch from 0.01 to 10 000": lambda: saltus.continue_orbit(first, "mu", (0.01, 1e4)),
        "Oregonator, an orbit": lambda: saltus.find_orbit(OREGONATOR, x0=[4.0, 1.1, 4.0]),
        "driven reactor, an orbit": lambda: saltus.find_orbit(REACTOR, x0=[0.5, 0.0, 0.5]),
    }
    notes = {
        "van der Pol, mu = 1000, an orbit": f"T = {works['van der Pol, mu = 1000, an orbit']().period:.14g}",
        "its branch from 0.01 to 10 000": f"{len(works['its branch from 0.01 to 10 000']())} points",
        "Oregonator, an orbit": f"T = {works['Oregonator, an orbit']().period:.12g}",
        "driven reactor, an orbit": f"a = {works['driven reactor, an orbit']().x0[0]:.12g}",
    }
    show("stiff flows", interleaved(works, 5), {}, notes)
    begin = time.perf_counter()
    period, steps = period_by_scipy(1000.0)
    seconds = time.perf_counter() - begin
    print(f"  SciPy's Radau at 1e-12: T = {period:.14g}, {steps} steps, {seconds:.3g} s for 3.2 periods")


def period_by_scipy(mu: float) -> tuple[float, int]:
    """Return the period of van der Pol's cycle by SciPy, and how many steps it takes for 3.2 of them."""

    def passing(_: float, y: np.ndarray) -> float:
        return float(y[0] - 1.5)

    passing.direction = -1.0  # type: ignore[attr-defined]

    def field(_: float, y: np.ndarray) -> list[float]:
        return [y[1], mu * (1 - y[0] ** 2) * y[1] - y[0]]

    def jacobian(_: float, y: np.ndarray) -> list[list[float]]:
        return [[0.0, 1.0], [-2 * mu * y[0] * y[1] - 1, mu * (1 - y[0] ** 2)]]

    found = solve_ivp(
        field, (0.0, 5.2 * mu), [2.0, 0.0], method="Radau", rtol=1e-12, atol=1e-15, jac=jacobian, events=passing
    )
    return float(np.diff(found.t_events[0])[-1]), found.t.size


if __name__ == "__main__":
    main()
