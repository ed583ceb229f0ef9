"""A whole bifurcation diagram as a result: its branches, of a flow or of a map, and how each was reached."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.results.prefixed import own_attributes, prefixed_part, side_by_side
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result
from saltus.scales import SPECIALS_AT_ONE_VALUE, SPECIALS_IN_ONE_STATE
from saltus.system import HybridSystem, Map
from saltus.system.angles import wrapped
from saltus.system.plain import held_any

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Diagram", "DiagramBranch", "Origin", "Place", "kind_of", "place_of"]

DiagramBranch = EquilibriumBranch | Branch | MapBranch

_KINDS: Mapping[str, type[DiagramBranch]] = {
    **{kind.counted: kind for kind in (Branch, EquilibriumBranch, MapBranch)},
    "cycles": MapBranch,  # as version 0.1.0 wrote
}


class Origin(NamedTuple):
    """How a branch of a diagram was reached."""

    parent: int  # index of the branch that it leaves; -1 for a branch through a start
    label: str  # label of the special point on that branch; empty for a start
    depth: int  # number of special points between the branch and a start


@dataclass(frozen=True, eq=False)
class Place:
    """Where a special point lies: parameter and extremes of the states, whatever the phase or the number of rounds."""

    value: float
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    circles: NDArray[np.int64]

    def is_same(self, other: Place, width: float, ranges: NDArray[np.float64]) -> bool:
        """Return whether both are one point, to the accuracy with which branches are located."""
        if abs(self.value - other.value) > SPECIALS_AT_ONE_VALUE * width:
            return False
        lows, highs = self.lows - other.lows, self.highs - other.highs
        away = np.maximum(np.abs(wrapped(lows, self.circles)), np.abs(wrapped(highs, self.circles)))
        return bool(np.all(away <= SPECIALS_IN_ONE_STATE * ranges))


def place_of(point: SpecialPoint[Any], parameter: str) -> Place:
    """Return where a special point of orbits, of equilibria or of orbits of a map lies."""
    lows, highs = point.solution.extremes
    return Place(point.parameters[parameter], lows, highs, point.solution.system.angle_places)


def kind_of(branch: DiagramBranch) -> str:
    """Return what a branch consists of: ``equilibria``, ``orbits``, or ``map orbits``."""
    return branch.counted


def _extremes(branch: DiagramBranch) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest value of each state on a branch."""
    lows, highs = branch.extremes
    return lows.min(axis=0), highs.max(axis=0)


