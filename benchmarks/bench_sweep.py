"""Settled simulation by the period, and the sweep of Fig. 7(b), against SciPy, heyoka and the Runge-Kutta flow."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from measure import interleaved, machine, show
from numba import njit
from peers import settle
from scipy.integrate import solve_ivp

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig7, fig7a
from saltus.afm.paper.galerkin import coefficients
from saltus.afm.paper.regimes import settled_orbit
from saltus.ensemble.returns import ManyReturns, Start
from saltus.flow.poincare import iterate
from saltus.system.compiled import FUNCTIONS
from saltus.system.numba_tools.pointers import call

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOL, TIGHT = 1e-8, 1e-13
PERIODS, SCIPY_PERIODS = 2000, 2
TRANSIENTS, BOX, OMEGA_OF_TRANSIENTS = 500, 5.0, 1.15
QUIET = {"Omega": 1.05, "ybar": 0.005}
"""Drive so weak that the tip does not touch."""

START = 0.98
"""Omega of the orbit from which the sweep of Fig. 7(b) sets out."""

FIELD = FUNCTIONS.index("field")


@njit(cache=True)
def right_hand_side(t, y, addresses, mode, p):
    """The generated field, as SciPy calls it."""
    out = np.empty(y.size)
    call(addresses[FIELD], mode, 0, y, 0, p, out, 0)
    return out


def main() -> None:
    """Print the tables."""
    print(machine())
    per_period = settled()
    quiet()
    sweep(per_period)


def settled() -> float:
    """Time a period of settled tapping, and of transients; return SciPy's time of a period."""
    works: dict[str, Callable[[], Any]] = {}
    counts, notes = {}, {}
    for n in (1, 2):
        system = afm.tapping_mode(afm.table1(), modes=n)
        p = system.parameter_vector({"Omega": 1.0})
        x, mode = settle(system, p, _start(system, n), 0, 400)
        kinds = {f"saltus, n = {n}": _by_series, f"Runge-Kutta flow, n = {n}": _by_runge_kutta}
        exact = _by_series(system, p, x, mode, 1, TIGHT)
        for name, follow in kinds.items():
            works[name] = lambda f=follow, a=(system, p, x, mode): f(*a, PERIODS, TOL)
            counts[name] = PERIODS
            notes[name] = f"error after one {_apart(follow(system, p, x, mode, 1, TOL), exact):.0e}"
        if n == 2:
            name = "SciPy DOP853, n = 2"
            works[name] = lambda a=(system, p, x, mode): _by_scipy(*a, SCIPY_PERIODS, TOL)
            counts[name] = SCIPY_PERIODS
            notes[name] = f"error after one {_apart(_by_scipy(system, p, x, mode, 1, TOL), exact):.0e}"
            name = "saltus, n = 2, transients"
            works[name], counts[name] = _transients(system), TRANSIENTS
            notes[name] = f"{TRANSIENTS} starts in [-5, 5]^4, Omega = 1.15"
    seconds = interleaved(works, 7)
    per = {name: [value / counts[name] for value in values] for name, values in seconds.items()}
    peer = "SciPy DOP853, n = 2"
    show(f"one forcing period, tolerance {TOL:g}", per, {"saltus, n = 2": peer, "Runge-Kutta flow, n = 2": peer}, notes)
    return min(per[peer])


def _start(system: saltus.HybridSystem, n: int) -> NDArray[np.float64]:
    if n == 1:
        return np.zeros(2)
    return settled_orbit(system, {"Omega": START}, "repulsive").x0


def _by_series(
    system: saltus.HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, periods: int, tol: float
) -> NDArray[np.float64]:
    return iterate(system, p, x, mode, discard=periods - 1, keep=1, tolerance=(tol, tol)).x_end


def _by_runge_kutta(
    system: saltus.HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, periods: int, tol: float
) -> NDArray[np.float64]:
    return settle(system, p, x, mode, periods, tol, tol)[0]


