"""Returns of a motion to a section, as a sweep follows and measures them: what is asked of a flow or a map."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias

import numpy as np

from saltus import checks
from saltus.ensemble.returns import ManyReturns, Start
from saltus.errors import ChatteringError, DivergenceError, InputError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, tolerances_of
from saltus.flow.poincare import EventSection, PoincareReturns, admits, iterate
from saltus.flow.shares import shares_of
from saltus.flow.simulation import SimulationOptions, simulate
from saltus.flow.sizes import SMALL, fitting_atol, share_of, sizes_from, units_of
from saltus.flow.starting import phase_rate, starting_mode
from saltus.flow.variational import Average, Growth, frame_tolerance, growth_along
from saltus.sweeps.section import Section, on_section
from saltus.system import HybridSystem
from saltus.system.angles import TURN, on_circles, wrapped

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.flow.motion_kind import Kind
    from saltus.flow.recurring.criteria import Criteria
    from saltus.sweeps.options import SweepOptions

__all__ = ["FlowReturns", "Returns", "Settled"]

# parameters of a motion, its state and mode, and its mean time between returns
Settled: TypeAlias = "tuple[NDArray[np.float64], NDArray[np.float64], int, float]"

_FIRST = 16  # dropped returns that tell the mean return time

_LEAST_ABSENCE = 400.0  # `Criteria.absence` below which lanes do not wait as long for a return as is asked for
_STEPS_KEPT = 256  # steps of a motion that are kept in memory at once
_ON_A_SHEET = 50  # returns between which angles are moved back by whole turns
_FEWEST = 2  # returns that tell the time between them
_FADING = 0.5  # ratio of a state's size in the later half of the returns to the earlier, up to which it fades
_ATOL = 1e-10  # absolute tolerance of a step for states of size 1 or more


class Returns(Protocol):
    """What a sweep asks of the motions of a system.

    Attributes
    ----------
    faults : tuple of exception types
        Errors of a motion that give it the label ``diverged`` or, where events accumulate, ``chattering``.
    growth_error : float
        Error of a leading exponent per return that no longer time makes smaller.
    looks : int
        Looks at a motion that is in doubt, each `Criteria.patience` times as long as the one before.
    autonomous : bool
        Whether an exponent is 0 by itself, that of the flow's direction.
    """

    faults: ClassVar[tuple[type[Exception], ...]]
    looks: ClassVar[int]

    @property
    def growth_error(self) -> float:
        """See the class."""

    @property
    def autonomous(self) -> bool:
        """See the class."""

    def described(self) -> dict[str, Any]:
        """Return the settings as plain data."""

    def ready(self, vectors: Sequence[NDArray[np.float64]], *, given: bool) -> Returns:
        """Return the same with what follows from the first parameters that admit the start; raise `InputError`."""

    def load(self, p: NDArray[np.float64]) -> None:
        """Load the compiled functions, before threads ask for them."""

    def start(
        self, p: NDArray[np.float64], end: tuple[NDArray[np.float64], int] | None
    ) -> tuple[NDArray[np.float64], int]:
        """Return state and mode from which a motion starts that follows another one's end."""

    @property
    def unit(self) -> float:
        """Size that states are believed to have, 1 at most, before a motion shows it."""

    def settled(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, count: int) -> PoincareReturns:
        """Return returns after those that are dropped, fewer where the motion stops returning."""

    def fitting(self, p: NDArray[np.float64], found: PoincareReturns) -> Returns:
        """Return the same with tolerances that fit a settled motion; itself where they do."""

    def by_lanes(self, p: NDArray[np.float64], *, growing: bool) -> Returns | None:
        """Return the same that can follow motions side by side in lanes; None where there are no lanes.

        `growing`: whether perturbations of them, too.
        """

    def settled_together(self, starts: Sequence[Start | None], count: int) -> Sequence[PoincareReturns | None]:
        """Return for several motions what `settled` does, None for those that it has to follow alone."""

    def grown_together(self, settled: Sequence[Settled], count: int) -> Sequence[Growth | None]:
        """Return for several motions what `growth` does, None for those that it has to follow alone."""

    def mean_time(self, found: PoincareReturns) -> float:
        """Return the mean time between returns."""

    def growth(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, returns: int, time: float) -> Growth:
        """Return the growth of perturbations over some returns of a mean time."""

    def compared(
        self, p: NDArray[np.float64], found: PoincareReturns, time: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return states whose recurrence is looked at, and differences of them that are rounding."""

    def observed(
        self, parameters: Mapping[str, float], found: PoincareReturns, kind: Kind, observables: Sequence[str]
    ) -> list[float]:
        """Return observables of a motion."""

    def check_observables(self, observables: Sequence[str]) -> None:
        """Raise `InputError` where a name is no observable of a motion."""


@dataclass(frozen=True)
class FlowReturns:
    """Returns of a hybrid system's motions; `steady` is the system with the section among its transitions."""

    system: HybridSystem
    steady: HybridSystem
    section: tuple[int, ...] | None
    surface: str | Section | None
    x0: NDArray[np.float64]
    mode: str | None
    discard: int
    keep: int
    exponents: int
    criteria: Criteria
    rtol: float
    atol: float
    limit: float | None = None
    fits: bool = False  # whether the absolute tolerance is to fit the states
    many: ManyReturns | None = None
    growing: bool = False
    # the last of them where x0 is in no mode
    faults: ClassVar[tuple[type[Exception], ...]] = (ChatteringError, DivergenceError, StiffnessError, InputError)
    looks: ClassVar[int] = 3

    @classmethod
    def checked(cls, system: HybridSystem, x0: StateLike | None, options: SweepOptions) -> FlowReturns:
        """Return the returns of a system's motions after checks of the options that depend on it."""
        if options.mode is not None:
            checks.chosen("SweepOptions.mode", options.mode, system.mode_names)
        steady, places = on_section(system, options.section)
        rtol, atol = tolerances_of(options.tolerance)
        return cls(
            system=system,
            steady=steady,
            section=places,
            surface=options.section,
            x0=system.full_state(np.zeros(len(system.states)) if x0 is None else x0, mode=options.mode),
            mode=options.mode,
            discard=options.discard,
            keep=options.keep,
            exponents=options.exponents,
            criteria=options.criteria,
            rtol=rtol,
            atol=math.nan if atol is None else atol,
            limit=options.limit,
            fits=atol is None,
        )

    @property
    def unit(self) -> float:
        """Size of the least state for which the absolute tolerance is, 1 at most."""
        return min(self.atol / _ATOL, 1.0) if self.fits else 1.0

    @property
    def growth_error(self) -> float:
        """Tolerance of the frame that is carried along a motion: steps may turn and stretch it always alike."""
        return frame_tolerance(self.rtol)

    @property
    def autonomous(self) -> bool:
        """Whether the system has no phase."""
        return self.system.phase is None

    def described(self) -> dict[str, Any]:
        """Return the settings as plain data."""
        # files of sweeps without them go on to be resumed
        strobed = {"drive_repeats": self.system.drive_repeats} if self.system.drive_repeats > 1 else {}
        return (
            strobed
            | ({} if self.limit is None else {"limit": self.limit})
            | {
                "x0": self.x0.tolist(),
                "mode": self.mode,
                "section": asdict(self.surface) if isinstance(self.surface, Section) else self.surface,
                "rtol": self.rtol,
                "atol": self.atol,
            }
        )

    def ready(self, vectors: Sequence[NDArray[np.float64]], *, given: bool) -> FlowReturns:
        """Return the same with an absolute tolerance that fits the states, where none was given.

        Raises
        ------
        InputError
            No parameters admit the start; the reason is that of the first ones.
        """
        refusals = []
        for p in vectors:
            try:
                first = starting_mode(self.system, self.x0, p, self.mode)
                self._check_phase(p)
            except InputError as error:
                refusals.append(error)
                continue
            fitted = fitting_atol(self.system, p, self.x0, first, _ATOL) if math.isnan(self.atol) else self.atol
            return replace(self, atol=fitted)
        if given or self.mode is not None:
            raise refusals[0]
        raise InputError("x0", None, "given for this system: no mode holds where all states are 0") from refusals[0]

    def load(self, p: NDArray[np.float64]) -> None:
        """Load the compiled functions, before threads ask for them."""
        self._iterated(p, self.x0, 0, 0, 0, math.inf)

    def start(
        self, p: NDArray[np.float64], end: tuple[NDArray[np.float64], int] | None
    ) -> tuple[NDArray[np.float64], int]:
        """Return state and mode from which a motion starts that follows another one's end."""
        self._check_phase(p)
        if end is not None:
            x, mode = end
            if admits(self.system, p, x, mode):
                return end
            with suppress(InputError):
                return x, starting_mode(self.system, x, p)
        return self.x0, starting_mode(self.system, self.x0, p, self.mode)

    def settled(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, count: int) -> PoincareReturns:
        """Return the returns from which the kind follows, fewer where the motion stops returning."""
        dropped, unit = self.discard, math.inf if self.system.phase is None else self._period(p)
        if self.section is not None and dropped >= _FIRST:
            first = self._iterated(p, x, mode, _FIRST - 1, 1, self.criteria.absence * unit)
            if not first.times.size:
                return first
            x, mode, dropped = first.x_end, first.mode_end, dropped - _FIRST
            mean = float(first.times[0]) / _FIRST
            unit = mean if self.system.phase is None else max(mean, unit)
        return self._iterated(p, x, mode, dropped, count, self.criteria.absence * unit)

    def fitting(self, p: NDArray[np.float64], found: PoincareReturns) -> FlowReturns:
        """Return the same with a finer absolute tolerance where a state on the section and between stays far below it.

        A state that fades further is none that a tolerance could fit.
        """
        if not self.fits or len(found.times) < _FEWEST:
            return self
        count = len(self.system.states)
        seen = np.abs(found.states[:, :count])
        halves = [half.max(axis=0) for half in np.array_split(seen, 2)]
        small = (seen.max(axis=0) < SMALL * self.unit) & (halves[1] > _FADING * halves[0])
        if not small.any():
            return self
        run, time = self._run_for(p, found, self.mean_time(found)), self.mean_time(found)
        states = np.vstack([run.steps()[2], run.x, found.states[:, : run.x.size]])
        sizes = sizes_from(self.system, p, run.x, run.mode, states, time).of_states[:count]
        needed = share_of(sizes[small])
        return replace(self, atol=needed * _ATOL) if needed < SMALL * self.unit else self

    def by_lanes(self, p: NDArray[np.float64], *, growing: bool) -> FlowReturns | None:
        """Return the same that can follow motions side by side in lanes; None where there are no lanes."""
        if self.system.angles or self.criteria.absence < _LEAST_ABSENCE:
            return None
        interval = None
        if self.system.phase is None:
            interval = self._first_return(p)
            if interval is None:
                return None
        absence = 0.25 * self.criteria.absence
        tolerance = self.rtol, self.atol
        many = ManyReturns(self.steady, self.section, tolerance, interval, absence, self.exponents, self.limit)
        if not many.load():
            return None
        # where the phase goes on, lanes look at it alone, not at the returns to another section
        growing = growing and (self.section is None or self.system.phase is None)
        if growing:
            many.load_growth()
        return replace(self, many=many, growing=growing)

    def _first_return(self, p: NDArray[np.float64]) -> float | None:
        """Return the mean time of the first returns of the motion from `x0`; None where it has none."""
        try:
            mode = starting_mode(self.system, self.x0, p, self.mode)
            first = self._iterated(p, self.x0, mode, _FIRST - 1, 1, math.inf)
        except self.faults:
            return None
        return float(first.times[0]) / _FIRST if first.times.size else None

    def settled_together(self, starts: Sequence[Start | None], count: int) -> Sequence[PoincareReturns | None]:
        """Return for several motions what `settled` does, None for those that it has to follow alone."""
        found: list[PoincareReturns | None] = [None] * len(starts)
        if self.many is not None:
            those = {i: start for i, start in enumerate(starts) if start is not None}
            for i, returns in zip(those, self.many.follow(list(those.values()), self.discard, count), strict=True):
                found[i] = returns
        return found

    def grown_together(self, settled: Sequence[Settled], count: int) -> Sequence[Growth | None]:
        """Return for several motions what `growth` does, None for those that it has to follow alone."""
        if self.many is None or not self.growing:
            return [None] * len(settled)
        starts = [Start(p, x, mode, time) for p, x, mode, time in settled]
        return self.many.growth(starts, max(count // 4, 1), count)

    def mean_time(self, found: PoincareReturns) -> float:
        """Return the mean time between returns."""
        return float((found.times[-1] - found.times[0]) / (len(found.times) - 1))

    def growth(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, returns: int, time: float) -> Growth:
        """Return the growth of perturbations over some returns of a mean time."""
        aligned = max(returns // 4, 1)
        tolerances: dict[str, Any] = {"tolerance": (self.rtol, self.atol), "exponents": self.exponents}
        tolerances["limit"] = self.limit
        if self.section is None:
            return growth_along(
                self.system, p, x, mode, average=Average(periods=returns, discard=aligned), **tolerances
            )
        average = Average(t_end=returns * time, discard=aligned * time)
        return growth_along(self.system, p, x, mode, average=average, **tolerances)

    def compared(
        self, p: NDArray[np.float64], found: PoincareReturns, time: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return states whose recurrence is looked at, in their sizes, and differences of them that are rounding."""
        sizes, rounding = self._sizes(p, found, time)
        units, n = np.ones(sizes.size), len(self.system.states)
        units[:n] = units_of(sizes[:n], rounding[:n], self.system.angle_places)
        states, rounding = found.states / units, rounding / units
        if self.system.phase is not None:
            angle = states[:, -1:] * (TURN / self.steady.turn)
            round_ = () if self.section is None else (np.cos(angle), np.sin(angle))
            states = np.hstack([states[:, :-1], *round_])
            rounding = np.append(rounding[:-1], [self.criteria.noise * (self.atol + self.rtol)] * len(round_))
        return on_circles(states, rounding, self.system.angle_places)

    def observed(
        self, parameters: Mapping[str, float], found: PoincareReturns, kind: Kind, observables: Sequence[str]
    ) -> list[float]:
        """Return observables over the period of a periodic motion, else over the time of the returns kept."""
        from saltus.flow.observables import observe, unheard

        multiple = math.lcm(*(order.denominator for order in self._orders(observables)))
        time = self.mean_time(found) * (kind.period or self.keep)
        how_long: dict[str, Any] = {"t_end": time}
        p = self.system.parameter_vector(parameters)
        if self.system.phase is not None:
            period = self._period(p)
            how_long = {"periods": multiple * math.ceil(time / period / multiple - 1e-6)}
        name = self.system.mode_names[found.mode_end]
        how_long |= {"tolerance": self._simulated(p), "options": SimulationOptions(limit=self.limit)}
        motion = simulate(self.system, parameters, found.x_end, mode=name, **how_long).motion()
        return list(observe(motion, observables, unheard).values())

    def check_observables(self, observables: Sequence[str]) -> None:
        """Raise `InputError` where a name is no observable of a motion."""
        for name in observables:
            if any(order.denominator > 1 for order in self._orders([name])) and self.system.phase is None:
                raise InputError("observable", name, "of a whole order for a system without a phase")

    def _orders(self, observables: Sequence[str]) -> list[Fraction]:
        """Return the orders of the harmonics among observables."""
        from saltus.flow.formulas import read_formula

        parts = [part for name in observables for part in read_formula(self.system, name).parts.values()]
        return [part.order for part in parts if part.order is not None]

    def _iterated(
        self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, discard: int, keep: int, longest: float
    ) -> PoincareReturns:
        """Return the returns of a motion; none for one without a phase that takes too many steps without a return."""
        section = None if self.section is None else EventSection(self.section, longest)
        places = self.system.angle_places
        how: dict[str, Any] = {"section": section, "tolerance": (self.rtol, self.atol), "limit": self.limit}
        try:
            while places.size and discard >= _ON_A_SHEET:  # an angle that has grown is known less exactly
                gone = iterate(self.steady, p, x, mode, discard=_ON_A_SHEET - 1, keep=1, **how)
                if not gone.times.size:
                    return gone
                x, mode, discard = wrapped(gone.x_end, places), gone.mode_end, discard - _ON_A_SHEET
            found = iterate(self.steady, p, x, mode, discard=discard, keep=keep, **how)
            return replace(found, x_end=wrapped(found.x_end, places)) if places.size else found
        except StiffnessError as error:
            if self.system.phase is not None:
                raise
            none, state = np.empty((0, len(self.steady.all_states))), np.array(error.state)
            return PoincareReturns(none, np.empty(0, np.int64), np.empty(0), state, self.steady.mode_index(error.mode))

    def _check_phase(self, p: NDArray[np.float64]) -> None:
        """Raise `InputError` where there is a phase that does not go on."""
        if self.system.phase is not None:
            phase_rate(self.system, p, self.x0, 0)

    def _period(self, p: NDArray[np.float64]) -> float:
        """Period of the drive."""
        return self.system.turn / phase_rate(self.system, p, self.x0, 0)

    def _sizes(
        self, p: NDArray[np.float64], found: PoincareReturns, time: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the sizes of full states over a mean return, and the differences that are rounding."""
        run = self._run_for(p, found, time)
        sizes = np.abs(run.steps()[2]).max(axis=0)
        sizes[self.system.angle_places] = np.minimum(sizes[self.system.angle_places], math.pi)
        return sizes, np.asarray(self.criteria.noise * (self.atol + self.rtol * sizes))

    def _run_for(self, p: NDArray[np.float64], found: PoincareReturns, time: float) -> EventDrivenMotion:
        """Return the motion that goes on for some time, with its steps."""
        run = EventDrivenMotion(
            self.system, p, found.x_end.copy(), found.mode_end, self.rtol, self.atol, steps_kept=_STEPS_KEPT,
            limit=self.limit,
        )  # fmt: skip
        run.follow(time, None, None)
        return run

    def _simulated(self, p: NDArray[np.float64]) -> float | tuple[float, float]:
        """Return the tolerance of `simulate`: states without a share of the absolute one have none there either."""
        relative = self.fits and bool((shares_of(self.system.compiled, p)[: len(self.system.states)] < 1.0).any())
        return self.rtol if relative else (self.rtol, self.atol)
