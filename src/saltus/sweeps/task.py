"""The task of a brute-force diagram at one value: follow the motion, label it, and measure it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.errors import ChatteringError, DivergenceError, InputError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, starting_mode, tolerances_of
from saltus.flow.motion_kind import DIVERGED, NO_RETURN, QUASI_PERIODIC, Criteria, Kind, classify
from saltus.flow.poincare import EventSection, Iterates, admits, iterate
from saltus.flow.simulation import simulate
from saltus.flow.sizes import fitting_atol
from saltus.flow.variational import Average, Growth, growth_along
from saltus.sweeps.options import SweepOptions
from saltus.sweeps.section import Section, on_section
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Row", "Task"]

_FIRST = 16  # dropped returns that tell the mean return time

_STEPS_KEPT = 256  # steps of a motion that are kept in memory at once
_ATOL = 1e-10  # absolute tolerance of a step for states of size 1 or more


@dataclass(frozen=True)
class Row:
    """Results at one value."""

    label: str
    reason: str = ""
    points: NDArray[np.float64] | None = None
    kind: Kind | None = None
    exponents: NDArray[np.float64] | None = None
    errors: NDArray[np.float64] | None = None
    return_time: float = math.nan
    observed: Sequence[float] = ()
    state: NDArray[np.float64] | None = None
    mode: int = -1

    @property
    def end(self) -> tuple[NDArray[np.float64], int] | None:
        """State and mode from which the motion goes on."""
        return None if self.state is None else (self.state, self.mode)


class _Seen(NamedTuple):
    """Returns of a motion, growth of its perturbations (None without returns), and its kind."""

    found: Iterates
    growth: Growth | None
    kind: Kind


@dataclass(frozen=True)
class Task:
    """The task at each value; `steady` is the system with the section among its transitions."""

    system: HybridSystem
    steady: HybridSystem
    section: tuple[int, ...] | None
    parameter: str
    parameters: Mapping[str, float]
    x0: NDArray[np.float64]
    mode: str | None
    discard: int
    keep: int
    quantities: tuple[str, ...]
    observables: tuple[str, ...]
    exponents: int
    criteria: Criteria
    rtol: float
    atol: float
    settings: Mapping[str, Any]

    @classmethod
    def checked(
        cls,
        system: HybridSystem,
        parameter: str,
        values: NDArray[np.float64],
        parameters: Mapping[str, float] | None,
        x0: ArrayLike | None,
        options: SweepOptions,
    ) -> Task:
        """Return the task after checks of all input."""
        checks.instance("system", system, HybridSystem)
        checks.chosen("parameter", parameter, (*system.parameter_names, *system.groups))
        base = system.resolve(parameters)
        for value in values.tolist():
            system.resolve({**base, parameter: value})
        if options.mode is not None:
            checks.chosen("SweepOptions.mode", options.mode, system.mode_names)
        steady, places = on_section(system, options.section)
        checks.size("SweepOptions.keep", options.keep, 1, checks.LARGEST_LIST // values.size)
        checks.count("SweepOptions.exponents", options.exponents, 1, len(system.states), "the states")
        rtol, atol = tolerances_of(options.tolerance)
        task = cls(
            system=system,
            steady=steady,
            section=places,
            parameter=parameter,
            parameters=base,
            x0=system.full_state(np.zeros(len(system.states)) if x0 is None else x0),
            mode=options.mode,
            discard=options.discard,
            keep=options.keep,
            quantities=tuple(system.states if options.quantities is None else options.quantities),
            observables=tuple(options.observables),
            exponents=options.exponents,
            criteria=options.criteria,
            rtol=rtol,
            atol=_ATOL if atol is None else atol,
            settings={},
        )
        p, first = _checked_start(task, values, given=x0 is not None)
        if atol is None:
            task = replace(task, atol=fitting_atol(system, p, task.x0, first, _ATOL))
        _check_expressions(task)
        settings = task._described(options.section) | {"follow": options.follow, "chunks": options.chunks}
        return replace(task, settings=settings)

    def _described(self, section: str | Section | None) -> dict[str, Any]:
        return {
            "x0": self.x0.tolist(),
            "mode": self.mode,
            "discard": self.discard,
            "keep": self.keep,
            "section": asdict(section) if isinstance(section, Section) else section,
            "exponents": self.exponents,
            "criteria": asdict(self.criteria),
            "rtol": self.rtol,
            "atol": self.atol,
        }

    def load(self, value: float) -> None:
        """Load the compiled functions, before threads ask for them."""
        p = self.system.parameter_vector({**self.parameters, self.parameter: value})
        self._iterated(p, self.x0, 0, 0, 0, math.inf)

    def row(self, value: float, end: tuple[NDArray[np.float64], int] | None) -> Row:
        """Return the results at a value; the motion starts from its end at the value before."""
        parameters = {**self.parameters, self.parameter: value}
        p = self.system.parameter_vector(parameters)
        try:
            return self._found(parameters, p, *self._start(p, end))
        except (ChatteringError, DivergenceError, StiffnessError, InputError) as error:
            # the last where x0 is in no mode at this value
            return Row(DIVERGED, str(error))

    def _start(
        self, p: NDArray[np.float64], end: tuple[NDArray[np.float64], int] | None
    ) -> tuple[NDArray[np.float64], int]:
        if end is not None:
            x, mode = end
            if admits(self.system, p, x, mode):
                return end
            with suppress(InputError):
                return x, starting_mode(self.system, x, p)
        return self.x0, self.mode_at_start(p)

    def mode_at_start(self, p: NDArray[np.float64]) -> int:
        """Return the index of the mode at `x0`; raise `InputError` where no motion may start there."""
        return starting_mode(self.system, self.x0, p, self.mode)

    def _found(self, parameters: Mapping[str, float], p: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> Row:
        seen = self._seen(p, x, mode)
        if self._rests(seen):
            pushed = _pushed(seen.found.x_end, self.system, self.criteria.push)
            seen = self._seen(p, pushed, seen.found.mode_end)
        for _ in range(self.criteria.patience):
            if seen.growth is None or seen.kind.label != QUASI_PERIODIC or seen.kind.curves:
                break
            seen = self._seen(p, seen.growth.x_end, seen.growth.mode_end)
        found, growth, kind = seen
        points = self._points(found, parameters)
        if growth is None:
            return Row(kind.label, points=points, state=found.x_end, mode=found.mode_end)
        return Row(
            kind.label,
            points=points,
            kind=kind,
            exponents=growth.exponents,
            errors=growth.errors,
            return_time=self._return_time(found),
            observed=self._observed(parameters, found, kind),
            state=found.x_end,
            mode=found.mode_end,
        )

    def _seen(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> _Seen:
        """Follow the motion, and find its kind from its returns."""
        found = self._settled(p, x, mode)
        if len(found.times) < self._looked_at:
            return _Seen(found, None, Kind(NO_RETURN, 0, math.nan, 0))
        return _Seen(found, *self._measured(p, found))

    def _rests(self, seen: _Seen) -> bool:
        """Whether a motion that recurs does so although its leading exponent is above 0, by more than its error."""
        if seen.growth is None or not seen.kind.period:
            return False
        exponent, error = float(seen.growth.exponents[0]), float(seen.growth.errors[0])
        return exponent > max(self.criteria.exponent / self._return_time(seen.found), error)

    @property
    def _looked_at(self) -> int:
        return self.criteria.looked_at(self.keep)

    def _settled(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int) -> Iterates:
        """Return the returns from which the kind follows, fewer where the motion stops returning."""
        dropped, unit = self.discard, math.inf if self.system.phase is None else self._period(p)
        if self.section is not None and dropped >= _FIRST:
            first = self._iterated(p, x, mode, _FIRST - 1, 1, self.criteria.absence * unit)
            if not first.times.size:
                return first
            x, mode, dropped = first.x_end, first.mode_end, dropped - _FIRST
            mean = float(first.times[0]) / _FIRST
            unit = mean if self.system.phase is None else max(mean, unit)
        return self._iterated(p, x, mode, dropped, self._looked_at, self.criteria.absence * unit)

    def _iterated(
        self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, discard: int, keep: int, longest: float
    ) -> Iterates:
        """Return the returns of a motion; none for one without a phase that takes too many steps without a return."""
        section = None if self.section is None else EventSection(self.section, longest)
        tolerance = (self.rtol, self.atol)
        try:
            return iterate(self.steady, p, x, mode, discard=discard, keep=keep, section=section, tolerance=tolerance)
        except StiffnessError as error:
            if self.system.phase is not None:
                raise
            none, state = np.empty((0, len(self.steady.all_states))), np.array(error.state)
            return Iterates(none, np.empty(0, np.int64), np.empty(0), state, self.steady.mode_index(error.mode))

    def _period(self, p: NDArray[np.float64]) -> float:
        """Period of the phase."""
        return 2.0 * math.pi / float(self.system.compiled.field(0, self.x0, p)[-1])

    def _return_time(self, found: Iterates) -> float:
        return float((found.times[-1] - found.times[0]) / (len(found.times) - 1))

    def _points(self, found: Iterates, parameters: Mapping[str, float]) -> NDArray[np.float64]:
        from saltus.system.evaluate import evaluate

        points = np.full((self.keep, len(self.quantities)), np.nan)
        states, modes = found.states[-self.keep :], found.modes[-self.keep :]
        for column, text in enumerate(self.quantities):
            points[: len(states), column] = evaluate(self.system, text, states, modes, parameters)
        return points

    def _measured(self, p: NDArray[np.float64], found: Iterates) -> tuple[Growth, Kind]:
        """Return the growth of perturbations, and the kind of the motion."""
        returns = self._looked_at
        time = self._return_time(found)
        rounding = self._rounding(p, found, time)
        growth = self._growth(p, found.x_end, found.mode_end, returns, time)
        kind = self._kind(found, growth, time, rounding)
        near = abs(growth.exponents[0] - self.criteria.exponent / time) < growth.errors[0]
        if not kind.period and near and self.criteria.patience > 1:
            growth = self._growth(p, growth.x_end, growth.mode_end, returns * self.criteria.patience, time)
            kind = self._kind(found, growth, time, rounding)
        return growth, kind

    def _rounding(self, p: NDArray[np.float64], found: Iterates, time: float) -> NDArray[np.float64]:
        """Return the differences of full states that are rounding, from their sizes over a mean return."""
        run = EventDrivenMotion(
            self.system, p, found.x_end.copy(), found.mode_end, self.rtol, self.atol, steps_kept=_STEPS_KEPT
        )
        run.follow(time, None, None)
        sizes = np.abs(run.steps()[2]).max(axis=0)
        return np.asarray(self.criteria.noise * (self.atol + self.rtol * sizes))

    def _growth(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, returns: int, time: float) -> Growth:
        aligned = max(returns // 4, 1)
        tolerances: dict[str, Any] = {"tolerance": (self.rtol, self.atol), "exponents": self.exponents}
        if self.section is None:
            return growth_along(
                self.system, p, x, mode, average=Average(periods=returns, discard=aligned), **tolerances
            )
        average = Average(t_end=returns * time, discard=aligned * time)
        return growth_along(self.system, p, x, mode, average=average, **tolerances)

    def _kind(self, found: Iterates, growth: Growth, time: float, rounding: NDArray[np.float64]) -> Kind:
        states = found.states
        if self.system.phase is not None:
            angle = states[:, -1:]
            round_ = () if self.section is None else (np.cos(angle), np.sin(angle))
            states = np.hstack([states[:, :-1], *round_])
            rounding = np.append(rounding[:-1], [self.criteria.noise * (self.atol + self.rtol)] * len(round_))
        exponent, error = float(growth.exponents[0]) * time, float(growth.errors[0]) * time
        return classify(states, exponent, error, self.criteria, rounding)

    def _observed(self, parameters: Mapping[str, float], found: Iterates, kind: Kind) -> list[float]:
        if not self.observables:
            return []
        from saltus.flow.observables import observe, read_observable

        orders = [read_observable(self.system, name).order for name in self.observables]
        multiple = math.lcm(*(order.denominator for order in orders if order is not None))
        time = self._return_time(found) * (kind.period if kind.label.startswith("period-") else self.keep)
        how_long: dict[str, Any] = {"t_end": time}
        if self.system.phase is not None:
            period = self._period(self.system.parameter_vector(parameters))
            how_long = {"periods": multiple * math.ceil(time / period / multiple - 1e-6)}
        name = self.system.mode_names[found.mode_end]
        how_long |= {"tolerance": (self.rtol, self.atol)}
        motion = simulate(self.system, parameters, found.x_end, mode=name, **how_long).motion()
        return list(observe(motion, self.observables).values())


def _pushed(x: NDArray[np.float64], system: HybridSystem, push: float) -> NDArray[np.float64]:
    n = len(system.states)
    pushed = x.copy()
    size = np.maximum(np.abs(x[:n]), max(float(np.abs(x[:n]).max()), 1.0) * push)
    pushed[:n] += push * size * np.cos(np.arange(n))  # no symmetry is likely to keep this direction
    return pushed


def _check_expressions(task: Task) -> None:
    from saltus.system.evaluate import check_expression

    for text in task.quantities:
        check_expression(task.system, text)
    if task.observables:
        from saltus.flow.observables import read_observable

        for name in task.observables:
            order = read_observable(task.system, name).order
            if order is not None and order.denominator > 1 and task.system.phase is None:
                raise InputError("observable", name, "of a whole order for a system without a phase")


def _checked_start(task: Task, values: NDArray[np.float64], *, given: bool) -> tuple[NDArray[np.float64], int]:
    """Return the parameters and the mode of the first value that admits the start.

    Raises
    ------
    InputError
        No value admits the start; the reason is that of the first value.
    """
    refusals = []
    for value in values.tolist():
        p = task.system.parameter_vector({**task.parameters, task.parameter: value})
        try:
            return p, task.mode_at_start(p)
        except InputError as error:
            refusals.append(error)
    if given or task.mode is not None:
        raise refusals[0]
    raise InputError("x0", None, "given for this system: no mode holds where all states are 0") from refusals[0]