def _by_scipy(
    system: saltus.HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, periods: int, tol: float
) -> NDArray[np.float64]:
    """Integrate from event to event, the phase running on."""
    extended, t, end, out = system.compiled.extended(p), 0.0, 2.0 * math.pi * periods / p[0], np.empty(2)
    while t < end:
        k = mode  # the one transition out of each mode

        def surface(t: float, y: NDArray[np.float64], *args: object, k: int = k) -> float:
            system.compiled.call("event", k, 0, np.ascontiguousarray(y), extended, out)
            return float(out[0])

        surface.terminal = True  # type: ignore[attr-defined]
        surface.direction = system.transitions[k].direction  # type: ignore[attr-defined]
        options = {"method": "DOP853", "rtol": tol, "atol": tol, "args": (system.compiled.addresses, mode, extended)}
        flown = solve_ivp(right_hand_side, (t, end), x, events=surface, **options)
        t, x = float(flown.t[-1]), flown.y[:, -1]
        mode = 1 - mode if flown.status == 1 else mode
    x[-1] -= 2.0 * math.pi * periods
    return x


def _transients(system: saltus.HybridSystem) -> Callable[[], None]:
    rng = np.random.default_rng(0)
    starts: list[NDArray[np.float64]] = []
    p = system.parameter_vector({"Omega": OMEGA_OF_TRANSIENTS})
    surface = system.parameters["a0"] / system.parameters["eta"]
    while len(starts) < TRANSIENTS:
        x = rng.uniform(-BOX, BOX, 4)
        if 1.0 - x[0] - x[1] > surface:
            starts.append(x)

    def run() -> None:
        for x in starts:
            iterate(system, p, x, 0, discard=0, keep=1, tolerance=(TOL, TOL))

    return run


