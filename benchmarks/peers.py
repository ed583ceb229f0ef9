"""What the benchmarks compare with: the same orbit, by SciPy with the same compiled right-hand side, and by heyoka."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

import saltus
from saltus import afm
from saltus.afm.paper.galerkin import coefficients
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.pointers import call

if TYPE_CHECKING:
    from numpy.typing import NDArray

OMEGA = 1.05
START = [-0.67, 0.75]
VARY = FUNCTIONS.index("vary")


def settle(
    system: saltus.HybridSystem,
    p: NDArray[np.float64],
    x: NDArray[np.float64],
    mode: int,
    periods: int,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> tuple[NDArray[np.float64], int]:
    """Return the full state and the mode after some periods by Runge-Kutta steps; no event is kept."""
    motion = EventDrivenMotion(system, p, start_state(system, x), mode, rtol, atol)
    motion.follow(math.inf, periods, None, keep=False)
    return motion.x, motion.mode


def tapping_orbit() -> saltus.results.PeriodicOrbit:
    """The tapping orbit of the paper's Fig. 3 at Omega = 1.05: one flight, one contact."""
    return saltus.find_orbit(afm.tapping_mode(afm.table1(), modes=1), {"Omega": OMEGA}, x0=START)


@njit(cache=True)
def variational(t, y, addresses, mode, n, p):
    """Right-hand side of state and sensitivities, from the generated function itself."""
    out = np.empty(y.size)
    call(addresses[VARY], mode, n, y, 0, p, out, 0)
    return out


def scipy_segment(
    orbit: saltus.results.PeriodicOrbit,
    mode: int,
    x0: NDArray[np.float64],
    duration: float,
    tol: float,
    event: Any = None,
) -> Any:
    """SciPy's DOP853 on state and sensitivities of one segment; ends early at a terminal event, where one is given."""
    n = x0.size
    compiled = orbit.system.compiled
    p = compiled.extended(orbit.system.parameter_vector(orbit.parameters))
    y0 = np.concatenate([x0, np.eye(n).ravel()])
    options = {"method": "DOP853", "rtol": tol, "atol": tol, "args": (compiled.addresses, mode, n, p), "events": event}
    return solve_ivp(variational, (0.0, duration), y0, **options)


def heyoka_flight(orbit: saltus.results.PeriodicOrbit, tol: float) -> Callable[[], NDArray[np.float64]] | None:
    """A Taylor integrator of a flight with sensitivities, made once; None where heyoka is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    system = _heyoka_flight_system(hy, orbit)
    segment = next(segment for segment in orbit.segments if segment.mode == "flight")
    x0, n = segment.state, segment.state.size
    integrator = hy.taylor_adaptive(hy.var_ode_sys(system, hy.var_args.vars, order=1), list(x0), tol=tol)
    begin = np.concatenate([x0, np.eye(n).ravel()])

    def run() -> NDArray[np.float64]:
        integrator.time = 0.0
        integrator.state[:] = begin
        integrator.propagate_until(segment.duration)
        return np.array(integrator.state)

    return run


def _heyoka_flight_system(hy: ModuleType, orbit: saltus.results.PeriodicOrbit) -> list[Any]:
    setup, p = afm.table1(), orbit.parameters
    c = coefficients(setup.cantilever, setup.sample, setup.eta, 1)
    q, v, theta = hy.make_vars("q1", "v1", "theta")
    z = 1.0 - q - p["ybar"] * hy.sin(theta)
    drive = float(c.B[0]) * p["Omega"] ** 2 * p["ybar"] * hy.sin(theta)
    return [(q, v), (v, -p["D_att_1"] * v - q + c.C - c.C / (z * z) + drive), (theta, hy.expression(p["Omega"]))]