@dataclass(frozen=True, eq=False, repr=False)
class Diagram(Result):
    """Branches of equilibria and of periodic orbits, or of orbits of a map, along one parameter, and where they meet.

    ``diagram[i]`` is branch `i`, ``len(diagram)`` counts the branches, iteration goes through them.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameter : str
        The parameter that varies.
    branches : tuple of EquilibriumBranch, Branch or MapBranch
        In the order in which they were found.
    origins : tuple of Origin
        How each branch was reached.
    failures : tuple of str
        Special points from which no other branch was found, and why.
    stopped : str
        Why the search ended: all branches to the depth, the most branches, or an interrupt.
    options : mapping
        Arguments of `saltus.diagram`.

    Examples
    --------
    >>> import saltus
    >>> lure = saltus.HybridSystem.smooth({"x": "y", "y": "z", "z": "-al*z - y - x + x**2"}, {"al": 1.2})
    >>> diagram = saltus.diagram(lure, "al", (0.5, 1.5), x0=[0.0, 0.0, 0.0])
    >>> [round(diagram[i][label].parameters["al"], 5) for i, label in ((0, "HB1"), (1, "PD1"))]
    [1.0, 0.6303]
    """

    system: HybridSystem | Map
    parameter: str
    branches: tuple[DiagramBranch, ...]
    origins: tuple[Origin, ...]
    failures: tuple[str, ...] = ()
    stopped: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.branches)

    def __getitem__(self, index: int) -> DiagramBranch:
        """Return a branch by its index."""
        return self.branches[checks.count("index", index, -len(self), len(self) - 1)]

    def __iter__(self) -> Iterator[DiagramBranch]:
        """Go through the branches."""
        return iter(self.branches)

    @property
    def ranges(self) -> NDArray[np.float64]:
        """How far each state varies in the diagram, shape (state,)."""
        lows, highs = zip(*(_extremes(branch) for branch in self), strict=True)
        return np.asarray(np.max(highs, axis=0) - np.min(lows, axis=0))

    @property
    def special_points(self) -> SpecialPoints[Any]:
        """The special points of all branches, each once, numbered by type over the diagram."""
        return SpecialPoints([point for _, point in self.numbered()], (self.parameter,))

    def numbered(self) -> list[tuple[int, SpecialPoint[Any]]]:
        """Return each special point once, with the index of the branch on which it was found first.

        Returns
        -------
        list of (int, SpecialPoint)
            Labels are numbered by type over the diagram.
        """
        found: list[tuple[int, SpecialPoint[Any]]] = []
        places: list[tuple[str, Place]] = []
        counts: dict[str, int] = {}
        width = max(float(np.ptp(branch.values)) for branch in self) or 1.0
        ranges = np.maximum(self.ranges, 1e-300)
        for i, branch in enumerate(self.branches):
            for point in branch.special_points:
                place = place_of(point, self.parameter)
                meets = {"BP": ("BP", "PD")}.get(point.type, (point.type,))
                if any(kind in meets and place.is_same(other, width, ranges) for kind, other in places):
                    continue
                places.append((point.type, place))
                counts[point.type] = counts.get(point.type, 0) + 1
                found.append((i, replace(point, label=f"{point.type}{counts[point.type]}")))
        return found

    def table(self) -> Any:
        """Return a table of the special points: label, type, parameter, branch, kind of solution, stability, period.

        Returns
        -------
        pandas.DataFrame
            One row for each special point, with the states of an equilibrium, or of the start of an orbit.
        """
        from saltus.extras import pd

        rows = []
        for i, point in self.numbered():
            solution = point.solution
            row: dict[str, Any] = {
                "label": point.label,
                "type": point.type,
                self.parameter: point.parameters[self.parameter],
                "branch": i,
                "of": kind_of(self.branches[i]),
                "stable": solution.stable,
                "period": np.nan if solution.at_rest else solution.period,
            }
            rows.append(row | {name: float(v) for name, v in zip(self.system.states, solution.x0, strict=True)})
        return pd.DataFrame(rows)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return all branches as one Dataset: variables and dimensions of branch `i` have the prefix ``branch<i>_``."""
        datasets = [branch.to_xarray() for branch in self.branches]
        attributes = [
            {"kind": kind_of(branch), "attributes": own_attributes(dataset)}
            for branch, dataset in zip(self.branches, datasets, strict=True)
        ]
        attrs = {
            "parameter": self.parameter,
            "definition": json.dumps(self.system.definition()),
            "branches": json.dumps(attributes),
            "origins": json.dumps([list(origin) for origin in self.origins]),
            "failures": json.dumps(list(self.failures)),
            "stopped": self.stopped,
            "options": json.dumps(dict(self.options)),
        }
        return side_by_side(datasets, "branch").assign_attrs(attrs)

    @classmethod
    def _read(cls, held: Contents) -> Diagram:
        system, parameter = held_any(held), held.text("parameter")
        checks.chosen("attribute 'parameter'", parameter, system.parameter_names)
        branches = []
        for i, told in enumerate(held.json("branches", list)):
            kind = _KINDS[checks.chosen(f"kind of branch {i}", _part(told, "kind", i), _KINDS)]
            branch = kind.from_xarray(prefixed_part(held, "branch", i, _part(told, "attributes", i)))
            if branch.parameter != parameter or branch.system != system:
                raise InputError(f"branch {i}", branch.parameter, f"of the diagram's system, along {parameter}")
            branches.append(branch)
        origins = held.json("origins", list)
        if len(origins) != len(branches):
            raise InputError("attribute 'origins'", len(origins), f"one for each of {len(branches)} branches")
        return cls(
            system,
            parameter,
            tuple(branches),
            tuple(_origin(origin, i) for i, origin in enumerate(origins)),
            tuple(held.texts("failures")),
            held.text("stopped"),
            held.json("options", dict),
        )

    def __repr__(self) -> str:
        of = self.system.name or self.system.unnamed
        lines = [f"Diagram of {of}: {len(self)} branches along {self.parameter}, {self.stopped}"]
        for i, (branch, origin) in enumerate(zip(self.branches, self.origins, strict=True)):
            begin = "a start" if origin.parent < 0 else f"{origin.label} of branch {origin.parent}"
            lines.append(
                f"  {i}: {len(branch)} {branch.called} from {begin}, {self.parameter} from {branch.values.min():.6g} "
                f"to {branch.values.max():.6g}"
            )
        lines += [f"  {line}" for line in repr(self.special_points).splitlines()]
        lines += [f"  no branch from {failure}" for failure in self.failures]
        return "\n".join(lines)


def _part(told: Any, name: str, index: int) -> Any:
    if not isinstance(told, dict) or name not in told:
        raise InputError(f"attribute 'branches'[{index}]", told, f"a mapping with {name!r}")
    return told[name]


def _origin(given: Any, index: int) -> Origin:
    """Return the origin of a branch from a file, checked."""
    if isinstance(given, list) and len(given) == 3:
        parent, label, depth = given
        whole = all(isinstance(number, int) and not isinstance(number, bool) for number in (parent, depth))
        if whole and isinstance(label, str) and -1 <= parent < max(index, 1) and depth >= 0:
            return Origin(parent, label, depth)
    raise InputError(f"attribute 'origins'[{index}]", given, "an earlier branch, a label and a depth")
