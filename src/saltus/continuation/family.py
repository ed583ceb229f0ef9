"""Many branches at once: one for each value of other parameters, over processes or a Dask cluster."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import current_process
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

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
from saltus.work import Cluster, Here, Outcome, Processes, Workers, is_stopped, processors

if TYPE_CHECKING:
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
    task = _Task(parameter, bounds, {"steps": control} | options)
    workers = _workers(processes, client, len(places))
    record = _Record(table, len(places), progress)
    try:
        with suppress(KeyboardInterrupt):  # what is done is kept
            for index, start in _carried(orbit, places, at_grazing):
                if isinstance(start, str):
                    record.keep([(index, start)])
                else:
                    record.tell(index, "the start is there")
                    workers.submit(index, _traced, task, start)
                record.keep(_results(workers.finished(waiting=False)))
            while len(record.outcomes) < len(places):
                record.keep(_results(workers.finished(waiting=True)))
    finally:
        workers.stop()
    record.outcomes |= _results(workers.finished(waiting=False))
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


def _workers(processes: object, client: Any, members: int) -> Workers:
    if client is not None:
        if processes is not None:
            raise InputError("processes", processes, "left out where a client is given")
        return Cluster(client)
    count = min(processors() if processes is None else checks.count("processes", processes), members)
    # a daemonic process, as a worker of Dask or of a pool, may not have children
    return Here() if count == 1 or current_process().daemon else Processes(count, "processes=1")


def _traced(task: _Task, start: PeriodicOrbit) -> Branch | str:
    """A branch, where it is computed; an interrupt there gives it up."""

    def watch(count: int, value: float) -> None:
        if is_stopped():
            raise KeyboardInterrupt

    outcome = task.trace(start, watch)
    if isinstance(outcome, str) or not _is_interrupted(outcome):
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
