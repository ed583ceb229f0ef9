"""Many branches at once: one for each value of other parameters."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import Contents, as_json
from saltus.continuation.branch import Branch
from saltus.errors import InputError
from saltus.results import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Family", "label"]

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
    def _read(cls, held: Contents) -> Family:
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
            member = held.dataset.isel({dim: slice(ends[i], ends[i + 1]) for dim, ends in starts.items()})
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
        places = [label(self.over, i) for i in range(len(self))]
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


def label(over: Mapping[str, NDArray[np.float64]], index: int) -> str:
    """Return the values that set a member apart, in words."""
    return ", ".join(f"{name} = {values[index]:.6g}" for name, values in over.items())
