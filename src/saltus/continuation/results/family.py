"""A family of branches as a result: one branch for each value of further parameters."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.branch_files import RAGGED, branches_of, branches_together
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result, frozen
from saltus.system import HybridSystem
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Family", "label"]

_LISTED = 24  # most members that a `repr` lists


@dataclass(frozen=True, eq=False, repr=False)
class Family(Result):
    """Branches of periodic orbits along one parameter, one for each value of further parameters.

    ``family[i]`` is the branch of member `i`, ``len(family)`` counts the members, iteration goes through `branches`.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameter : str
        The parameter that varies along each branch.
    over : mapping of str to ndarray, shape (member,)
        Names of the parameters, or groups of them, that vary from branch to branch, and their values.
    branches : tuple of Branch or None, one for each member
        None where there is no branch.
    failures : mapping of int to str
        The reason why a member has no branch, by its index.
    options : mapping
        Arguments of `continue_family`: ``bounds`` and the fields of its `BranchOptions`, ``steps`` (the fields of
        `StepControl`, ``at_grazing`` among them), ``directions``, ``events`` and ``stop_at``.
    interrupted : bool
        Whether the computation was interrupted (Ctrl-C) before all members were done.

    Examples
    --------
    >>> import saltus
    >>> spring = saltus.HybridSystem.smooth(
    ...     {"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.3, "w": 0.6}, phase=("s", "w")
    ... )
    >>> orbit = saltus.find_orbit(spring, x0=[0.0, 0.0])
    >>> family = saltus.continue_family(orbit, "w", {"c": [0.2, 0.4]}, (0.6, 1.4), workers=1)
    >>> [round(float(branch.column("max_x").max()), 2) for branch in family]
    [5.02, 2.55]
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

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return all branches as one Dataset, with ragged dimensions.

        The members' Datasets of `Branch.to_xarray` stand one after the other: points along ``point``, special points
        along ``special``. ``count`` (member) is the number of points of each member, ``special_count`` that of special
        points. The attribute ``sample_dimension`` of a count names the dimension that it counts, as section 9.3.3 of
        the CF conventions (contiguous ragged arrays) asks. ``point_member`` and ``special_member`` give the member of
        each point. The values of `over` are coordinates along ``member``. ``failure`` is the reason why a member has no
        branch. ``branch_attributes`` is JSON of each branch's own attributes.
        """
        from saltus.extras import xr

        data, coords = branches_together(self.branches, "member")
        failures = np.full(len(self), "", dtype=object)
        for i, reason in self.failures.items():
            failures[i] = reason
        data |= {"failure": ("member", failures)}
        taken = {*data, *coords, "member", *(dim for dims, *_ in data.values() for dim in np.atleast_1d(dims))}
        names = {name: f"over_{name}" if name in taken else name for name in self.over}
        coords |= {names[name]: ("member", values) for name, values in self.over.items()}
        attrs = {
            "parameter": self.parameter,
            "over": json.dumps(names),
            "definition": json.dumps(self.system.definition()),
            "options": json.dumps(dict(self.options)),
            "interrupted": int(self.interrupted),
            "ragged": RAGGED,
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with a row for each orbit of each branch: the member's values, then as of `Branch`.

        Returns
        -------
        pandas.DataFrame
            Its index is the member and the point; members without a branch have no rows.

        Raises
        ------
        SaltusError
            pandas is not installed.
        """
        from saltus.extras import pd

        tables = {i: branch.to_dataframe() for i, branch in enumerate(self.branches) if branch is not None}
        for i, table in tables.items():
            for name, values in reversed(list(self.over.items())):
                table.insert(0, name if name not in table else f"over_{name}", float(values[i]))
        return pd.concat(tables, names=["member"]) if tables else pd.DataFrame()

    @classmethod
    def _read(cls, held: Contents) -> Family:
        system = held_system(held)
        held.size("member", least=1)
        reasons = held.array("failure", ("member",), str).tolist()
        parameter = held.text("parameter")
        branches = branches_of(held, "member", [bool(reason) for reason in reasons], parameter)
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


def label(over: Mapping[str, NDArray[np.float64]], index: int) -> str:
    """Return the values of a member's own parameters as text."""
    return ", ".join(f"{name} = {values[index]:.6g}" for name, values in over.items())
