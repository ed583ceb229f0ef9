"""An optimum as a result: parameters, orbit, active constraints with their multipliers, how well it was verified."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.results.prefixed import own_attributes, prefixed_part, side_by_side
from saltus.described import described
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.result import Result, frozen

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Optimum"]

_GOALS = ("maximise", "minimise")
_SIDES = ("lower", "upper")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Optimum(Result):
    """The best orbit over some parameters; `saltus.optimise` finds it.

    Attributes
    ----------
    orbit : PeriodicOrbit
        The orbit at the best parameters.
    goal : str
        ``maximise`` or ``minimise``.
    objective : str
        What is greatest or least.
    over : tuple of str
        The parameters.
    values, start : ndarray, shape (over,)
        Their best values, and where the search started.
    best : float
        The objective of the orbit.
    constraints, sides : tuple of str
        What each bound belongs to: an expression, a parameter or ``stable``; and whether it is ``lower`` or ``upper``.
    seen, limits : ndarray, shape (constraint,)
        Values of the orbit, and bounds. Of ``stable`` the largest modulus of a multiplier, and the largest allowed.
    multipliers : ndarray, shape (constraint,)
        Lagrange multipliers: the derivatives of the best objective by the bounds. They are 0 where a bound is not
        active. When an objective is maximised, those of upper bounds are not below 0, those of lower bounds not above.
    residual : float
        What is left of the objective's gradient beside active constraints, relative: that of the change within a unit.
    mismatch : float
        Largest difference between exact derivatives and those by differences of orbits nearby, relative.
    curvature : float
        Least curvature along the active constraints, relative; below 0 it is no optimum. Infinite where constraints
        leave no direction, NaN where orbits on both sides are not found.
    path : ndarray, shape (step, over)
        Parameters on the way, the start first.
    path_objective : ndarray, shape (step,)
        The objective there.
    orbits : int
        How many orbits the search looked at.
    stopped : str
        Why the search ended.
    notes : tuple of str
        What the check of the optimum found.

    Examples
    --------
    >>> import saltus
    >>> spring = saltus.HybridSystem.smooth(
    ...     {"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.4, "w": 0.6}, phase=("s", "w")
    ... )
    >>> orbit = saltus.find_orbit(spring, x0=[0.0, 0.0])
    >>> peak = saltus.optimise(orbit, maximise="amplitude(x, 1)", vary={"w": (None, None)})
    >>> round(peak["w"] ** 2, 9)
    0.92
    """

    orbit: PeriodicOrbit
    goal: str
    objective: str
    over: tuple[str, ...]
    values: NDArray[np.float64]
    start: NDArray[np.float64]
    best: float
    constraints: tuple[str, ...]
    sides: tuple[str, ...]
    seen: NDArray[np.float64]
    limits: NDArray[np.float64]
    multipliers: NDArray[np.float64]
    residual: float
    mismatch: float
    curvature: float
    path: NDArray[np.float64]
    path_objective: NDArray[np.float64]
    orbits: int
    stopped: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("values", "start", "seen", "limits", "multipliers", "path", "path_objective"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.over.index(checks.chosen("parameter", name, self.over))])

    @property
    def active(self) -> dict[str, float]:
        """Multipliers of the active constraints, by what they belong to."""
        return {
            name: float(multiplier)
            for name, multiplier in zip(self.constraints, self.multipliers, strict=True)
            if multiplier != 0.0
        }

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of the constraints: side, value, bound and multiplier."""
        from saltus.extras import pd

        columns = {"side": self.sides, "value": self.seen, "bound": self.limits, "multiplier": self.multipliers}
        return pd.DataFrame(columns, index=pd.Index(self.constraints, name="constraint"))

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the optimum as a Dataset: parameters along ``over``, bounds along ``constraint``, and the orbit."""
        orbit = self.orbit.to_xarray()
        dataset = side_by_side([orbit], "orbit")
        own: dict[str, Any] = {
            "value": ("over", self.values), "start": ("over", self.start), "path": (("step", "over"), self.path),
            "path_objective": ("step", self.path_objective),
        }  # fmt: skip
        own |= {"side": ("constraint", np.array(self.sides, dtype=object))}
        own |= {name: ("constraint", getattr(self, name)) for name in ("seen", "limits", "multipliers")}
        dataset = dataset.assign(own).assign_coords(
            over=list(self.over), constraint=np.array(self.constraints, dtype=object)
        )
        dataset.attrs = {
            "definition": orbit.attrs["definition"],
            "orbit": json.dumps(own_attributes(orbit)),
            "notes": json.dumps(list(self.notes)),
        }
        names = ("goal", "objective", "best", "residual", "mismatch", "curvature", "orbits", "stopped")
        dataset.attrs |= {name: getattr(self, name) for name in names}
        return dataset

    @classmethod
    def _read(cls, held: Contents) -> Optimum:
        orbit = PeriodicOrbit.from_xarray(prefixed_part(held, "orbit", 0, held.json("orbit", dict)))
        over = tuple(map(str, held.array("over", ("over",), str).tolist()))
        for name in over:
            checks.chosen("over", name, orbit.system.parameter_names)
        each = ("constraint",)
        sides = tuple(checks.chosen("side", side, _SIDES) for side in held.array("side", each, str).tolist())
        values = held.array("value", ("over",))
        if any(orbit.parameters[name] != value for name, value in zip(over, values.tolist(), strict=True)):
            raise InputError("variable 'value'", values.tolist(), "the parameters of the orbit")
        return cls(
            orbit=orbit,
            goal=checks.chosen("goal", held.text("goal"), _GOALS),
            objective=held.text("objective"),
            over=over,
            values=values,
            start=held.array("start", ("over",)),
            best=held.number("best"),
            constraints=tuple(map(str, held.array("constraint", each, str).tolist())),
            sides=sides,
            seen=held.array("seen", each),
            limits=held.array("limits", each),
            multipliers=held.array("multipliers", each),
            residual=held.number("residual", 0.0),
            mismatch=held.number("mismatch", 0.0, finite=False),
            curvature=held.number("curvature", finite=False),
            path=held.array("path", ("step", "over")),
            path_objective=held.array("path_objective", ("step",)),
            orbits=held.count("orbits"),
            stopped=held.text("stopped"),
            notes=tuple(held.texts("notes")),
        )

    def __repr__(self) -> str:
        what = {"maximise": "greatest", "minimise": "least"}[self.goal]
        name = self.orbit.system.name or self.orbit.system.unnamed
        lines = [f"Optimum of {name}: {what} {self.objective} = {self.best:.9g}"]
        lines += [
            f"  {parameter} = {value:.9g}, from {first:.6g}"
            for parameter, value, first in zip(self.over, self.values, self.start, strict=True)
        ]
        rows = zip(self.constraints, self.sides, self.limits, self.multipliers, strict=True)
        for constraint, side, limit, multiplier in rows:
            if multiplier != 0.0:
                sign = "<=" if side == "upper" else ">="
                shown = "largest |multiplier|" if constraint == "stable" else constraint
                lines.append(f"  active: {shown} {sign} {limit:.9g}, multiplier {multiplier:.6g}")
        lines += [
            f"  {'stable' if self.orbit.stable else 'unstable'} orbit of period {self.orbit.period:.9g}",
            f"  gradient left {self.residual:.1e}, derivatives off by {self.mismatch:.1e},"
            f" least curvature {self.curvature:.2g}",
        ]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes), f"  {self.stopped}; {self.orbits} orbits"])
