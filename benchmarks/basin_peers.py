"""The paper's basins at Omega = 1.15, cells of their figures, and motions of them by other means than lanes.

By SciPy, from equations written down here; by this package's event-driven flow, one motion at a time; by heyoka.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

import saltus
from saltus import afm
from saltus.afm.paper.figures import fig8, fig9, fig10, sections
from saltus.afm.paper.galerkin import coefficients
from saltus.basins import Attractors, Grid, find_attractors
from saltus.basins.map.labelling import TOLERANCE
from saltus.ensemble.ensemble import Ensemble, regions_of
from saltus.ensemble.kernels.lanes import fate
from saltus.ensemble.traps import UNDECIDED, Traps
from saltus.flow.poincare import iterate
from saltus.flow.starting import starting_mode
from saltus.options import AttractorOptions

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLIGHT, CONTACT = 0, 1

LANES = 8
"""Motions that heyoka has in hand at once: the doubles of a vector of AVX-512."""

FOREVER = 1e9
"""Of heyoka's own time, at whose end no motion arrives."""


@dataclass(frozen=True)
class Model:
    """Tapping mode with the paper's parameters of Figs. 8 to 10, and its attractors."""

    system: saltus.HybridSystem
    attractors: Attractors

    @property
    def p(self) -> NDArray[np.float64]:
        """The parameters in the system's order."""
        return self.system.parameter_vector(sections.PARAMETERS)

    @property
    def traps(self) -> Traps:
        """The trapping regions."""
        return self.attractors.traps

    def ensemble(self, tolerance: float = TOLERANCE, threads: int | None = None) -> Ensemble:
        """Many motions at once, as `map_basins` follows them."""
        return Ensemble(self.system, sections.PARAMETERS, tolerance=tolerance, threads=threads)

    def start(self, x: NDArray[np.float64]) -> int:
        """Return the mode in which a motion starts at phase 0."""
        return starting_mode(self.system, self.system.full_state(x), self.p)


@cache
def tapping(modes: int = 2) -> Model:
    """Return the model, with one mode of the cantilever or two."""
    system = sections.model(modes)
    region = dict.fromkeys(system.states, sections.RANGE)
    # trapping regions as `map_basins` makes them for a plane: measured as well as the labels of its cells are worth
    return Model(
        system,
        find_attractors(system, sections.PARAMETERS, region, options=AttractorOptions(motions=sections.RESOLUTION**2)),
    )


def grids(resolution: int = sections.RESOLUTION) -> dict[str, tuple[int, Grid]]:
    """Return the grids of Figs. 8 to 10 and of the whole box by name, each with its number of cantilever modes."""
    axis = (*sections.RANGE, resolution)
    plane: dict[str, Any] = {"q1": axis, "v1": axis}
    axes: dict[str, tuple[int, dict[str, Any]]] = {
        "Fig. 9, one mode": (1, plane),
        "Fig. 9": (2, plane | dict(fig9.SECOND)),
        **{f"Fig. 10, q2 = {q2:g}": (2, plane | {"q2": q2, "v2": fig10.V2}) for q2 in fig10.SECTIONS},
        "Fig. 8": (2, plane | {"q2": axis, "v2": fig8.V2}),
        "[-5, 5]^4": (2, plane | {"q2": axis, "v2": axis}),
    }
    return {name: (modes, Grid(sections.model(modes).states, ranges)) for name, (modes, ranges) in axes.items()}


def cells_of(grid: Grid, count: int, seed: int | Sequence[int]) -> NDArray[np.float64]:
    """Return the centres of random cells, shape (count, n)."""
    return grid.at(np.random.default_rng(seed).integers(0, grid.shape, (count, len(grid.shape))))


def states_of_box(count: int, seed: int) -> NDArray[np.float64]:
    """Return random states of the box [-5, 5]^4, shape (count, 4)."""
    return np.random.default_rng(seed).uniform(*sections.RANGE, (count, 4))


Period = Callable[["NDArray[np.float64]", int], "tuple[NDArray[np.float64], int]"]
"""Takes a state at phase 0 without the phase, and its mode, a period on."""


