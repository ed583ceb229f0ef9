"""Brute-force diagrams: follow an attractor by simulation along a parameter, and say at each value what it is.

Rules
-----
* At each value the motion goes on from the state where it ended at the value before. Where it cannot (its mode has
  ended at the new value) it starts in the mode that the state allows; where there was no motion to go on from, at `x0`.
* A value at which the motion leaves every bound, chatters, sticks where a field jumps, takes more than 5000 steps a
  return, or cannot start, is labelled ``diverged``, with the reason; the others go on, from `x0`.
* What a motion is follows from `Criteria.looked_at` returns, of which the last are kept.
* A motion that recurs although its leading exponent is positive rests on an unstable orbit, as one does that started
  there: it is pushed by `Criteria.push` of its size, and settles once more.
* A motion is taken not to return to a section after `Criteria.absence` of its mean returns, measured over the first of
  those that are dropped.
* A motion that is neither chaotic by its exponent, nor periodic, nor on a closed curve has not settled: it is followed
  as long again, `Criteria.patience` times at most.
* The exponents are measured after the returns looked at, over as many again; of a motion that does not recur, over
  `Criteria.patience` times as many where their error leaves it open whether it is chaotic.
* The observables are those of a periodic motion's period, or else of as much time as the returns kept take.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.errors import ChatteringError, DivergenceError, InputError, StiffnessError
from saltus.flow.motion import EventDrivenMotion, check_tolerances, starting_mode
from saltus.flow.motion_kind import DIVERGED, NO_RETURN, QUASI_PERIODIC, Criteria, Kind, classify
from saltus.flow.poincare import Iterates, admits, iterate
from saltus.flow.simulation import simulate
from saltus.flow.sizes import fitting_atol
from saltus.flow.variational import Growth, growth_along
from saltus.sweeps.section import Section, on_section
from saltus.sweeps.sweep import Sweep
from saltus.sweeps.workers import Piece, rows_of
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["run_sweep"]

_FIRST = 16
"""Returns from which the mean one is known, if so many are dropped."""

_STEPS_KEPT = 256
_ATOL = 1e-10  # absolute tolerance of a step for states of size 1 or more

_SAVED_EVERY = 3.0
"""Seconds between two savings, or more where one takes long."""

_FOLLOW = {"up": ("up",), "down": ("down",), "both": ("up", "down"), "restart": ("restart",)}


def run_sweep(
    system: HybridSystem,
    parameter: str,
    values: ArrayLike,
    *,
    parameters: Mapping[str, float] | None = None,
    x0: ArrayLike | None = None,
    mode: str | None = None,
    discard: int = 600,
    keep: int = 100,
    follow: str = "up",
    chunks: int = 1,
    section: str | Section | None = None,
    quantities: Sequence[str] | None = None,
    observables: Sequence[str] = (),
    exponents: int = 1,
    criteria: Criteria | None = None,
    rtol: float = 1e-8,
    atol: float | None = None,
    workers: int | None = None,
    client: Any = None,
    path: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Sweep:
    """Return the attractors along a parameter, found by simulation: a brute-force diagram.

    At each value the motion is followed until it has returned `discard` times to a section, then as many times more as
    are needed to say what it is; the last `keep` points are kept. What has been dropped takes no memory.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameter : str
        What is swept, a parameter or a group of them.
    values : array_like, shape (value,)
        Its values, ascending.
    parameters : mapping of str to float, optional
        Other values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,), optional
        Where the motion starts; by default all states are 0, at phase 0. An orbit that rests there is found only if it
        is an attractor. A value at which no motion can start there is labelled ``diverged``.
    mode : str, optional
        Mode there; by default the first that the state allows.
    discard, keep : int, optional
        Returns to the section that are dropped at the least, and those that are kept. What the motion is follows from
        `keep` returns, but no fewer than ``Criteria.looked_at``.
    follow : {"up", "down", "both", "restart"}, optional
        Whether the attractor is followed from the first value to the last, from the last to the first, or both, each on
        its own from `x0`; or whether every value starts at `x0`.
    chunks : int, optional
        Stretches into which the values are cut, each followed on its own from `x0`, so that they can be computed at the
        same time. More than 1 may change which attractor is found.
    section : str or Section, optional
        Where points are taken: before a transition, or on a surface of one's own; by default at phase 0.
    quantities : sequence of str, optional
        What is kept of each point, expressions in states, phase, parameters and outputs; by default the states.
    observables : sequence of str, optional
        What is observed at each value, as ``"amplitude(z, 1)"``; see `saltus.flow.observables`.
    exponents : int, optional
        How many Lyapunov exponents, the largest first.
    criteria : Criteria, optional
        Thresholds of the labels.
    rtol, atol : float, optional
        Tolerances of a step. By default the second is 1e-10, or so much smaller as the smallest state where that is
        below 1e-2 at the first value.
    workers : int, optional
        Threads that compute; by default as many as there are processors for this process. The result is the same.
    client : dask.distributed.Client, optional
        A cluster that computes instead.
    path : path-like, optional
        A file in which what is done is saved every few seconds. Where it exists, the sweep goes on from it, and ends
        with the same result as one that was not interrupted.
    progress : callable, optional
        Called with the count of values that are done, the count of all, and what has just been done in words.

    Returns
    -------
    Sweep
        An interrupt (Ctrl-C) keeps what is done; `Sweep.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, a start that no value admits, or a file with a sweep of other input.

    Notes
    -----
    Whatever ends a sweep early, what is done is saved where `path` is given.

    Examples
    --------
    The logistic map, carried by a hybrid system:

    >>> from saltus import HybridSystem, Mode, Transition
    >>> carried = HybridSystem(
    ...     ("x", "s"), {"r": 3.2}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> sweep = run_sweep(carried, "r", [3.2, 3.5, 3.7], x0=[0.3, 0.0], section="map", quantities=["x"])
    >>> sweep.labels.tolist()
    [['period-2', 'period-4', 'chaotic']]
    """
    grid = _ascending(values)
    task = _Task.checked(
        system, parameter, grid, parameters, x0, mode, discard=discard, keep=keep, section=section,
        quantities=quantities, observables=observables, exponents=exponents, criteria=criteria, rtol=rtol, atol=atol,
    )  # fmt: skip
    directions = _directions(follow)
    most, what = (1, "as every value starts anew") if follow == "restart" else (grid.size, "the number of values")
    chunks = checks.count("chunks", chunks, 1, most, what)
    checks.function("progress", progress, "of two counts and a text")
    task.load(float(grid[0]))
    settings = {**task.settings, "follow": follow, "chunks": chunks}
    record = _Record.begun(task, grid, directions, settings, path, progress)
    pieces = record.left(_pieces(directions, grid.size, grid.size if follow == "restart" else chunks))
    try:
        with suppress(KeyboardInterrupt), closing(rows_of(task.row, grid, pieces, workers, client)) as rows:
            record.started = monotonic()
            for place, row in rows:
                record.keep(place, row)
    finally:
        if record.fresh:
            record.save()
    return record.as_sweep()


@dataclass(frozen=True)
class Row:
    """What is found at one value."""

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
    """Returns of a motion, how perturbations of it grow (None where it does not return), and what it is."""

    found: Iterates
    growth: Growth | None
    kind: Kind


@dataclass(frozen=True)
class _Task:
    """What is asked for at each value; `steady` is the system, with the section among its transitions."""

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
        mode: str | None,
        **options: Any,
    ) -> _Task:
        """Return the task, all input looked at."""
        checks.instance("system", system, HybridSystem)
        checks.chosen("parameter", parameter, (*system.parameter_names, *system.groups))
        base = system.resolve(parameters)
        for value in values.tolist():
            system.resolve({**base, parameter: value})
        steady, places = on_section(system, options["section"])
        discard = checks.count("discard", options["discard"], 0)
        keep = checks.size("keep", options["keep"], 1, checks.LARGEST_LIST // values.size)
        exponents = checks.count("exponents", options["exponents"], 1, len(system.states), "the states")
        check_tolerances(options["rtol"], _ATOL if options["atol"] is None else options["atol"])
        criteria = options["criteria"]
        criteria = Criteria() if criteria is None else checks.instance("criteria", criteria, Criteria)
        start = system.full_state(np.zeros(len(system.states)) if x0 is None else x0)
        quantities = system.states if options["quantities"] is None else options["quantities"]
        task = cls(
            system, steady, places, parameter, base, start, mode, discard, keep,
            checks.names("quantities", quantities, "texts, as ['v1']", least=1),
            checks.names("observables", options["observables"], "texts, as ['mean(v1)']"), exponents, criteria,
            float(options["rtol"]), _ATOL if options["atol"] is None else float(options["atol"]), {},
        )  # fmt: skip
        p, first = _checked_start(task, values, given=x0 is not None)
        if options["atol"] is None:
            task = replace(task, atol=fitting_atol(system, p, start, first, _ATOL))
        _check_expressions(task)
        return replace(task, settings=task._described(options["section"]))

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
        iterate(self.steady, p, self.x0, 0, discard=0, keep=0, section=self.section, rtol=self.rtol, atol=self.atol)

    def row(self, value: float, end: tuple[NDArray[np.float64], int] | None) -> Row:
        """Return what is found at a value, from where the motion ended at the value before."""
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
        """Follow the motion, look at its returns, and say what it is."""
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
        """The returns that are looked at, fewer where the motion does not return."""
        options: dict[str, Any] = {"section": self.section, "rtol": self.rtol, "atol": self.atol}
        dropped, unit = self.discard, math.inf if self.system.phase is None else self._period(p)
        if self.section is not None and dropped >= _FIRST:
            options["longest"] = self.criteria.absence * unit
            first = self._iterated(p, x, mode, discard=_FIRST - 1, keep=1, **options)
            if not first.times.size:
                return first
            x, mode, dropped = first.x_end, first.mode_end, dropped - _FIRST
            mean = float(first.times[0]) / _FIRST
            unit = mean if self.system.phase is None else max(mean, unit)
        options["longest"] = self.criteria.absence * unit
        return self._iterated(p, x, mode, discard=dropped, keep=self._looked_at, **options)

    def _iterated(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, **options: Any) -> Iterates:
        """Returns of a motion; none where, without a phase, so many steps bring no return that it has none."""
        try:
            return iterate(self.steady, p, x, mode, **options)
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
        """Exponents, and what the motion is."""
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
        """Differences of full states that are none, by their sizes along the motion over a return."""
        run = EventDrivenMotion(
            self.system, p, found.x_end.copy(), found.mode_end, self.rtol, self.atol, steps_kept=_STEPS_KEPT
        )
        run.follow(time, None, None)
        sizes = np.abs(run.steps()[2]).max(axis=0)
        return np.asarray(self.criteria.noise * (self.atol + self.rtol * sizes))

    def _growth(self, p: NDArray[np.float64], x: NDArray[np.float64], mode: int, returns: int, time: float) -> Growth:
        aligned = max(returns // 4, 1)
        tolerances: dict[str, Any] = {"rtol": self.rtol, "atol": self.atol, "exponents": self.exponents}
        if self.section is None:
            return growth_along(self.system, p, x, mode, periods=returns, discard=aligned, **tolerances)
        return growth_along(self.system, p, x, mode, t=returns * time, discard=aligned * time, **tolerances)

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
        how_long |= {"rtol": self.rtol, "atol": self.atol}
        motion = simulate(self.system, parameters, found.x_end, mode=name, **how_long).motion()
        return list(observe(motion, self.observables).values())


def _pushed(x: NDArray[np.float64], system: HybridSystem, push: float) -> NDArray[np.float64]:
    n = len(system.states)
    pushed = x.copy()
    size = np.maximum(np.abs(x[:n]), max(float(np.abs(x[:n]).max()), 1.0) * push)
    pushed[:n] += push * size * np.cos(np.arange(n))  # no symmetry is likely to keep this direction
    return pushed


# input


def _ascending(values: ArrayLike) -> NDArray[np.float64]:
    grid = checks.array("values", values, "a sequence of numbers, at least one")
    if grid.ndim != 1 or not grid.size:
        raise InputError("values", values, "a sequence of numbers, at least one")
    if falls := np.flatnonzero(np.diff(grid) <= 0.0).tolist():
        pair = f"{grid[falls[0]]:.12g}, {grid[falls[0] + 1]:.12g}"
        raise InputError("values", pair, "ascending, each once", "follow='down' goes from the last to the first")
    return grid


def _directions(follow: object) -> tuple[str, ...]:
    return _FOLLOW[checks.chosen("follow", follow, _FOLLOW)]


def _check_expressions(task: _Task) -> None:
    from saltus.system.evaluate import check_expression

    for text in task.quantities:
        check_expression(task.system, text)
    if task.observables:
        from saltus.flow.observables import read_observable

        for name in task.observables:
            order = read_observable(task.system, name).order
            if order is not None and order.denominator > 1 and task.system.phase is None:
                raise InputError("observable", name, "of a whole order for a system without a phase")


def _checked_start(task: _Task, values: NDArray[np.float64], *, given: bool) -> tuple[NDArray[np.float64], int]:
    """Return the parameters and the mode of the first value that admits the start.

    Raises
    ------
    InputError
        What the first value has against the start, if no value admits it.
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


# the values, in the order in which they are computed


def _pieces(directions: Sequence[str], count: int, chunks: int) -> list[Piece]:
    """Stretches of values that are followed one value after the other."""
    pieces = []
    for row, direction in enumerate(directions):
        parts = [part.tolist() for part in np.array_split(np.arange(count), chunks)]
        pieces += [Piece(row, part[::-1] if direction == "down" else part) for part in parts]
    return pieces


@dataclass
class _Record:
    """What is done so far."""

    task: _Task
    sweep: dict[str, Any]
    path: Path | None
    progress: Callable[[int, int, str], None] | None
    started: float = field(default_factory=monotonic)
    saved: float = field(default_factory=monotonic)
    pause: float = _SAVED_EVERY
    fresh: int = 0

    @classmethod
    def begun(
        cls,
        task: _Task,
        values: NDArray[np.float64],
        directions: Sequence[str],
        settings: Mapping[str, Any],
        path: str | os.PathLike[str] | None,
        progress: Callable[[int, int, str], None] | None,
    ) -> _Record:
        """Return the record of a new sweep, or of one whose file exists."""
        shape = (len(directions), values.size)
        sweep: dict[str, Any] = {
            "system": task.system,
            "parameter": task.parameter,
            "values": values,
            "parameters": task.system.resolve({**task.parameters, task.parameter: float(values[0])}),
            "directions": tuple(directions),
            "quantities": task.quantities,
            "points": np.full((*shape, task.keep, len(task.quantities)), np.nan),
            "labels": np.full(shape, "", dtype=object),
            "periods": np.zeros(shape, np.int64),
            "rotations": np.full(shape, np.nan),
            "curves": np.zeros(shape, np.int64),
            "exponents": np.full((*shape, task.exponents), np.nan),
            "errors": np.full((*shape, task.exponents), np.nan),
            "return_times": np.full(shape, np.nan),
            "observables": task.observables,
            "observed": np.full((*shape, len(task.observables)), np.nan),
            "reasons": np.full(shape, "", dtype=object),
            "states": np.full((*shape, len(task.system.all_states)), np.nan),
            "modes": np.full(shape, -1, np.int64),
            "settings": dict(settings),
        }
        file = None if path is None else checks.path("path", path)
        if file is not None and file.exists():
            _resume(sweep, Sweep.load(file), file)
        elif file is not None and not (file.parent.is_dir() and os.access(file.parent, os.W_OK)):
            raise InputError("path", str(path), "in a folder that exists and can be written")
        return cls(task, sweep, file, progress)

    @property
    def done(self) -> int:
        """Values that are done."""
        return int(np.sum(self.sweep["labels"] != ""))

    @property
    def total(self) -> int:
        """Values in all, those of both directions."""
        return int(self.sweep["labels"].size)

    def left(self, pieces: list[Piece]) -> list[Piece]:
        """Return what is left of the pieces, each with the end of what is done of it."""
        labels, states, modes = (self.sweep[name] for name in ("labels", "states", "modes"))
        left = []
        for piece in pieces:
            undone = [k for k in piece.order if not labels[piece.row, k]]
            before = piece.order[: len(piece.order) - len(undone)]
            end = None
            if before and modes[piece.row, before[-1]] >= 0:
                end = (states[piece.row, before[-1]].copy(), int(modes[piece.row, before[-1]]))
            if undone:
                left.append(Piece(piece.row, undone, end))
        return left

    def keep(self, place: tuple[int, int], row: Row) -> None:
        """Keep a value's row, save when it is time, and tell."""
        sweep = self.sweep
        found: dict[str, Any] = {"reasons": row.reason, "modes": row.mode, "return_times": row.return_time}
        if row.points is not None:
            found |= {"points": row.points, "states": row.state}
        if row.kind is not None:
            found |= {"periods": row.kind.period, "rotations": row.kind.rotation, "curves": row.kind.curves}
            found |= {"exponents": row.exponents, "errors": row.errors, "observed": row.observed}
        for name, value in (found | {"labels": row.label}).items():
            sweep[name][place] = value
        self.fresh += 1
        if self.path is not None and monotonic() - self.saved > self.pause:
            self.save()
        if self.progress is not None:
            self.progress(self.done, self.total, self._told(place, row.label))

    def _told(self, place: tuple[int, int], label: str) -> str:
        left = (monotonic() - self.started) / self.fresh * (self.total - self.done)
        name, value = self.task.parameter, self.sweep["values"][place[1]]
        return f"{name} = {value:.6g} {self.sweep['directions'][place[0]]}: {label}, {_duration(left)} left"

    def save(self) -> None:
        """Write what is done."""
        if self.path is None:
            return
        began = monotonic()
        self.as_sweep().save(self.path)
        self.saved = monotonic()
        self.pause = max(_SAVED_EVERY, 20.0 * (self.saved - began))

    def as_sweep(self) -> Sweep:
        """Return what is done as a result."""
        done, total = self.done, self.total
        stopped = f"all {total} values done" if done == total else f"interrupted: {done} of {total} values done"
        return Sweep(**self.sweep, stopped=stopped)


def _resume(sweep: dict[str, Any], before: Sweep, path: Path) -> None:
    """Take over what a file holds, if its sweep is the same."""
    for name, wanted, was in _inputs(sweep, before):
        if wanted != was:
            raise InputError("path", str(path), "the file of a sweep of the same input", f"its {name} is {was!r}")
    for name in (
        *("points", "periods", "rotations", "curves", "exponents", "errors", "return_times", "observed"),
        *("states", "modes"),
    ):
        sweep[name] = np.array(getattr(before, name))
    for name in ("labels", "reasons"):
        sweep[name] = getattr(before, name).astype(object)


def _inputs(sweep: Mapping[str, Any], before: Sweep) -> Iterator[tuple[str, Any, Any]]:
    """Go through all input: its name, what it is, and what it was."""
    yield "system", sweep["system"].definition(), before.system.definition()
    for name in ("parameter", "quantities", "observables", "parameters"):
        yield name, _plain(sweep[name]), _plain(getattr(before, name))
    yield "values", sweep["values"].tolist(), before.values.tolist()
    for name, value in sweep["settings"].items():
        yield name, _plain(value), before.settings.get(name)


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
