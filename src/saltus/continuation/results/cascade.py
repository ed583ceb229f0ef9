"""A cascade of period doublings as a result: its doublings and the branches of doubled orbits between them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.contents import Contents
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.branch_files import RAGGED, branches_of, branches_together
from saltus.continuation.results.curve_files import special_points_of, special_variables
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.described import described
from saltus.errors import InputError
from saltus.orbits.orbit import TOLERANCES
from saltus.orbits.signature import signature_from
from saltus.result import Result
from saltus.system import HybridSystem
from saltus.system.plain import held_parameters, held_system

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Cascade", "Doublings"]

_FEIGENBAUM = 4.669201609  # limit of a cascade's ratios

# Dimensions of the start in a file by those of a curve's special points. No parameter's name has a point in it.
_START = {"special": "start.point", "special_ragged": "start.ragged", "tangent_ragged": "start.tangent_ragged"}


@dataclass(frozen=True, eq=False, repr=False)
class Doublings(Result):
    """Successive period doublings along a parameter: the base of `Cascade` and `MapCascade`."""

    start: SpecialPoint[Any]  # the first doubling, a PD of a branch
    # the branch of doubled orbits from each doubling to the next; the last may end without one
    branches: tuple[Any, ...]
    stopped: str  # why the cascade ended
    # arguments of `follow_cascade`: ``bounds``, ``doublings`` and ``steps`` (the fields of `StepControl`)
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def parameter(self) -> str:
        """The parameter that varies."""
        return self.start.varied[0]

    @cached_property
    def points(self) -> tuple[SpecialPoint[Any], ...]:
        """The period doublings: of the orbit, of the doubled one, and so on."""
        return (self.start, *(found[0] for b in self.branches if (found := b.special_points.of_type("PD"))))

    @property
    def values(self) -> NDArray[np.float64]:
        """The parameter at each period doubling, shape (point,)."""
        return np.array([point.parameters[self.parameter] for point in self.points])

    @property
    def ratios(self) -> NDArray[np.float64]:
        """Feigenbaum ratios (v[k] - v[k - 1]) / (v[k + 1] - v[k]) of `values` v, shape (point - 2,); limit 4.669."""
        gaps = np.diff(self.values)
        return np.asarray(gaps[:-1] / gaps[1:])

    @property
    def limit(self) -> float:
        """The parameter at which the cascade accumulates, by its last gap and Feigenbaum's constant.

        NaN where only one doubling is known.
        """
        if len(self.points) < 2:
            return math.nan
        return float(self.values[-1] + (self.values[-1] - self.values[-2]) / (_FEIGENBAUM - 1.0))

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with a row for each doubling: its number, the parameter, the period, the ratio."""
        from saltus.extras import pd

        ratios = [math.nan, *self.ratios.tolist(), math.nan][: len(self.points)]
        return pd.DataFrame(
            {
                "doublings": range(len(self.points)),
                self.parameter: self.values,
                "period": [point.solution.period for point in self.points],
                "ratio": ratios,
            }
        )

    def __repr__(self) -> str:
        lines = [f"{type(self).__name__} of {len(self.points)} period doublings along {self.parameter}"]
        for k, point in enumerate(self.points):
            ratio = f", ratio {self.ratios[k - 1]:.6g}" if 0 < k < len(self.points) - 1 else ""
            lines.append(
                f"  period {2**k:<3d} doubles at {self.values[k]:.12g}{ratio}, T = {point.solution.period:.6g}"
            )
        return "\n".join([*lines, f"  ended: {self.stopped}"])


@dataclass(frozen=True, eq=False, repr=False)
class Cascade(Doublings):
    """Successive period doublings of periodic orbits along a parameter; `Doublings` lists the attributes.

    Examples
    --------
    >>> import saltus
    >>> lure = saltus.HybridSystem.smooth({"x": "y", "y": "z", "z": "-al*z - y - x + x**2"}, {"al": 1.2})
    >>> diagram = saltus.diagram(lure, "al", (0.5, 1.5), x0=[0.0, 0.0, 0.0])
    >>> cascade = saltus.follow_cascade(diagram[1]["PD1"], (0.5, 1.5), doublings=2)
    >>> [round(float(value), 5) for value in cascade.values]
    [0.6303, 0.57963, 0.56922]
    """

    start: SpecialPoint
    branches: tuple[Branch, ...]

    @property
    def system(self) -> HybridSystem:
        """The system."""
        return self.start.orbit.system

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return all branches as one Dataset, and the first doubling.

        The branches stand one after the other, as in `Family.to_xarray`, counted along ``level`` instead of ``member``.
        Variables that begin with ``start.`` hold the first doubling, as ``special_`` do in `Branch.to_xarray`.
        """
        from saltus.extras import xr

        orbit = self.start.orbit
        specials = SpecialPoints([self.start], self.start.varied)
        variables = special_variables(specials, self.start.varied, len(orbit.multipliers), [orbit.form], self.system)
        data, coords = branches_together(self.branches, "level")
        for name, (dims, values) in variables.items():
            named = tuple(_START.get(dim, dim) for dim in ((dims,) if isinstance(dims, str) else dims))
            data[name.replace("special_", "start.", 1)] = (named, values)
        coords |= {
            "state": list(self.system.states),
            "quantity": [*self.system.all_states, *self.system.output_names],
            "parameter": [self.parameter],
        }
        form = orbit.form
        attrs = {
            "parameter": self.parameter,
            "parameters": json.dumps(dict(orbit.parameters)),
            "definition": json.dumps(self.system.definition()),
            "start_form": json.dumps(form.as_list(self.system)),
            "tolerance": orbit.tolerance,
            "stopped": self.stopped,
            "options": json.dumps(dict(self.options)),
            "ragged": RAGGED,
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Cascade:
        system, parameter = held_system(held), held.text("parameter")
        if parameter not in system.parameter_names:
            raise InputError("attribute 'parameter'", parameter, f"one of {', '.join(system.parameter_names)}")
        quantities = (*system.all_states, *system.output_names)
        for name, wanted in (("state", system.states), ("quantity", quantities), ("parameter", (parameter,))):
            held.names(name, wanted)
        start = _read_start(held, system, parameter)
        levels = held.size("level")
        branches = [branch for branch in branches_of(held, "level", [False] * levels, parameter) if branch is not None]
        if not all(branch.special_points.of_type("PD") for branch in branches[:-1]):
            raise InputError("special points", "no PD", "a PD on each branch but the last")
        return cls(start, tuple(branches), held.text("stopped"), held.json("options", dict))


def _read_start(held: Contents, system: HybridSystem, parameter: str) -> SpecialPoint:
    """Return the first doubling in a cascade's file."""
    form = signature_from(held.json("start_form", list), system)
    form.check(system)
    held.expect(**{"start.point": 1, "multiplier": system.freedom})
    own = [str(name) for name in held.dataset.data_vars if str(name).startswith("start.")]
    names = {name: name.replace("start.", "special_", 1) for name in own}
    dims = {theirs: ours for ours, theirs in _START.items() if theirs in held.dataset.sizes}
    part = Contents(held.dataset[own].rename(names | dims))
    parameters, tolerance = held_parameters(held, system), held.number("tolerance", *TOLERANCES)
    (start,) = special_points_of(part, system, (parameters, (parameter,), None), [form], tolerance)
    if start.type != "PD" or start.locus:
        raise InputError("variable 'start.type'", start.type, "PD, that of a branch")
    return start
