"""Lyapunov exponents of a motion of a hybrid system or a map: docs/theory/lyapunov.md derives the formulas."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.flow.motion import tolerances_of
from saltus.flow.sizes import ATOL, fitting_atol
from saltus.flow.starting import starting_mode
from saltus.flow.variational import BATCHES, CONFIDENCE, Average, Growth, frame_tolerance, growth_along
from saltus.maps.growth import growth_of_map
from saltus.result import Result, frozen
from saltus.sweeps.unconverged import unconverged
from saltus.system import HybridSystem, Map
from saltus.system.maps import flowing
from saltus.system.plain import held_any, held_parameters
from saltus.work import interrupt_noted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike

__all__ = ["LyapunovSpectrum", "lyapunov_spectrum"]

_SHOWN = 8  # exponents that a `repr` lists


@dataclass(frozen=True, eq=False, repr=False)
class LyapunovSpectrum(Result):
    """Lyapunov exponents of a motion, per unit of time, and the logarithms of growth behind them.

    A forced system has one for each state without the phase. An autonomous one has 0 among them, for the direction of
    its flow, unless it rests. A map has one for each state, per iteration; its times count iterations.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float
        All its parameters.
    exponents : ndarray, shape (exponent,)
        Largest first. ``-inf``: a reset of lower rank or a sliding motion removes a direction. ``nan``: a Jacobian is
        not finite.
    errors : ndarray, shape (exponent,)
        Half widths of their intervals. They are of 95 % confidence, by the spread of batch means. They are wider where
        a bounded term, a drift of the rate, or the tolerance asks for it. Infinite: the rate drifts, and no limit can
        be told.
    times : ndarray, shape (row,)
        Ends of the stretches of the motion, from the end of the discarded time.
    logs : ndarray, shape (row, exponent)
        Logarithms of the growth in each stretch.
    discarded : float
        Time before the first stretch.
    x_end : ndarray, shape (all states,)
        Full state at the end.
    mode_end : str
        Mode there, or piece of a map.
    grazed : int
        Events that were grazed: no saltation matrix exists there, and none was applied.
    tolerance : (float, float)
        Relative and absolute tolerance of a step of the motion; 0 for a map.
    stopped : str
        Whether all stretches were done, or an interrupt (Ctrl-C) came before.

    Examples
    --------
    >>> import saltus
    >>> oscillator = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 1.0})
    >>> spectrum = saltus.lyapunov_spectrum(oscillator, x0=[2.0, 0.0], average=saltus.Average(t_end=500.0))
    >>> bool(abs(spectrum.exponents[0]) < 0.01), bool(spectrum.exponents[1] < -1.0)
    (True, True)
    """

    system: HybridSystem | Map
    parameters: Mapping[str, float]
    exponents: NDArray[np.float64]
    errors: NDArray[np.float64]
    times: NDArray[np.float64]
    logs: NDArray[np.float64]
    discarded: float
    x_end: NDArray[np.float64]
    mode_end: str
    grazed: int
    tolerance: tuple[float, float]
    stopped: str = "all stretches done"

    def __post_init__(self) -> None:
        for name in ("exponents", "errors", "times", "logs", "x_end"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "parameters", checks.named_values("parameter", self.parameters))

    @property
    def running(self) -> NDArray[np.float64]:
        """Estimates from the start to each of `times`, shape (row, exponent)."""
        return np.asarray(np.cumsum(self.logs, axis=0) / self.times[:, None])

    @property
    def period(self) -> float:
        """Period of the drive; 1 for a map.

        Raises
        ------
        InputError
            The system has no phase.
        """
        if self.system.iteration is not None:
            return self.system.iteration
        if self.system.phase is None:
            raise InputError("system", self.system.name, "one with a phase", "its exponents are per unit of time only")
        rate = flowing(self.system).field(self.mode_end, self.x_end, parameters=self.parameters)[-1]
        return flowing(self.system).turn / float(rate)

    @property
    def per_period(self) -> NDArray[np.float64]:
        """Exponents times the period of the drive: those of the stroboscopic map, shape (exponent,)."""
        return np.asarray(self.exponents * self.period)

    @property
    def sum(self) -> float:
        """Sum of the exponents: the rate at which volumes grow, if all of them were measured."""
        return float(self.exponents.sum())

    @property
    def kaplan_yorke(self) -> float:
        """Kaplan-Yorke dimension: k plus the sum of the first k exponents over the size of the next one.

        The k is the largest whose sum is not negative.

        The dimension belongs to the attractor in the space of the states; for a forced system, to its section at a
        phase. A sum within its error of zero counts as zero, as on a limit cycle. ``nan``: too few exponents were
        measured. See docs/theory/lyapunov.md, "Dimension".

        References
        ----------
        J. L. Kaplan, J. A. Yorke, Chaotic behavior of multidimensional difference equations, Lect. Notes Math. 730
        (1979) 204-227.
        """
        sums, errors = np.cumsum(self.exponents), np.cumsum(self.errors)
        below = np.nonzero(sums < -errors)[0]
        if below.size == 0:
            n = self.exponents.size
            return float(n) if n == len(self.system.states) else math.nan
        k = int(below[0])
        if k == 0 or sums[k - 1] <= errors[k - 1]:
            return float(k)
        return k - float(sums[k - 1] / self.exponents[k])

    def __repr__(self) -> str:
        title = repr(self.system.name) if self.system.name else "a system"
        span = self.system.span.format(self.times[-1])
        if self.system.phase is not None:
            span += f" ({self.times[-1] / self.period:.6g} periods of {self.system.phase[0]})"
        lines = [f"LyapunovSpectrum of {title} over {span}, after {self.discarded:.6g} discarded"]
        for value, error in list(zip(self.exponents, self.errors, strict=True))[:_SHOWN]:
            if not math.isfinite(value):
                lines.append("  -inf")
            elif error == math.inf:
                lines.append(f"  {value:+.6g}, unresolved: its rate drifts")
            else:
                lines.append(f"  {value:+.6g} +- {error:.1g}")
        if self.exponents.size > _SHOWN:
            lines.append(f"  and {self.exponents.size - _SHOWN} more")
        if self.exponents.size == len(self.system.states):
            lines.append(f"  sum {self.sum:+.6g}, Kaplan-Yorke dimension {self.kaplan_yorke:.4g}")
        if self.grazed:
            events = "event" if self.grazed == 1 else "events"
            lines.append(f"  {self.grazed} {events} grazed, passed without a saltation matrix")
        if "interrupted" in self.stopped:
            lines.append(f"  {self.stopped}")
        return "\n".join(lines)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset with dimensions exponent, row and state; rates are per unit of time."""
        from saltus.extras import xr

        unit = self.system.rate_unit
        meaning = f"half width of the {CONFIDENCE:.0%} confidence interval, from at most {BATCHES} batch means"
        return xr.Dataset(
            {
                "exponent": ("exponent", np.array(self.exponents), {"unit": unit}),
                "error": ("exponent", np.array(self.errors), {"unit": unit, "meaning": meaning}),
                "log_growth": (("row", "exponent"), np.array(self.logs)),
                "x_end": ("state", np.array(self.x_end)),
            },
            coords={"time": ("row", np.array(self.times)), "state": list(self.system.all_states)},
            attrs={
                "definition": json.dumps(self.system.definition()),
                "parameters": json.dumps(dict(self.parameters)),
                "discarded": self.discarded,
                "mode_end": self.mode_end,
                "grazed": self.grazed,
                "rtol": self.tolerance[0],
                "atol": self.tolerance[1],
                "stopped": self.stopped,
            },
        )

    @classmethod
    def _read(cls, held: Contents) -> LyapunovSpectrum:
        system = held_any(held)
        held.names("state", system.all_states)
        held.size("row", least=1)
        if held.size("exponent", least=1) > len(system.states):
            raise InputError("dimension 'exponent'", held.size("exponent"), f"at most {len(system.states)}")
        return cls(
            system,
            held_parameters(held, system),
            held.array("exponent", ("exponent",), finite=False),
            held.array("error", ("exponent",), finite=False),
            held.array("time", ("row",), least=0.0),
            held.array("log_growth", ("row", "exponent"), finite=False),
            held.number("discarded", least=0.0),
            held.array("x_end", ("state",)),
            system.mode_names[system.mode_index(held.text("mode_end"))],
            held.count("grazed"),
            (held.number("rtol", least=0.0), held.number("atol", least=0.0)),
            held.text("stopped") if "stopped" in held.dataset.attrs else "all stretches done",
        )


