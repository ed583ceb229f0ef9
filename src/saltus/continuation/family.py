"""Many branches at once: one for each value of other parameters, over processes or a Dask cluster."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from multiprocessing import current_process, get_context, parent_process
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus import checks
from saltus.contents import Contents, as_json
from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.orbits import continue_orbit
from saltus.errors import InputError, SaltusError, nearest
from saltus.orbits import PeriodicOrbit
from saltus.results import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import held_system
from saltus.work import starting

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Family", "continue_family"]

_LISTED = 24
"""Members that a `repr` lists."""


@dataclass(frozen=True, eq=False, repr=False)
class Family(Result):
    """Branches of periodic orbits along one parameter, one for each value of others.

    ``family[i]`` is the branch of member `i`, ``len(family)`` counts the members, iteration goes through `branches`.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameter : str
        What varies along each branch.
    over : mapping of str to ndarray, shape (member,)
        What varies from branch to branch, and its values.
    branches : tuple of Branch or None, one for each member
        None where there is no branch.
    failures : mapping of int to str
        Why there is none, by the member's index.
    options : mapping
        What `continue_family` was asked for: bounds, steps, directions, events, stop_at, at_grazing.
    interrupted : bool
        Whether the computation was interrupted (Ctrl-C) before all members were done.
    """

    system: HybridSystem
    parameter: str
    over: Mapping[str, NDArray[np.float64]]
    branches: tuple[Branch | None, ...]
    failures: Mapping[int, str] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    interrupted: bool = False

    def __post_init__(self) -> None:
        over = {name: frozen(values) for name, values in self.over.items()}
        object.__setattr__(self, "over", MappingProxyType(over))
        object.__setattr__(self, "failures", MappingProxyType(dict(sorted(self.failures.items()))))

    def __len__(self) -> int:
        return len(self.branches)

    def __getitem__(self, index: int) -> Branch:
        """Return the branch of a member; raise `InputError` with the reason where there is none."""
        index = checks.count("index", index, -len(self), len(self) - 1)
        branch = self.branches[index]
        if branch is None:
            raise InputError("index", index, "that of a member with a branch", self.failures[index % len(self)])
        return branch

    def __iter__(self) -> Iterator[Branch | None]:
        """Go through the members' branches, None where there is none."""
        return iter(self.branches)

    def to_xarray(self) -> xr.Dataset:
        """Return all branches as one Dataset, with ragged dimensions.

        What `Branch.to_xarray` holds of each member stands one after the other: points along ``point``, special points
        along ``special``. ``count`` (member) says how many points each member has, ``special_count`` how many special
        points; by the CF conventions, section 9.3.3 (contiguous ragged arrays), the attribute ``sample_dimension`` of a
        count names the dimension that it counts. ``point_member`` and ``special_member`` give the member of each point.
        The values of `over` are coordinates along ``member``, ``failure`` is the reason where there is no branch, and
        ``branch_attributes`` is JSON of each branch's own attributes.
        """
        import xarray as xr

        members = {i: branch.to_xarray() for i, branch in enumerate(self.branches) if branch is not None}
        data: dict[str, Any] = {}
        coords: dict[str, Any] = {}
        attributes, failures = np.full(len(self), "", dtype=object), np.full(len(self), "", dtype=object)
        for i, reason in self.failures.items():
            failures[i] = reason
        for i, dataset in members.items():
            own = {key: value for key, value in dataset.attrs.items() if key not in _SHARED}
            attributes[i] = json.dumps(own)
        if members:
            first = next(iter(members.values()))
            coords |= {str(name): variable.variable for name, variable in first.coords.items()}
            for name, variable in first.data_vars.items():
                values = np.concatenate([dataset[name].values for dataset in members.values()])
                data[str(name)] = (variable.dims, values, variable.attrs)
            for dim in dict.fromkeys(str(first[name].dims[0]) for name in data):
                sizes = np.zeros(len(self), dtype=np.int64)
                for i, dataset in members.items():
                    sizes[i] = dataset.sizes[dim]
                data["count" if dim == "point" else f"{dim}_count"] = ("member", sizes, {"sample_dimension": dim})
                if dim in ("point", "special"):
                    data[f"{dim}_member"] = (dim, np.repeat(np.arange(len(self)), sizes))
        data |= {"failure": ("member", failures), "branch_attributes": ("member", attributes)}
        taken = {*data, *coords, "member", *(dim for dims, *_ in data.values() for dim in np.atleast_1d(dims))}
        names = {name: f"over_{name}" if name in taken else name for name in self.over}
        coords |= {names[name]: ("member", values) for name, values in self.over.items()}
        attrs = {
            "parameter": self.parameter,
            "over": json.dumps(names),
            "definition": json.dumps(self.system.definition()),
            "options": json.dumps(dict(self.options)),
            "interrupted": int(self.interrupted),
            "ragged": "contiguous ragged arrays: a count's sample_dimension holds the members one after the other",
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Family:
        """Return the family that `to_xarray` described; raise `InputError` where it cannot be one."""
        held = Contents(dataset)
        system = held_system(held)
        members = held.size("member", least=1)
        counts = _counts(held)
        starts = {dim: [0, *np.cumsum(sizes).tolist()] for dim, sizes in counts.items()}
        reasons = held.array("failure", ("member",), str).tolist()
        attributes = held.array("branch_attributes", ("member",), str).tolist()
        shared = {name: held.text(name) for name in _SHARED}
        branches: list[Branch | None] = []
        for i in range(members):
            if reasons[i]:
                branches.append(None)
                continue
            member = dataset.isel({dim: slice(ends[i], ends[i + 1]) for dim, ends in starts.items()})
            member.attrs = shared | as_json(attributes[i], f"branch_attributes of member {i}", dict)
            branches.append(Branch.from_xarray(member))
        parameter = held.text("parameter")
        if any(branch is not None and branch.parameter != parameter for branch in branches):
            raise InputError("attribute 'parameter'", parameter, "that of all branches")
        over = held.json("over", dict)
        known = {*system.parameter_names, *system.groups}
        if not over or not set(over) <= known or not all(isinstance(name, str) for name in over.values()):
            raise InputError("attribute 'over'", sorted(over), f"names of variables, by one of {', '.join(known)}")
        return cls(
            system,
            parameter,
            {name: held.array(variable, ("member",)) for name, variable in over.items()},
            tuple(branches),
            {i: reason for i, reason in enumerate(reasons) if reason},
            held.json("options", dict),
            bool(held.count("interrupted", most=1)),
        )

    def __repr__(self) -> str:
        found = len(self) - len(self.failures)
        lines = [
            f"Family of {self.system.name or 'a hybrid system'}: {found} of {len(self)} branches in {self.parameter}"
            + (", interrupted" if self.interrupted else "")
        ]
        places = [_label(self.over, i) for i in range(len(self))]
        shown = list(range(len(self)))
        if len(self) > _LISTED:
            shown = [*shown[: _LISTED // 2], *shown[-_LISTED // 2 :]]
        width = max((len(places[i]) for i in shown), default=0)
        for position, i in enumerate(shown):
            if position and i > shown[position - 1] + 1:
                lines.append(f"  ... {i - shown[position - 1] - 1} more ...")
            lines.append(f"  {places[i]:{width}s}  {self._line(i)}")
        return "\n".join(lines)

    def _line(self, index: int) -> str:
        branch = self.branches[index]
        if branch is None:
            return f"none: {self.failures[index]}"
        types = [point.type for point in branch.special_points]
        specials = ", ".join(f"{types.count(name)} {name}" for name in dict.fromkeys(types)) or "no special points"
        low, high = (float(branch.values.min()), float(branch.values.max())) if len(branch) else (math.nan, math.nan)
        return f"{len(branch)} orbits, {self.parameter} from {low:.6g} to {high:.6g}; {specials}"


def _counts(held: Contents) -> dict[str, NDArray[np.int64]]:
    """Return how much of each ragged dimension belongs to each member."""
    counts = {}
    for name, variable in held.dataset.data_vars.items():
        if "sample_dimension" in variable.attrs:
            dim = str(variable.attrs["sample_dimension"])
            counts[dim] = held.array(str(name), ("member",), int, least=0)
            if counts[dim].sum() != held.size(dim):
                raise InputError(
                    f"variable {name!r}", int(counts[dim].sum()), f"{held.size(dim)} in all, as of {dim!r}"
                )
    return counts


_SHARED = ("definition",)
"""Attributes of a branch's Dataset that are the family's as well."""


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
    processes: int | None = None,
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
    processes : int, optional
        How many processes on this machine compute branches; 1 starts none but uses this one. By default as many as
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
    >>> family = continue_family(orbit, "A", {"d": [1.0, 2.0, 3.0]}, (0.05, 1.2), processes=1)
    >>> [round(branch["GR1"].parameters["A"], 9) for branch in family]
    [0.1, 0.2, 0.3]
    """
    control = StepControl() if steps is None else checks.instance("steps", steps, StepControl)
    checks.function("progress", progress, "of two counts and a text")
    trial = continue_orbit(  # says what is wrong with any of these
        orbit, parameter, bounds, steps=replace(control, most=1), directions=directions, events=events,
        stop_at=stop_at, at_grazing=at_grazing,
    )  # fmt: skip
    if _is_interrupted(trial):
        raise KeyboardInterrupt
    bounds = tuple(trial.options["bounds"])
    options = {name: trial.options[name] for name in ("directions", "events", "stop_at", "at_grazing")}
    table = _read_over(orbit.system, parameter, over)
    places = _places(orbit.system, table)
    workers = _workers(_Task(parameter, bounds, {"steps": control} | options), processes, client, len(places))
    record = _Record(table, len(places), progress)
    try:
        with suppress(KeyboardInterrupt):  # what is done is kept
            for index, start in _carried(orbit, places, at_grazing):
                if isinstance(start, str):
                    record.keep([(index, start)])
                else:
                    record.tell(index, "the start is there")
                    workers.submit(index, start)
                record.keep(workers.finished(waiting=False))
            while len(record.outcomes) < len(places):
                record.keep(workers.finished(waiting=True))
    finally:
        workers.stop()
    record.outcomes |= workers.finished(waiting=False)
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
            self.progress(self.told, self.total, f"{_label(self.table, index)}: {what}")


def _label(over: Mapping[str, NDArray[np.float64]], index: int) -> str:
    return ", ".join(f"{name} = {values[index]:.6g}" for name, values in over.items())


def _is_interrupted(branch: Branch) -> bool:
    return "interrupted" in branch.stopped


# input


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


# the way to each member


_WAY = StepControl(initial=0.05, largest=0.25, most=500)
"""Steps on the way to a member: only its end is wanted."""

_HALVINGS = 4
"""The way along several parameters has at most 2^4 stairs."""


def _carried(
    orbit: PeriodicOrbit, places: Sequence[Mapping[str, float]], at_grazing: str
) -> Iterator[tuple[int, PeriodicOrbit | str]]:
    """Yield each member's index and the orbit at its values, or why there is none, the nearest member first.

    Each is carried from the nearest values already reached; where that is blocked, from the given orbit.
    """
    names = list(places[0])
    rows = np.array([[place[name] for name in names] for place in places])
    origin = np.array([orbit.parameters[name] for name in names])
    width = np.ptp(np.vstack([rows, origin]), axis=0)
    rows, origin = rows / np.where(width > 0.0, width, 1.0), origin / np.where(width > 0.0, width, 1.0)
    away = np.linalg.norm(rows - origin, axis=1)
    sources: list[PeriodicOrbit] = [orbit] * len(places)
    left = set(range(len(places)))
    while left:
        index = min(left, key=lambda i: (away[i], i))
        left.remove(index)
        reached = _carry(sources[index], places[index], at_grazing, _HALVINGS)
        if isinstance(reached, str) and sources[index] is not orbit:
            again = _carry(orbit, places[index], at_grazing, _HALVINGS)
            reached = again if isinstance(again, PeriodicOrbit) else reached
        if isinstance(reached, PeriodicOrbit):
            between = np.linalg.norm(rows - rows[index], axis=1)
            for i in left:
                if between[i] < away[i]:
                    away[i], sources[i] = between[i], reached
        yield index, reached


def _carry(orbit: PeriodicOrbit, place: Mapping[str, float], at_grazing: str, halvings: int) -> PeriodicOrbit | str:
    """Return the orbit at other values of parameters, along one after the other, or why the way is blocked."""
    apart = [name for name, value in place.items() if value != orbit.parameters[name]]
    here = orbit
    for name in apart:
        reached = _carry_along(here, name, place[name], at_grazing)
        if isinstance(reached, str):
            break
        here = reached
    else:
        return here
    if len(apart) > 1 and halvings:
        half = {name: 0.5 * (orbit.parameters[name] + place[name]) for name in apart}
        middle = _carry(orbit, half, at_grazing, halvings - 1)
        if isinstance(middle, PeriodicOrbit):
            return _carry(middle, place, at_grazing, halvings - 1)
    return reached


def _carry_along(orbit: PeriodicOrbit, name: str, value: float, at_grazing: str) -> PeriodicOrbit | str:
    """Return the orbit at another value of one parameter, or why there is none."""
    begin = orbit.parameters[name]
    bounds, direction = ((begin, value), "up") if value > begin else ((value, begin), "down")
    way = _Task(name, bounds, {"steps": _WAY, "directions": direction, "at_grazing": at_grazing}).trace(orbit)
    blocked = f"no way from {name} = {begin:.9g} to {value:.9g}: "
    if isinstance(way, str):
        return blocked + way
    if _is_interrupted(way):
        raise KeyboardInterrupt
    end, rounding = float(way.values[-1]), 1e-9 * abs(value - begin)
    if abs(end - value) > rounding:
        folds = [point.parameters[name] for point in way.special_points if point.type == "SN"]
        turned = folds and abs(end - begin) <= rounding
        return blocked + (f"saddle-node at {name} = {folds[0]:.9g}" if turned else way.stopped[1])
    reached = way.orbit(-1)
    return replace(reached, parameters=dict(reached.parameters) | {name: value})  # the bound, to its last digit


# the branches themselves


@dataclass(frozen=True)
class _Task:
    """What is asked for, of each member: a branch from its start."""

    parameter: str
    bounds: tuple[float, float]
    options: Mapping[str, Any]

    def trace(self, start: PeriodicOrbit, watch: Callable[[int, float], None] | None = None) -> Branch | str:
        """Return a branch, or in words why there is none."""
        try:
            return continue_orbit(start, self.parameter, self.bounds, progress=watch, **self.options)
        except SaltusError as error:
            return str(error)
        except Exception as error:  # whatever it is, the other members are not to be lost
            return f"{type(error).__name__}: {error}"


class _Workers(Protocol):
    """Something that traces branches."""

    def submit(self, index: int, start: PeriodicOrbit) -> None:
        """Take on a member."""

    def finished(self, *, waiting: bool) -> list[tuple[int, Branch | str]]:
        """Return members that are done, each once; wait for the next one, at most for a short while, if asked to."""

    def stop(self) -> None:
        """Give up what is not done."""


def _workers(task: _Task, processes: object, client: Any, members: int) -> _Workers:
    if client is not None:
        if processes is not None:
            raise InputError("processes", processes, "left out where a client is given")
        return _Cluster(task, client)
    if processes is None:
        available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        processes = available
    processes = checks.count("processes", processes)
    # a daemonic process, as a worker of Dask or of a pool, may not have children
    alone = min(processes, members) == 1 or current_process().daemon
    return _Here(task) if alone else _Pool(task, min(processes, members))


class _Here:
    """Work in this process."""

    def __init__(self, task: _Task) -> None:
        self._task = task
        self._done: list[tuple[int, Branch | str]] = []

    def submit(self, index: int, start: PeriodicOrbit) -> None:
        branch = self._task.trace(start)
        if isinstance(branch, Branch) and _is_interrupted(branch):
            raise KeyboardInterrupt
        self._done.append((index, branch))

    def finished(self, *, waiting: bool) -> list[tuple[int, Branch | str]]:
        done, self._done = self._done, []
        return done

    def stop(self) -> None:
        pass


class _Pool:
    """Work in processes on this machine."""

    def __init__(self, task: _Task, processes: int) -> None:
        context = get_context("spawn")  # the same everywhere, and safe where threads run: Numba's, NumPy's
        self._task, self._processes, self._started = task, processes, False
        self._stop = context.Event()
        self._executor = ProcessPoolExecutor(processes, context, _begin_worker, (self._stop,))
        self._pending: dict[Future[Branch | str], int] = {}
        self._refused: list[tuple[int, Branch | str]] = []

    def _start(self) -> None:
        """Start all processes at once: one that dies while others start can bring the executor's own thread down."""
        self._started = True
        with _unnoticed(), starting("processes=1"):
            for _ in range(self._processes):
                self._executor.submit(os.getpid)  # as long as none is idle, each call starts one

    def submit(self, index: int, start: PeriodicOrbit) -> None:
        if not self._started:
            self._start()
        try:
            future = self._executor.submit(_trace_in_worker, self._task, start)
        except RuntimeError as error:  # a worker has died
            self._refused.append((index, _told(error)))
        else:
            self._pending[future] = index

    def finished(self, *, waiting: bool) -> list[tuple[int, Branch | str]]:
        done, self._refused = self._refused, []
        futures = wait(self._pending, 0.5 if waiting and not done else 0.0, FIRST_COMPLETED).done
        return done + [(self._pending.pop(future), _result(future)) for future in futures]

    def stop(self) -> None:
        self._stop.set()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._pending = {future: index for future, index in self._pending.items() if not future.cancelled()}


class _Cluster:
    """Work on a Dask cluster."""

    def __init__(self, task: _Task, client: Any) -> None:
        if not callable(getattr(client, "submit", None)):
            raise InputError("client", client, "a dask.distributed.Client")
        self._task, self._client = task, client
        self._ready: Any = import_module("distributed").as_completed(loop=client.loop)
        self._pending: dict[str, tuple[int, Any]] = {}
        self._done: list[tuple[int, Branch | str]] = []

    def submit(self, index: int, start: PeriodicOrbit) -> None:
        future = self._client.submit(self._task.trace, start, pure=False)
        self._pending[future.key] = (index, future)
        self._ready.add(future)

    def finished(self, *, waiting: bool) -> list[tuple[int, Branch | str]]:
        done, self._done = self._done, []
        while self._pending and (self._ready.has_ready() or (waiting and not done)):
            future = next(self._ready)
            index, _ = self._pending.pop(future.key)
            done.append((index, _result(future)))
        return done

    def stop(self) -> None:
        finished = [(index, future) for index, future in self._pending.values() if future.done()]
        self._done += [(index, _result(future)) for index, future in finished]
        self._client.cancel([future for _, future in self._pending.values() if not future.done()])
        self._pending.clear()


def _result(future: Any) -> Branch | str:
    try:
        outcome: Branch | str = future.result()
    except Exception as error:
        return _told(error)
    return outcome


def _told(error: Exception) -> str:
    return f"its worker was lost: {type(error).__name__}: {error}"


# inside a worker process


_stop: Event | None = None
"""Set where the parent wants its workers to end."""


def _begin_worker(stop: Event) -> None:
    """Prepare a worker: Ctrl-C is the parent's to handle, and no worker outlives it."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_leave_with_parent, daemon=True).start()


def _leave_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _trace_in_worker(task: _Task, start: PeriodicOrbit) -> Branch | str:
    def watch(count: int, value: float) -> None:
        if _stop is not None and _stop.is_set():
            raise KeyboardInterrupt

    outcome = task.trace(start, watch)
    return _INTERRUPTED if isinstance(outcome, Branch) and _is_interrupted(outcome) else outcome


@contextmanager
def _unnoticed() -> Iterator[None]:
    """Let processes that start meanwhile neither run the main script again nor hear Ctrl-C.

    All that a worker does is in this package, so that a script needs no ``if __name__ == "__main__"``. The signal stays
    blocked in what starts here; in this process it waits.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    masked = None
    if sys.platform != "win32":
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        if sys.platform != "win32" and masked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
