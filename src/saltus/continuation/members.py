"""The branches of a family: asked for, computed at the same time, and collected."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import current_process
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.family import Family, label
from saltus.continuation.orbits import continue_orbit
from saltus.continuation.way import Task, carried, is_interrupted
from saltus.errors import InputError, nearest
from saltus.orbits import PeriodicOrbit
from saltus.system import HybridSystem
from saltus.work import Cluster, Here, Outcome, Processes, Workers, is_stopped, processors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["continue_family"]


def continue_family(
    orbit: PeriodicOrbit,
    parameter: str,
    over: Mapping[str, ArrayLike],
    bounds: tuple[float, float],
    *,
    steps: StepControl | None = None,
    directions: str = "both",
    events: Mapping[str, float] | None = None,
    stop_at: str | Iterable[str] = (),
    at_grazing: str = "switch",
    workers: int | None = None,
    client: Any = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Family:
    """Return the branches of periodic orbits along one parameter, one for each value of others.

    The orbit is first carried to each member's values, as a branch along what varies: from the nearest values already
    reached, and through grazings as `at_grazing` says. From there `continue_orbit` is called. The way is gone in this
    process, while others are at work on the branches. Where several parameters vary, it leads from the one place to the
    other along one of them after the other; where that is blocked, in two, four or up to 16 stairs along the straight
    line between them.

    Parameters
    ----------
    orbit : PeriodicOrbit
        Where all branches start; carried to each member's values.
    parameter : str
        What varies along each branch.
    over : mapping of str to array_like, shape (member,)
        Parameters or groups of them, and their values: member `i` has the i-th value of each. All have equal length.
    bounds : (float, float)
        Interval of the parameter; the orbit must lie in it.
    steps, directions, events, stop_at, at_grazing
        As for `continue_orbit`, the same for all branches.
    workers : int, optional
        Processes on this machine that compute branches; 1 starts none but uses this one. By default as many as
        there are processors for this process, at most one for each member. To start one takes a second or two. In a
        daemonic process, which may not start others, as a worker of Dask or of a pool, branches are computed there.
    client : dask.distributed.Client, optional
        A cluster that computes the branches instead.
    progress : callable, optional
        Called with the count of members that are done, the count of all members, and what has just been done in words.

    Returns
    -------
    Family
        The same, to the last digit, with any count of processes. A member that fails does not lose the others: its
        reason is in `Family.failures`. An interrupt (Ctrl-C) keeps the members that are done, and no process stays
        behind; what runs on a cluster goes on to the end of its branch.

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
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    checks.function("progress", progress, "of two counts and a text")
    trial = continue_orbit(  # says what is wrong with any of these
        orbit, parameter, bounds, steps=replace(control, most=1), directions=directions, events=events,
        stop_at=stop_at, at_grazing=at_grazing,
    )  # fmt: skip
    if is_interrupted(trial):
        raise KeyboardInterrupt
    bounds = tuple(trial.options["bounds"])
    options = {name: trial.options[name] for name in ("directions", "events", "stop_at", "at_grazing")}
    table = _read_over(orbit.system, parameter, over)
    places = _places(orbit.system, table)
    task = Task(parameter, bounds, {"steps": control} | options)
    pool = _pool(workers, client, len(places))
    record = _Record(table, len(places), progress)
    try:
        with suppress(KeyboardInterrupt):  # what is done is kept
            for index, start in carried(orbit, places, at_grazing):
                if isinstance(start, str):
                    record.keep([(index, start)])
                else:
                    record.tell(index, "the start is there")
                    pool.submit(index, _traced, task, start)
                record.keep(_results(pool.finished(waiting=False)))
            while len(record.outcomes) < len(places):
                record.keep(_results(pool.finished(waiting=True)))
    finally:
        pool.stop()
    record.outcomes |= _results(pool.finished(waiting=False))
    outcomes = [record.outcomes.get(i, _INTERRUPTED) for i in range(len(places))]
    return Family(
        orbit.system,
        parameter,
        table,
        tuple(outcome if isinstance(outcome, Branch) else None for outcome in outcomes),
        {i: outcome for i, outcome in enumerate(outcomes) if isinstance(outcome, str)},
        dict(trial.options) | {"steps": asdict(control)},
        _INTERRUPTED in outcomes,
    )


_INTERRUPTED = "interrupted before it was done"


@dataclass
class _Record:
    """What has come out so far: a branch or a reason for each member."""

    table: Mapping[str, NDArray[np.float64]]
    total: int
    progress: Callable[[int, int, str], None] | None
    outcomes: dict[int, Branch | str] = field(default_factory=dict)
    told: int = 0

    def keep(self, found: Sequence[tuple[int, Branch | str]]) -> None:
        """Keep what is done, all of it before anything is told: that may be interrupted."""
        self.outcomes |= found
        for index, outcome in found:
            self.told += 1
            self.tell(index, outcome if isinstance(outcome, str) else f"{len(outcome)} orbits")

    def tell(self, index: int, what: str) -> None:
        if self.progress is not None:
            self.progress(self.told, self.total, f"{label(self.table, index)}: {what}")


def _read_over(system: HybridSystem, parameter: str, over: object) -> dict[str, NDArray[np.float64]]:
    """Return the values of what varies from member to member, checked."""
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
    """Return the parameters that vary at each member, groups spread out, as far as the system allows them."""
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
    return Here() if count == 1 or current_process().daemon else Processes(count, "workers=1")


def _traced(task: Task, start: PeriodicOrbit) -> Branch | str:
    """A branch, where it is computed; an interrupt there gives it up."""

    def watch(count: int, value: float) -> None:
        if is_stopped():
            raise KeyboardInterrupt

    outcome = task.trace(start, watch)
    if isinstance(outcome, str) or not is_interrupted(outcome):
        return outcome
    if is_stopped():
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