def lyapunov_spectrum(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    average: Average,
    mode: str | None = None,
    exponents: int | None = None,
    tolerance: float | tuple[float, float] = 1e-10,
) -> LyapunovSpectrum:
    """Return the Lyapunov exponents of the motion from a state, once it has settled.

    The variational equations carry an orthonormal frame along the motion, and the saltation matrix carries it over each
    event. After every step and event the frame is made orthonormal again. An exponent is the mean rate at which the
    logarithm of a direction's length grows. The phase is not perturbed. For a map, derivatives of its pieces take the
    place of both, and exponents are per iteration.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float, optional
        Values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,), or mapping of str to float
        State at time 0; without the phase it starts at phase 0.
    average : Average
        How long the exponents are measured, and how long motion and frame settle before. Its `periods` are the
        iterations of a map.
    mode : str, optional
        Mode at time 0; chosen as in `simulate`. A map has none.
    exponents : int, optional
        How many exponents, the largest ones; by default all.
    tolerance : float or (float, float), optional
        Relative tolerance of a step of the motion, or the relative and the absolute one. The frame's tolerance is 1000
        times the relative one, at most 1e-4. The default absolute tolerance is 1e-12, and smaller in proportion to the
        smallest state where this is below 1e-2. A map has no steps, and needs none.

    Returns
    -------
    LyapunovSpectrum
        The exponents with their errors. An interrupt (Ctrl-C) keeps the stretches that are done.

    Raises
    ------
    InputError
        An argument that cannot be used.
    ChatteringError
        Events accumulate.
    DivergenceError
        The state leaves every bound, or the domain of its mode.
    DefinitionError
        A motion of a map comes to a state at which no piece holds, or several do.

    Notes
    -----
    The error of a logarithm of growth does not grow with time. Estimates for a periodic motion therefore approach
    ``log|mu| / T`` like 1/time. For a chaotic motion the spread of batch means falls like 1/sqrt(time). Where a motion
    settles like a power of time, rates drift, and the interval holds the limit of the drift
    (`saltus.sweeps.unconverged`). Where the mean stay of an intermittent motion cannot be told to have a limit, the
    interval holds 0.

    References
    ----------
    G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth dynamical
    systems and for Hamiltonian systems, Meccanica 15 (1980) 9-30; P. C. Müller, Calculation of Lyapunov exponents for
    dynamic systems with discontinuities, Chaos, Solitons & Fractals 5 (1995) 1671-1681.

    Examples
    --------
    The switched flow of Chase, Serrano and Ramadge: one of three tanks is filled, all drain, and the first that is
    empty is filled next. Its exponent is ln 2 in every 3/4 units of time, all of it from saltation.

    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> tanks = ("a", "b", "c")
    >>> server = HybridSystem(
    ...     states=tanks,
    ...     parameters={"rate": 1 / 3},
    ...     modes={f"fill_{i}": Mode({j: "1 - rate" if i == j else "-rate" for j in tanks}) for i in tanks},
    ...     transitions=[Transition(f"fill_{i}", f"fill_{j}", j, -1) for i in tanks for j in tanks if i != j],
    ...     name="three tanks",
    ... )
    >>> found = lyapunov_spectrum(server, None, [0.2, 0.3, 0.5], mode="fill_a", average=Average(t_end=2000.0))
    >>> print(round(found.exponents[0], 2))
    0.92
    """
    checks.instance("average", average, Average)
    with interrupt_noted() as interrupted:
        growth, (rtol, atol) = _growth(system, parameters, x0, mode, (average, exponents, tolerance), interrupted)
        rounding = frame_tolerance(rtol) * _fastest(system, parameters, growth)
        errors = np.maximum(growth.errors, unconverged(growth.times, growth.logs, growth.discarded, rounding))
    done = f"interrupted: {growth.times.size} stretches done" if interrupted else "all stretches done"
    return LyapunovSpectrum(
        system=system,
        parameters=system.resolve(parameters),
        exponents=growth.exponents,
        errors=errors,
        times=growth.times,
        logs=growth.logs,
        discarded=growth.discarded,
        x_end=growth.x_end,
        mode_end=system.mode_names[growth.mode_end],
        grazed=growth.grazed,
        tolerance=(rtol, atol),
        stopped=done,
    )


