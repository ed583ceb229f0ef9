"""Continuation of a family of branches: one branch for each member, computed in parallel."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import current_process
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.many.way import Task, carried, is_interrupted
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.family import Family, label
from saltus.continuation.runs.options import BranchOptions
from saltus.errors import InputError, nearest
from saltus.orbits import PeriodicOrbit
from saltus.processes import HereFirst, is_stopped
from saltus.progress import Progress, Report, Reporter
from saltus.system import HybridSystem
from saltus.work import Cluster, Here, Outcome, Workers, processors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["continue_family"]


def continue_family(
    orbit: PeriodicOrbit,
    parameter: str,
    over: Mapping[str, ArrayLike],
    bounds: tuple[float, float],
    *,
    options: BranchOptions | None = None,
    workers: int | None = None,
    client: Any = None,
    progress: bool | Report = False,
) -> Family:
    """Return the branches of periodic orbits along one parameter, one for each value of further parameters.

    The orbit is first continued to each member's values, from the nearest values already reached. On this way
    `StepControl.at_grazing` and ``"GR"`` in `BranchOptions.stop_at` hold as on the branches. At each member's values
    `continue_orbit` traces the branch. Where branches take long, other processes trace them meanwhile. Where several
    parameters vary, the way follows one after the other. Where it is blocked, it is split into two, four or up to 16
    stairs along the straight line.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Orbit that is continued to each member's values.
    parameter : str
        The parameter that varies along each branch.
    over : mapping of str to array_like, shape (member,)
        Parameters or groups of them, and their values: member `i` has the i-th value of each. All have equal length.
    bounds : (float, float)
        Interval of the parameter; the orbit must lie in it.
    options : BranchOptions, optional
        Steps, directions, events and where to stop, the same for all branches.
    workers : int, optional
        Processes on this machine that compute branches. With 1 this process computes them. By default as many as this
        process has processors, at most one for each member. They are started where they save time: each takes seconds
        to start, so this process traces the first branches. For a minute they rest, for the next call. A daemonic
        process, as a worker of Dask or of a pool, may start no others and computes the branches itself.
    client : dask.distributed.Client, optional
        A cluster that computes the branches instead.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress`, which counts the members done.

    Returns
    -------
    Family
        The same, to the last digit, with any number of processes. Where a member fails, the others are kept and the
        reason is in `Family.failures`. After an interrupt (Ctrl-C) finished members are kept and processes at work end;
        branches on a cluster are traced to their ends.

    Raises
    ------
    InputError
        A name, a value, bounds or an option that cannot be used.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode, Transition, solve_orbit
    >>> oscillator = HybridSystem(
    ...     ("x", "v"), {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0},
    ...     {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
    ...     [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    ... )
    >>> orbit = solve_orbit(oscillator, {}, [("free", "impact", [1.0, -1.3, 0.1], 6.28)])
    >>> family = continue_family(orbit, "A", {"d": [1.0, 2.0, 3.0]}, (0.05, 1.2), workers=1)
    >>> [round(branch["GR1"].parameters["A"], 9) for branch in family]
    [0.1, 0.2, 0.3]
    """
    options = BranchOptions() if options is None else checks.instance("options", options, BranchOptions)
    reporter = Reporter(progress)
    checks.chosen("parameter", parameter, checks.instance("orbit", orbit, PeriodicOrbit).system.parameter_names)
    first = Task(parameter, bounds, replace(options, steps=replace(options.steps, max_points=1)))
    trial = first.branch(orbit)  # raises `InputError` for an argument that cannot be used
    if is_interrupted(trial):
        raise KeyboardInterrupt
    table = _read_over(orbit.system, parameter, over)
    places = _places(orbit.system, table)
    reporter.expect(len(places))
    task = Task(parameter, tuple(trial.options["bounds"]), options)
    pool = _pool(workers, client, len(places))
    with reporter:
        outcomes = _outcomes(task, carried(orbit, places, options), pool, _Record(table, reporter))
    return Family(
        orbit.system,
        parameter,
        table,
        tuple(None if isinstance(outcome, str) else outcome for outcome in outcomes),
        {i: outcome for i, outcome in enumerate(outcomes) if isinstance(outcome, str)},
        dict(trial.options) | {"steps": asdict(options.steps)},
        _INTERRUPTED in outcomes,
    )


_INTERRUPTED = "interrupted before it was done"  # reason in `Family.failures`


def _outcomes(
    task: Task, starts: Iterable[tuple[int, PeriodicOrbit | str]], pool: Workers, record: _Record
) -> list[Branch | str]:
    """Return each member's branch, or the reason why it has none."""
    members = len(next(iter(record.table.values())))
    try:
        with suppress(KeyboardInterrupt):  # finished members are kept
            for index, start in starts:
                if isinstance(start, str):
                    record.keep([(index, start)])
                else:
                    record.tell(index, "the start is there", 0)
                    pool.submit(index, _traced, task, start)
                record.keep(_results(pool.finished(waiting=False)))
            while len(record.outcomes) < members:
                record.keep(_results(pool.finished(waiting=True)))
    finally:
        pool.stop()
    record.outcomes |= _results(pool.finished(waiting=False))
    return [record.outcomes.get(i, _INTERRUPTED) for i in range(members)]


@dataclass
class _Record:
    """Outcomes so far: a branch or a reason for each finished member."""

    table: Mapping[str, NDArray[np.float64]]
    reporter: Reporter
    outcomes: dict[int, Branch | str] = field(default_factory=dict)

    def keep(self, found: Sequence[tuple[int, Branch | str]]) -> None:
        """Keep finished members, then report them: a report may be interrupted."""
        self.outcomes |= found
        for index, outcome in found:
            self.tell(index, outcome if isinstance(outcome, str) else f"{len(outcome)} orbits")

    def tell(self, index: int, what: str, done: int = 1) -> None:
        """Report a member's outcome and that `done` more members are finished."""
        self.reporter.step(done, f"{label(self.table, index)}: {what}")


def _read_over(system: HybridSystem, parameter: str, over: object) -> dict[str, NDArray[np.float64]]:
    """Return the members' own parameters or groups with their values, checked."""
    given = checks.mapping("over", over, "parameters to values, as {'d': [0.9, 1.0, 1.1]}")
    if not given:
        raise InputError("over", over, "a mapping of parameters to values, as {'d': [0.9, 1.0, 1.1]}")
    known = [name for name in system.parameter_names if name != parameter]
    known += [name for name, members in system.groups.items() if parameter not in members]
    table: dict[str, NDArray[np.float64]] = {}
    taken: dict[str, str] = {}
    for name, values in given.items():
        if name not in known:
            along = name == parameter or parameter in system.groups.get(name, ())
            hint = f"{parameter!r} varies along the branches" if along else nearest(name, known)
            raise InputError("over", name, f"one of {', '.join(known)}", hint)
        for member in system.groups.get(name, (name,)):
            if member in taken:
                raise InputError("over", name, f"without {member!r}, which {taken[member]!r} sets already")
            taken[member] = name
        allowed = "a sequence of numbers, one for each member, at least one"
        column = checks.array(f"over[{name!r}]", values, allowed, finite=False)
        if column.ndim != 1 or not column.size:
            raise InputError(f"over[{name!r}]", values, allowed)
        table[name] = column
    lengths = {name: len(values) for name, values in table.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{count} of {name}" for name, count in lengths.items())
        raise InputError("over", told, "as many values of each", "member i has the i-th value of each")
    return table


def _places(system: HybridSystem, table: Mapping[str, NDArray[np.float64]]) -> list[dict[str, float]]:
    """Return each member's own parameters with their values, groups resolved; the system checks the values."""
    places = []
    for i in range(len(next(iter(table.values())))):
        values = system.resolve({name: float(column[i]) for name, column in table.items()})
        names = [member for name in table for member in system.groups.get(name, (name,))]
        places.append({name: values[name] for name in names})
    return places


def _pool(workers: object, client: Any, members: int) -> Workers:
    if client is not None:
        if workers is not None:
            raise InputError("workers", workers, "left out where a client is given")
        return Cluster(client)
    count = min(processors() if workers is None else checks.count("workers", workers), members)
    # a daemonic process, as a worker of Dask or of a pool, may not have children
    return Here() if count == 1 or current_process().daemon else HereFirst(count, "workers=1", members)


def _traced(task: Task, start: PeriodicOrbit) -> Branch | str:
    """Return a member's branch, in the process that computes it; an interrupt ends the continuation."""
    given_up = []

    def watch(progress: Progress) -> None:
        if is_stopped():
            given_up.append(progress)
            raise KeyboardInterrupt

    outcome = task.trace(start, watch)
    if isinstance(outcome, str) or not is_interrupted(outcome):
        return outcome
    if given_up:
        return _INTERRUPTED
    raise KeyboardInterrupt


def _results(done: Iterable[tuple[int, Outcome]]) -> list[tuple[int, Branch | str]]:
    return [(index, _result(outcome)) for index, outcome in done]


def _result(outcome: Outcome) -> Branch | str:
    try:
        branch: Branch | str = outcome.result()
    except Exception as error:
        return f"its worker was lost: {type(error).__name__}: {error}"
    return branch