def _apart(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    # the phase is 0 or, a rounding before the wrap, 2 pi
    return float(np.abs(a[:-1] - b[:-1]).max())


def quiet() -> None:
    """Time a period of flight alone, n = 2, for a Taylor method that knows no contact."""
    system = afm.tapping_mode(afm.table1(), modes=2)
    p = system.parameter_vector(QUIET)
    x, mode = settle(system, p, np.zeros(4), 0, 400)
    works: dict[str, Callable[[], Any]] = {}
    for tol in (1e-8, 1e-10):
        works[f"saltus, {tol:g}"] = lambda tol=tol: _by_series(system, p, x, mode, PERIODS, tol)
        if (flight := heyoka_flight(system, x, tol)) is not None:
            works[f"heyoka, {tol:g}"] = flight
    seconds = interleaved(works, 7)
    per = {name: [value / PERIODS for value in values] for name, values in seconds.items()}
    peers = {name: name.replace("saltus", "heyoka") for name in works if name.startswith("saltus")}
    show("one forcing period without contact, n = 2", per, peers, {})


def heyoka_flight(system: saltus.HybridSystem, x: NDArray[np.float64], tol: float) -> Callable[[], None] | None:
    """A Taylor integrator of the flight, made once; None where heyoka is not installed."""
    try:
        import heyoka as hy
    except ImportError:
        return None
    setup, values = afm.table1(), system.resolve(QUIET)
    c = coefficients(setup.cantilever, setup.sample, setup.eta, 2)
    q1, q2, v1, v2 = hy.make_vars("q1", "q2", "v1", "v2")
    swing = values["ybar"] * hy.sin(values["Omega"] * hy.time)
    z = 1.0 - q1 - q2 - swing
    force = c.C - c.C / (z * z)
    rates = [
        (v, -values[f"D_att_{i}"] * v - float(K) * q + force + float(B) * values["Omega"] ** 2 * swing)
        for i, q, v, K, B in zip((1, 2), (q1, q2), (v1, v2), c.K, c.B, strict=True)
    ]
    rhs = [(q1, rates[0][0]), (q2, rates[1][0]), (v1, rates[0][1]), (v2, rates[1][1])]
    integrator = hy.taylor_adaptive(rhs, list(x[:4]), tol=tol)

    def run() -> None:
        integrator.time = 0.0
        integrator.state[:] = x[:4]
        integrator.propagate_until(2.0 * math.pi / QUIET["Omega"] * PERIODS)

    return run


def sweep(scipy_period: float) -> None:
    """Time the 300 values of Fig. 7(b), 700 periods at each, once each way."""
    system = afm.tapping_mode(afm.table1(), modes=2)
    x = settled_orbit(system, {"Omega": START}, "repulsive").x0
    values = np.linspace(*fig7a.SWEPT, fig7.COUNT)
    periods = fig7.COUNT * (fig7.DISCARDED + fig7.KEPT)

    def follow(part: NDArray[np.float64], tol: float) -> None:
        state, mode = x, 0
        for omega in part:
            p = system.parameter_vector({"Omega": float(omega)})
            found = iterate(system, p, state, mode, discard=fig7.DISCARDED, keep=fig7.KEPT, tolerance=(tol, 0.01 * tol))
            state, mode = found.x_end, found.mode_end

    def halves(tol: float) -> None:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(follow, np.array_split(values, 2), (tol, tol)))

    def run(**options: int) -> saltus.results.Sweep:
        return saltus.run_sweep(
            system,
            "Omega",
            values,
            x0=x,
            options=saltus.options.SweepOptions(discard=fig7.DISCARDED, keep=fig7.KEPT, quantities=["v"], **options),
        )

    works: dict[str, Callable[[], Any]] = {
        "motion alone, 1e-8": lambda: follow(values, 1e-8),
        "motion alone, 1e-10": lambda: follow(values, 1e-10),
        "motion alone, 1e-10, two threads": lambda: halves(1e-10),
        "with exponents and labels, 1e-10": run,
        "the same, two threads and chunks": lambda: run(chunks=2, workers=2),
    }
    by_lanes(system, x, values, run)
    follow(values[:1], 1e-8)
    run_seconds = {}
    for name, work in works.items():
        begin = time.perf_counter()
        work()
        run_seconds[name] = [time.perf_counter() - begin]
    show(f"Fig. 7(b): {fig7.COUNT} values, {periods} periods", run_seconds, {}, {})
    whole = scipy_period * periods
    print(f"  SciPy DOP853 at {TOL:g}, by the {SCIPY_PERIODS} periods above: {whole:.0f} s", end="")
    print(f", {whole / run_seconds['motion alone, 1e-8'][0]:.0f} times as long as the motion alone at 1e-8")


def by_lanes(
    system: saltus.HybridSystem,
    x: NDArray[np.float64],
    values: NDArray[np.float64],
    run: Callable[..., saltus.results.Sweep],
) -> None:
    """Time the same values in 64 chunks side by side in lanes, in seconds of a processor, against single motions."""
    tolerance = (TOL, 0.01 * TOL)
    many, skip, keep = ManyReturns(system, None, tolerance), fig7.DISCARDED, fig7.KEPT

    def start(omega: float) -> Start:
        return Start(system.parameter_vector({"Omega": omega}), system.full_state(x), 0)

    def alone() -> None:
        for one in map(start, values.tolist()):
            iterate(system, one.p, one.x, one.mode, discard=skip, keep=keep, tolerance=tolerance)

    works: dict[str, Callable[[], Any]] = {
        "motion alone, one by one": alone,
        "motion alone, in lanes": lambda: many.follow([start(value) for value in values.tolist()], skip, keep),
        "with exponents and labels, one by one": lambda: run(chunks=64, workers=1, lanes=False),
        "with exponents and labels, in lanes": lambda: run(chunks=64, workers=1, lanes=True),
    }
    for work in works.values():
        work()  # compiles
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(2):
        for name, work in works.items():
            begin = time.process_time()
            work()
            seconds[name].append(time.process_time() - begin)
    peers = {name: name.replace("in lanes", "one by one") for name in works if name.endswith("in lanes")}
    show(f"Fig. 7(b) in lanes: {values.size} values, seconds of a processor", seconds, peers, {})


if __name__ == "__main__":
    main()