def until_trapped(period: Period, x: NDArray[np.float64], mode: int, traps: Traps) -> int:
    """Return the label of the first trap that a motion is in at phase 0."""
    while (label := traps.of(x, mode)) == UNDECIDED:
        x, mode = period(x, mode)
    return label


# ---- this package, one motion at a time ----


@dataclass(frozen=True)
class EventDriven:
    """The event-driven flow of some periods, as a `Period` that can be sent to another process."""

    system: saltus.HybridSystem
    p: NDArray[np.float64]
    tolerance: float
    periods: int = 1

    def __call__(self, x: NDArray[np.float64], mode: int) -> tuple[NDArray[np.float64], int]:
        """Return state and mode after these periods."""
        full = self.system.full_state(x)
        options = {"discard": self.periods - 1, "keep": 1, "tolerance": (self.tolerance, self.tolerance)}
        found = iterate(self.system, self.p, full, mode, **options)
        return found.states[0, : x.size], int(found.modes[0])


# ---- SciPy ----


@njit(cache=True)
def _field(t, x, contact, K, B, C, G, a0, D, Omega, ybar):
    """Eq. (12) of the paper with two modes, in flight or in contact; D is the damping there."""
    swing = ybar * math.sin(Omega * t)
    z = 1.0 - x[0] - x[1] - swing
    force = C / a0**2 + G * max(a0 - z, 0.0) ** 1.5 if contact else C / z**2
    out = np.empty(4)
    for i in range(2):
        out[i] = x[2 + i]
        out[2 + i] = -D * x[2 + i] - K[i] * x[i] + C - force + B[i] * Omega**2 * swing
    return out


@njit(cache=True)
def _height(t, x, contact, K, B, C, G, a0, D, Omega, ybar):
    return 1.0 - x[0] - x[1] - ybar * math.sin(Omega * t) - a0


def by_scipy(rtol: float, largest: float = math.inf) -> Period:
    """Return a period by SciPy's DOP853 from event to event, with steps no longer than `largest`."""
    events = {FLIGHT: _falling, CONTACT: _rising}
    constants = {mode: (mode == CONTACT, *_constants(mode)) for mode in events}
    end = 2.0 * math.pi / sections.PARAMETERS["Omega"]

    def advance(x: NDArray[np.float64], mode: int) -> tuple[NDArray[np.float64], int]:
        t = 0.0
        while t < end:
            flown = solve_ivp(
                _field, (t, end), x, "DOP853", rtol=rtol, atol=rtol, max_step=largest, events=events[mode],
                args=constants[mode],
            )  # fmt: skip
            t, x = float(flown.t[-1]), flown.y[:, -1]
            mode = 1 - mode if flown.status == 1 else mode
        return x, mode

    return advance


def _falling(t: float, x: NDArray[np.float64], *constants: Any) -> float:
    return float(_height(t, x, *constants))


def _rising(t: float, x: NDArray[np.float64], *constants: Any) -> float:
    return float(_height(t, x, *constants))


_falling.terminal = _rising.terminal = True  # type: ignore[attr-defined]
_falling.direction, _rising.direction = -1.0, 1.0  # type: ignore[attr-defined]


@cache
def _constants(mode: int) -> tuple[Any, ...]:
    setup, values = afm.table1(), sections.model(2).resolve(sections.PARAMETERS)
    c = coefficients(setup.cantilever, setup.sample, setup.eta, 2)
    damping = values["D_rep_1"] if mode == CONTACT else values["D_att_1"]
    return np.array(c.K), np.array(c.B), c.C, c.G, c.a0_bar, damping, values["Omega"], values["ybar"]


# ---- heyoka ----


