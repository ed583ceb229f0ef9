"""A cascade of period doublings of a map as a result."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.contents import Contents
from saltus.continuation.results.cascade import Doublings
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.described import described
from saltus.errors import InputError
from saltus.maps.orbit import MapOrbit, itinerary_of
from saltus.system.maps import Map

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["MapCascade"]

_KEPT = ("state", "parameter", "multiplier")  # dimensions that all branches share


@dataclass(frozen=True, eq=False, repr=False)
class MapCascade(Doublings):
    """Successive period doublings of orbits of a map along a parameter; `Doublings` lists the attributes.

    Examples
    --------
    >>> import saltus
    >>> logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> orbit = saltus.find_orbit(logistic, {"r": 2.5}, x0=[0.1])
    >>> branch = saltus.continue_orbit(orbit, "r", bounds=(2.0, 3.6))
    >>> cascade = saltus.follow_cascade(branch["PD1"], (2.0, 3.6), doublings=3)
    >>> [round(float(value), 5) for value in cascade.values]
    [3.0, 3.44949, 3.54409, 3.56441]
    """

    start: SpecialPoint[MapOrbit]
    branches: tuple[MapBranch, ...]

    @property
    def system(self) -> Map:
        """The map."""
        return self.start.map_orbit.system

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return all branches and the first doubling as one Dataset.

        Names of variables and of dimensions begin with ``start.``, ``level0.``, ``level1.`` and so on; each of these
        groups is what `MapBranch.to_xarray` returns. That of the start has one point.
        """
        from saltus.extras import xr

        data: dict[str, Any] = {}
        coords: dict[str, Any] = {}
        attributes = {}
        for name, branch in zip(self._groups(len(self.branches)), (self._first(), *self.branches), strict=True):
            part = branch.to_xarray()
            attributes[name] = dict(part.attrs)
            coords |= {str(key): variable.variable for key, variable in part.coords.items()}
            for key, variable in part.data_vars.items():
                dims = tuple(dim if dim in _KEPT else f"{name}.{dim}" for dim in variable.dims)
                data[f"{name}.{key}"] = (dims, variable.values)
        attrs = {
            "levels": len(self.branches),
            "groups": json.dumps(attributes),
            "stopped": self.stopped,
            "options": json.dumps(dict(self.options)),
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @staticmethod
    def _groups(levels: int) -> list[str]:
        return ["start", *(f"level{k}" for k in range(levels))]

    def _first(self) -> MapBranch:
        """Return a branch of one point, the first doubling."""
        orbit, zero = self.start.map_orbit, np.zeros(1)
        return MapBranch(
            system=orbit.system, parameter=self.parameter, parameters=dict(orbit.parameters),
            values=np.array([orbit.parameters[self.parameter]]), points=orbit.points[None],
            multipliers=orbit.multipliers[None], forms=(itinerary_of(orbit.system, orbit.itinerary),),
            form=np.zeros(1, np.int64), stable=np.array([orbit.stable]), regular=np.array([orbit.regular]),
            residual=np.array([orbit.residual]), arclength=zero,
            special_points=SpecialPoints([self.start], self.start.varied), stopped=("the start", "the start"),
        )  # fmt: skip

    @classmethod
    def _read(cls, held: Contents) -> MapCascade:
        levels, groups = held.count("levels", 0, 64), held.json("groups", dict)
        branches = []
        for name in cls._groups(levels):
            if not isinstance(groups.get(name), dict):
                raise InputError("attribute 'groups'", list(groups), f"one called {name}")
            own = [key for key in held.dataset.data_vars if str(key).startswith(f"{name}.")]
            part = held.dataset[own]
            taken = {key: str(key).removeprefix(f"{name}.") for key in (*own, *part.dims) if str(key).startswith(name)}
            part = part.rename(taken)
            part.attrs = groups[name]
            branches.append(MapBranch.from_xarray(part))
        start = branches[0].special_points.of_type("PD")
        if len(start) != 1 or not all(branch.special_points.of_type("PD") for branch in branches[1:-1]):
            raise InputError("special points", "no PD", "a PD on each branch but the last")
        return cls(start[0], tuple(branches[1:]), held.text("stopped"), held.json("options", dict))
