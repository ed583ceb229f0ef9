"""The task of a brute-force diagram at one value: follow the motion, label it, and measure it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.ensemble.returns import Start
from saltus.errors import ChatteringError, InputError
from saltus.flow.motion_kind import (
    CHAOTIC,
    CHATTERING,
    DIVERGED,
    NO_RETURN,
    QUASI_PERIODIC,
    STRANGE,
    UNRESOLVED,
    Kind,
    classify,
)  # fmt: skip
from saltus.flow.poincare import PoincareReturns
from saltus.flow.recurring.criteria import Criteria
from saltus.flow.variational import Growth
from saltus.sweeps.map_returns import MapReturns
from saltus.sweeps.options import SweepOptions
from saltus.sweeps.reasons import lost, never_settles
from saltus.sweeps.returns import FlowReturns, Returns
from saltus.system import HybridSystem, Map
from saltus.system.angles import wrapped
from saltus.system.evaluate import check_expression, evaluate
from saltus.system.maps import checked_system, flowing
from saltus.system.periodicity import check_phase_in

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike

__all__ = ["Begun", "Row", "Task"]

_USUAL = 3  # looks at a motion in doubt, however long they are
_FITTED = 3  # finer tolerances that are tried for a motion
_MOST = 100_000  # returns of a further look at the most


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


class Begun(NamedTuple):
    """What is known of a motion before its row, or None.

    Its returns, the growth of its perturbations, and that over a longer time where this is needed.
    """

    found: PoincareReturns | None = None
    growth: Growth | None = None
    longer: Growth | None = None


class _Seen(NamedTuple):
    """Returns of a motion, growth of its perturbations (None without returns), and its kind."""

    found: PoincareReturns
    growth: Growth | None
    kind: Kind


@dataclass(frozen=True)
class Task:
    """The task at each value; `motions` follows and measures motions."""

    system: HybridSystem | Map
    motions: Returns
    parameter: str
    parameters: Mapping[str, float]
    keep: int
    quantities: tuple[str, ...]
    observables: tuple[str, ...]
    exponents: int
    criteria: Criteria
    settings: Mapping[str, Any]

    @classmethod
    def checked(
        cls,
        system: HybridSystem | Map,
        parameter: str,
        values: NDArray[np.float64],
        parameters: Mapping[str, float] | None,
        x0: StateLike | None,
        options: SweepOptions,
    ) -> Task:
        """Return the task after checks of all input."""
        system = checked_system(system)
        checks.chosen("parameter", parameter, (*system.parameter_names, *system.groups))
        base = system.resolve(parameters)
        for value in values.tolist():
            system.resolve({**base, parameter: value})
        motions = _returns(system, x0, options)
        checks.size("SweepOptions.keep", options.keep, 1, checks.LARGEST_LIST // values.size)
        checks.count("SweepOptions.exponents", options.exponents, 1, len(system.states), "the states")
        vectors = [system.parameter_vector({**base, parameter: value}) for value in values.tolist()]
        try:
            motions = motions.ready(vectors, given=x0 is not None)
        except InputError as error:
            name, value, allowed, hint = error.args
            where = f"at {parameter} = {values[0]:.6g}, and no other value admits the start"
            raise InputError(name, value, allowed, f"{hint}; {where}" if hint else where) from error
        quantities = tuple(system.states if options.quantities is None else options.quantities)
        for text in quantities:
            check_expression(system, text)
            check_phase_in(system, text)
        motions.check_observables(options.observables)
        settings = motions.described() | {
            "discard": options.discard,
            "keep": options.keep,
            "exponents": options.exponents,
            "criteria": asdict(options.criteria),
            "follow": options.follow,
            "chunks": options.chunks,
        }
        return cls(
            system=system,
            motions=motions,
            parameter=parameter,
            parameters=base,
            keep=options.keep,
            quantities=quantities,
            observables=tuple(options.observables),
            exponents=options.exponents,
            criteria=options.criteria,
            settings=settings,
        )

    def load(self, values: Sequence[float]) -> None:
        """Load the compiled functions, before threads ask for them, by the first value that admits the start."""
        for value in values:
            with suppress(*self.motions.faults):
                self.motions.load(self.system.parameter_vector({**self.parameters, self.parameter: value}))
                return

    def by_lanes(self, value: float, *, growing: bool) -> Task | None:
        """Return the same that can follow motions side by side in lanes; None where there are no lanes.

        `growing`: whether perturbations of them, too.
        """
        p = self.system.parameter_vector({**self.parameters, self.parameter: value})
        motions = self.motions.by_lanes(p, growing=growing)
        return None if motions is None else replace(self, motions=motions)

    def begun_together(
        self, values: Sequence[float], ends: Sequence[tuple[NDArray[np.float64], int] | None]
    ) -> Sequence[Begun]:
        """Return what is known of the motion at each value before `row`, which takes it.

        Parameters
        ----------
        values : sequence of float
            The values.
        ends : sequence
            Ends of the motions at the values before.
        """
        vectors = [self.system.parameter_vector({**self.parameters, self.parameter: value}) for value in values]
        starts: list[Start | None] = []
        for p, end in zip(vectors, ends, strict=True):
            try:
                starts.append(Start(p, *self.motions.start(p, end)))
            except self.motions.faults:
                starts.append(None)
        settled = self.motions.settled_together(starts, self._looked_at)
        times = {i: self.motions.mean_time(found) for i, found in enumerate(settled) if found is not None}
        returns = self._looked_at
        begins = [(i, found.x_end, found.mode_end) for i, found in enumerate(settled) if found is not None]
        grown = self._grown_together(begins, vectors, times, returns)
        open_ = [(i, g.x_end, g.mode_end) for i, g in grown.items() if self._is_open(g, times[i])]
        longer = self._grown_together(open_, vectors, times, returns * self.criteria.patience)
        return [Begun(found, grown.get(i), longer.get(i)) for i, found in enumerate(settled)]

    def _grown_together(
        self,
        begins: Sequence[tuple[int, NDArray[np.float64], int]],
        vectors: Sequence[NDArray[np.float64]],
        times: Mapping[int, float],
        returns: int,
    ) -> dict[int, Growth]:
        """Return the growth along motions that is found side by side, by their places."""
        settled = [(vectors[i], x, mode, times[i]) for i, x, mode in begins]
        grown = self.motions.grown_together(settled, returns)
        return {i: growth for (i, *_), growth in zip(begins, grown, strict=True) if growth is not None}

    def _is_open(self, growth: Growth, time: float) -> bool:
        """Whether the error of the leading exponent leaves open if a motion is chaotic, and a longer time may tell."""
        near = abs(growth.exponents[0] - self.criteria.exponent / time) < growth.errors[0]
        return bool(near) and self.criteria.patience > 1

    def row(self, value: float, end: tuple[NDArray[np.float64], int] | None, begun: Begun | None = None) -> Row:
        """Return the results at a value; the motion starts from its end at the value before.

        `begun` is what is known of that motion already.
        """
        parameters = {**self.parameters, self.parameter: value}
        p = self.system.parameter_vector(parameters)
        known = Begun() if begun is None else begun
        found = known.found
        try:
            begin = self.motions.start(p, end)
            if found is None:
                found = self.motions.settled(p, *begin, self._looked_at)
            task, found = self._fitting(p, found)
            return task._found(parameters, p, task._seen(p, found, known if task is self else None), begin[0])
        except self.motions.faults as error:
            return Row(CHATTERING if isinstance(error, ChatteringError) else DIVERGED, str(error))

    def _fitting(self, p: NDArray[np.float64], found: PoincareReturns) -> tuple[Task, PoincareReturns]:
        """Return the task with tolerances that fit a motion, and the motion that goes on with them."""
        task = self
        for _ in range(_FITTED):
            motions = task.motions.fitting(p, found)
            if motions is task.motions:
                break
            task = replace(task, motions=motions)
            found = motions.settled(p, found.x_end, found.mode_end, self._looked_at)
        return task, found

    def _found(
        self, parameters: Mapping[str, float], p: NDArray[np.float64], seen: _Seen, begin: NDArray[np.float64]
    ) -> Row:
        if self._rests(seen):
            pushed = _pushed(seen.found.x_end, _faces(self.system), self.criteria.push, self.motions.unit)
            task, found = self._fitting(p, self.motions.settled(p, pushed, seen.found.mode_end, self._looked_at))
            if task is not self:
                return task._found(parameters, p, task._seen(p, found), begin)
            seen = self._seen(p, found)
        for look in range(1, self.motions.looks):
            count = self._looked_at * self.criteria.patience**look
            if not self._in_doubt(seen, look) or (look >= _USUAL and count > _MOST):
                break
            seen = self._seen(p, self.motions.settled(p, seen.found.x_end, seen.found.mode_end, count), count=count)
        found, growth, kind = seen
        points = self._points(found, parameters)
        if growth is None:
            end = found.x_end, found.mode_end
            if reason := lost(self.system, p, begin, end):
                return Row(UNRESOLVED, reason, points=points, state=end[0], mode=end[1])
            return Row(kind.label, points=points, state=found.x_end, mode=found.mode_end)
        return Row(
            kind.label,
            self._reason(seen, p) if kind.label == UNRESOLVED else "",
            points=points,
            kind=kind,
            exponents=growth.exponents,
            errors=growth.errors,
            return_time=self.motions.mean_time(found),
            observed=self.motions.observed(parameters, found, kind, self.observables) if self.observables else (),
            state=found.x_end,
            mode=found.mode_end,
        )

    def _seen(
        self, p: NDArray[np.float64], found: PoincareReturns, known: Begun | None = None, count: int | None = None
    ) -> _Seen:
        """Find the kind of a motion from its returns, `count` of them."""
        if len(found.times) < (count or self._looked_at):
            return _Seen(found, None, Kind(NO_RETURN, 0, math.nan, 0))
        return _Seen(found, *self._measured(p, found, Begun() if known is None else known))

    def _in_doubt(self, seen: _Seen, look: int) -> bool:
        """Whether a longer look decides on a motion: `look` counts those so far.

        A torus and a strange set are believed when they are seen again, at their finest. So is weak chaos.
        """
        if seen.growth is None or self.criteria.patience == 1:
            return False
        if seen.kind.label == CHAOTIC:
            return look == 1 and self._is_weak(seen)
        if seen.kind.label == QUASI_PERIODIC:
            return look == 1
        return seen.kind.label in (UNRESOLVED, STRANGE) or not seen.kind.sure

    def _is_weak(self, seen: _Seen) -> bool:
        """Whether the leading exponent is above 0 by little more than its error."""
        exponent, error = self._leading(seen)
        return exponent - error < self.criteria.exponent

    def _leading(self, seen: _Seen) -> tuple[float, float]:
        """Return the leading exponent per return, and its error."""
        if seen.growth is None:
            return math.nan, math.nan
        time = self.motions.mean_time(seen.found)
        return float(seen.growth.exponents[0]) * time, float(seen.growth.errors[0]) * time

    def _reason(self, seen: _Seen, p: NDArray[np.float64]) -> str:
        """Return in words why a motion is unresolved."""
        exponent, error = self._leading(seen)
        what = "no lag repeats"
        if seen.kind.rivals[0]:
            one, other = seen.kind.rivals
            what = f"the motion still settles, to repeat after {one} or {other}, which cannot be told"
        found = f"the leading exponent is {exponent:.3g} +- {error:.1g} a return, and {what}"
        never = never_settles(self.system, p, seen.found, self.criteria)
        return f"{found} in {len(seen.found.times)} returns: {never or 'a larger discard or keep may tell'}"

    def _rests(self, seen: _Seen) -> bool:
        """Whether a motion recurs, or is on a torus, with a leading exponent that is above 0 by more than its error."""
        if seen.growth is None or not (seen.kind.period or seen.kind.unstable):
            return False
        exponent, error = float(seen.growth.exponents[0]), float(seen.growth.errors[0])
        return exponent > error + self.motions.growth_error / self.motions.mean_time(seen.found)

    @property
    def _looked_at(self) -> int:
        return self.criteria.looked_at(self.keep)

    def _points(self, found: PoincareReturns, parameters: Mapping[str, float]) -> NDArray[np.float64]:
        points = np.full((self.keep, len(self.quantities)), np.nan)
        states, modes = wrapped(found.states[-self.keep :], self.system.angle_places), found.modes[-self.keep :]
        for column, text in enumerate(self.quantities):
            points[: len(states), column] = evaluate(self.system, text, states, modes, parameters)
        return points

    def _measured(self, p: NDArray[np.float64], found: PoincareReturns, known: Begun) -> tuple[Growth, Kind]:
        """Return the growth of perturbations, and the kind of the motion."""
        returns, motions = len(found.times), self.motions
        time = motions.mean_time(found)
        compared = motions.compared(p, found, time)
        growth = known.growth or motions.growth(p, found.x_end, found.mode_end, returns, time)
        kind = self._kind(compared, growth, time)
        if not kind.period and self._is_open(growth, time):
            more = returns * self.criteria.patience
            growth = known.longer or motions.growth(p, growth.x_end, growth.mode_end, more, time)
            kind = self._kind(compared, growth, time)
        return growth, kind

    def _kind(self, compared: tuple[NDArray[np.float64], NDArray[np.float64]], growth: Growth, time: float) -> Kind:
        states, rounding = compared
        exponent = float(growth.exponents[0]) * time
        error = float(growth.errors[0]) * time + self.motions.growth_error
        autonomous = self.motions.autonomous
        return classify(states, exponent, error, self.criteria, rounding, autonomous=autonomous)


@singledispatch
def _returns(system: HybridSystem | Map, x0: StateLike | None, options: SweepOptions) -> Returns:
    return FlowReturns.checked(flowing(system), x0, options)


@_returns.register(Map)
def _iterations(system: Map, x0: StateLike | None, options: SweepOptions) -> Returns:
    return MapReturns.checked(system, x0, options)


def _faces(system: HybridSystem | Map) -> NDArray[np.bool_]:
    """Return which states have their rate as a factor, and so never cross 0."""
    from saltus.system.faces import FACE

    count = len(system.states)
    return np.zeros(count, dtype=np.bool_) if isinstance(system, Map) else system.compiled.kinds[:count] == FACE


def _pushed(x: NDArray[np.float64], faces: NDArray[np.bool_], push: float, unit: float) -> NDArray[np.float64]:
    """Return a state pushed by a share of its size; states that never cross 0 are pushed away from it, unless at 0.

    `unit` is the size that states are believed to have.
    """
    pushed, n = x.copy(), faces.size
    size = np.maximum(np.abs(x[:n]), max(float(np.abs(x[:n]).max()), unit) * push)
    way = np.cos(np.arange(n))  # no symmetry is likely to keep this direction
    pushed[:n] += push * size * np.where(faces, np.abs(way) * np.sign(x[:n]), way)
    return pushed