class Heyoka:
    """A batch of motions by heyoka, a motion that ends being replaced by the next.

    A batch has one vector field, so both modes are one text with the side of the surface as a parameter, regularised:
    ``dt = w dsigma``, ``w = sqrt|z - a0|``. In ordinary time the contact force has no Taylor series at the surface. The
    surface and the end of a period are terminal events, at which Python's callbacks change side and look into the
    traps.

    Parameters
    ----------
    model : Model
        With two modes.
    tolerance : float
        Of a step.

    Raises
    ------
    ImportError
        heyoka is not installed.
    """

    def __init__(self, model: Model, tolerance: float) -> None:
        import heyoka as hy

        hy.set_logger_level_critical()  # it warns at every step near the surface
        self.integrator = hy.taylor_adaptive_batch(
            _regularised(hy), np.zeros((6, LANES)), pars=np.ones((1, LANES)), tol=tolerance, t_events=self._events(hy)
        )
        self.regions = tuple(regions_of(model.traps, 4))
        self.fates = np.full(LANES, UNDECIDED)
        self.trapping = True

    def settle(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the labels of motions that start at phase 0, shape (m,)."""
        labels = np.full(len(points), UNDECIDED, np.uint8)
        self.trapping = True
        for i, lane in self._ended(points):
            labels[i] = self.fates[lane]
        return labels

    def strobe(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states a period on, shape (m, 4)."""
        ends = np.empty_like(points)
        self.trapping = False
        for i, lane in self._ended(points):
            ends[i] = self.integrator.state[:4, lane]
        return ends

    def _ended(self, points: NDArray[np.float64]) -> Any:
        """Go through motions as they end: the number of each, and the lane it is in."""
        waiting, held = list(range(len(points)))[::-1], [-1] * LANES
        for lane in range(LANES):
            held[lane] = waiting.pop() if waiting else -1
            self._put(points[held[lane]], lane)
        while max(held) >= 0:
            self.integrator.set_time(0.0)
            self.integrator.propagate_until(FOREVER)
            for lane in np.flatnonzero(self.fates != UNDECIDED):
                if held[lane] >= 0:
                    yield held[lane], lane
                held[lane] = waiting.pop() if waiting else -1
                self._put(points[held[lane]], lane)

    def _put(self, x: NDArray[np.float64], lane: int) -> None:
        height = 1.0 - x[0] - x[1] - _constants(FLIGHT)[4]
        self.integrator.pars[0, lane] = math.copysign(1.0, height)
        self.integrator.state[:, lane] = (*x, 0.0, math.sqrt(abs(height)))
        self.integrator.reset_cooldowns(lane)
        self.fates[lane] = UNDECIDED

    def _events(self, hy: ModuleType) -> list[Any]:
        theta, w = hy.make_vars("theta", "w")

        def surface(integrator: Any, sign: int, lane: int) -> bool:
            integrator.pars[0, lane] *= -1.0
            integrator.state[5, lane] = 0.0
            return True

        def strobe(integrator: Any, sign: int, lane: int) -> bool:
            state = integrator.state
            state[4, lane] -= 2.0 * math.pi
            mode = FLIGHT if integrator.pars[0, lane] > 0.0 else CONTACT
            label = fate(state[:4, lane], mode, 1e6, *self.regions) if self.trapping else 0
            self.fates[lane] = label
            return bool(label == UNDECIDED)

        return [
            hy.t_event_batch(w, callback=surface, direction=hy.event_direction.negative),
            hy.t_event_batch(theta - 2.0 * math.pi, callback=strobe, direction=hy.event_direction.positive),
        ]


def _regularised(hy: ModuleType) -> list[Any]:
    q1, q2, v1, v2, theta, w = hy.make_vars("q1", "q2", "v1", "v2", "theta", "w")
    side = hy.par[0]
    aloft, below = (1.0 + side) / 2.0, (1.0 - side) / 2.0
    K, B, C, G, a0, D_att, Omega, ybar = _constants(FLIGHT)
    D_rep = _constants(CONTACT)[5]
    swing = ybar * hy.sin(theta)
    # w^3 as w (a0 - z): heyoka's power divides by w, which vanishes at the surface
    force = aloft * C / (a0 + w * w) ** 2 + below * (C / a0**2 + G * w * (a0 - 1.0 + q1 + q2 + swing))
    damping = aloft * D_att + below * D_rep
    rates = [
        -damping * v - float(k) * q + C - force + float(b) * Omega**2 * swing
        for q, v, k, b in zip((q1, q2), (v1, v2), K, B, strict=True)
    ]
    rise = -(v1 + v2) - ybar * Omega * hy.cos(theta)
    return [
        (q1, w * v1), (q2, w * v2), (v1, w * rates[0]), (v2, w * rates[1]), (theta, Omega * w), (w, side * rise / 2.0)
    ]  # fmt: skip