@singledispatch
def _fastest(system: HybridSystem | Map, parameters: Mapping[str, float] | None, growth: Growth) -> float:
    """Return the fastest rate at the end of a motion, which makes a frame's tolerance a rate; 0 where none is known."""
    system = flowing(system)
    p = system.compiled.extended(system.parameter_vector(parameters))
    jacobian = system.compiled.linearised(growth.mode_end, np.array(growth.x_end), p)[1]
    return float(np.abs(np.linalg.eigvals(jacobian)).max()) if np.isfinite(jacobian).all() else 0.0


@_fastest.register(Map)
def _fastest_of_map(system: Map, parameters: Mapping[str, float] | None, growth: Growth) -> float:
    return 0.0


@singledispatch
def _growth(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None,
    x0: StateLike,
    mode: str | None,
    options: tuple[Average, int | None, float | tuple[float, float]],
    interrupted: Sequence[float],
) -> tuple[Growth, tuple[float, float]]:
    """Return the growth along a motion, and the tolerances of its steps."""
    average, exponents, tolerance = options
    system = flowing(system)
    p = system.parameter_vector(parameters)
    x = system.full_state(x0, mode=mode)
    start = starting_mode(system, x, p, mode)
    rtol, absolute = tolerances_of(tolerance)
    atol = absolute if absolute is not None else fitting_atol(system, p, x, start, ATOL)
    tolerances = (rtol, atol)
    measured: dict[str, Any] = {"average": average, "exponents": exponents, "interrupted": interrupted}
    return growth_along(system, p, x, start, **measured, tolerance=tolerances), tolerances


@_growth.register(Map)
def _growth_of_map(
    system: Map,
    parameters: Mapping[str, float] | None,
    x0: StateLike,
    mode: object,
    options: tuple[Average, int | None, object],
    interrupted: Sequence[float],
) -> tuple[Growth, tuple[float, float]]:
    if mode is not None:
        raise InputError("mode", mode, "left out for a map", "the state decides which piece holds")
    average, exponents, _ = options
    p = system.parameter_vector(parameters)
    measured: dict[str, Any] = {"average": average, "exponents": exponents, "interrupted": interrupted}
    return growth_of_map(system, p, system.full_state(x0), **measured), (0.0, 0.0)
