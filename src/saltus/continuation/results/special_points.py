"""Special points of a curve of periodic orbits, of equilibria or of cycles of a map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, overload

import numpy as np

from saltus import checks
from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.continuation.results.point_sensitivities import Place, moved_cycle, moved_equilibrium, moved_orbit
from saltus.equilibria import Equilibrium
from saltus.equilibria.normal_forms import EquilibriumNormalForm, normal_form as equilibrium_form
from saltus.equilibria.spectrum import multiplicity as eigenvalue_multiplicity
from saltus.errors import InputError
from saltus.maps import MapOrbit
from saltus.maps.normal_forms import map_normal_form
from saltus.maps.spectrum import multiplicity
from saltus.orbits import PeriodicOrbit
from saltus.orbits.multiplier_slopes import ROUGH
from saltus.orbits.normal_forms import NORMAL_FORMS, NormalForm, normal_form

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Solution", "SpecialPoint", "SpecialPoints"]

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    Solution = TypeVar("Solution", bound=PeriodicOrbit | Equilibrium | MapOrbit, default=PeriodicOrbit)
else:
    from typing import TypeVar

    Solution = TypeVar("Solution", bound=PeriodicOrbit | Equilibrium | MapOrbit)

_ASIDE = 1e-3  # change of a parameter, over its value, beside a point at which all eigenvalues may vanish

# What each type of special point means, in a `repr`.
_MEANING = {
    "SN": "saddle-node (fold)",
    "PD": "period doubling (flip)",
    "TR": "torus (Neimark-Sacker)",
    "BP": "branch point",
    "GR": "grazing",
    "HB": "Hopf",
    "HOM": "homoclinic orbit",
    "SNIC": "saddle-node on an invariant circle",
    "BE": "boundary equilibrium",
    "BC": "border collision",
    "CP": "cusp",
    "GPD": "generalised period doubling",
    "CH": "Chenciner",
    "R1": "strong resonance 1:1",
    "R2": "strong resonance 1:2",
    "R3": "strong resonance 1:3",
    "R4": "strong resonance 1:4",
    "FF": "fold-flip",
    "BT": "Bogdanov-Takens",
    "GH": "generalised Hopf (Bautin)",
    "ZH": "zero-Hopf",
    "HH": "double Hopf",
    "TP": "turning point of a parameter",
    "EX": "extremum",
}


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint(Generic[Solution]):
    """A special point of a branch or of a locus, located.

    docs/theory/continuation.md, docs/theory/loci.md and docs/theory/equilibria.md derive the test functions.

    Attributes
    ----------
    type : str
        On a branch of orbits ``SN``, ``PD``, ``TR``, ``BP``, ``GR``, ``HB``, ``BE``, ``HOM``, ``SNIC``, ``EX`` or the
        name of a user's event. On a locus ``CP``, ``GPD``, ``CH``, ``R1`` to ``R4``, ``FF`` or ``TP``, or the type of
        another locus that meets it. `Locus` explains them; `EquilibriumBranch` and `EquilibriumLocus` list those of
        equilibria.
    label : str
        The type with its number along the curve, as in ``SN1``.
    solution : PeriodicOrbit, Equilibrium or MapOrbit
        The orbit, the equilibrium or the cycle at the point; its parameters are those of the point.
    test : float
        Test function at the point, whose zero defines the type:

        - SN, TP: the parameter's component of the tangent.
        - PD: ``abs(mu + 1)`` of the nearest multiplier.
        - TR: ``abs(mu)**2 - 1`` of the complex pair nearest to the unit circle.
        - BP, FF: the determinant, over its size nearby.
        - GR: the normal velocity, the duration, or the distance from the surface.
        - HB: the amplitude of the last cycle; of equilibria the product of the sums of two eigenvalues.
        - HOM: the parameter's last change while it was located.
        - SNIC: the parameter's distance from the last cycle.
        - BE: of equilibria the event function, over its size; of cycles that of a GR.
        - BT, GH, ZH, HH: what docs/theory/equilibria.md, "Loci", lists.
        - CP, GPD, CH: the coefficient of the normal form, over its size nearby.
        - R1 to R4: cosine of the multipliers' angle less that of the resonance.
        - EX: the derivative of the quantity by arclength.
        - Users' events: the quantity less the wanted value.
    position : float
        Place among the curve's points: 3.5 lies between points 3 and 4.
    arclength : float
        Arclength at the point, as in the curve's `arclength`.
    varied : tuple of str
        The parameters that vary along the curve.
    of : str
        Of a TP the parameter that turns, of an EX the quantity. Where a GR locus meets another, the side of the
        grazing (``smaller`` or ``larger`` signature).
    locus : str
        The type of the locus that the point belongs to; empty on a branch.
    tangent : ndarray, shape (unknowns + 1,), or None
        At a BP the tangent of its own branch, the parameter last.
    kind : str
        Of a BE or BC ``persistence`` or ``nonsmooth fold``; empty where neither is told.
    scale : ndarray, shape (unknowns,), or None
        Typical sizes of the unknowns on a curve of equilibria or of cycles of a map; None on one of orbits.
    homoclinic : Homoclinic or None
        At a HOM its saddle with the leading eigenvalues, at a SNIC its saddle-node. The solution is the longest cycle.
    """

    type: str
    label: str
    solution: Solution
    test: float
    position: float
    arclength: float
    varied: tuple[str, ...]
    of: str = ""
    locus: str = ""
    tangent: NDArray[np.float64] | None = None
    kind: str = ""
    scale: NDArray[np.float64] | None = None
    homoclinic: Homoclinic | None = None

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit at the point of a curve of orbits."""
        return checks.instance(f"solution of {self.label}", self.solution, PeriodicOrbit, "use .equilibrium or .cycle")

    @property
    def equilibrium(self) -> Equilibrium:
        """The equilibrium at the point of a curve of equilibria, or the equilibrium of a HOM or SNIC."""
        if self.homoclinic is not None:
            return self.homoclinic.saddle
        return checks.instance(f"solution of {self.label}", self.solution, Equilibrium, "use .orbit or .cycle")

    @property
    def cycle(self) -> MapOrbit:
        """The cycle at the point of a curve of cycles of a map."""
        return checks.instance(f"solution of {self.label}", self.solution, MapOrbit, "use .orbit or .equilibrium")

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters at the point; at a HOM or SNIC those of its equilibrium."""
        return self.solution.parameters if self.homoclinic is None else self.homoclinic.saddle.parameters

    def value(self, name: str) -> float:
        """Return a parameter at the point, or the quantity along which the branch goes.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        float

        Raises
        ------
        InputError
            It is neither.
        """
        fixed = self.solution.fixed if isinstance(self.solution, PeriodicOrbit) else None
        if fixed is not None and name in self.varied and name == fixed.quantity:
            return fixed.value
        return self.parameters[checks.chosen("name", name, [*self.parameters, *self.varied])]

    @property
    def multiplicity(self) -> int:
        """How many eigenvalues, multipliers or complex pairs are critical at once, as by a symmetry; 1 for most points.

        At an SN, BP, PD, TR or HB; `switch_branch(point, which=...)` gives the branches one by one.
        """
        if isinstance(self.solution, Equilibrium):
            return eigenvalue_multiplicity(self.solution.eigenvalues, self.type, self._unit())
        values = self.solution.multipliers
        if isinstance(self.solution, PeriodicOrbit) and self.solution.system.phase is None:
            values = values[:-1]
        return multiplicity(values, self.type)

    def _unit(self) -> float:
        """Return a modulus of the eigenvalues of an equilibrium beside the point, where all of them may vanish."""
        name = self.varied[0]
        values = [self.parameters[name] + _ASIDE * max(abs(self.parameters[name]), 1.0)]
        J = self.equilibrium.problem(name).evaluate(np.append(self.equilibrium.state, values))[1][:, :-1]
        return float(np.abs(np.linalg.eigvals(J)).max()) if np.all(np.isfinite(J)) else 0.0

    @property
    def sizes(self) -> NDArray[np.float64] | None:
        """Sizes of the states by the branch's tangent, for an orbit at rest; None without a tangent."""
        if self.tangent is None:
            return None
        wide = len(self.orbit.system.all_states) + 1
        states = np.abs(self.tangent[:-1].reshape(-1, wide)).max(axis=0)
        return np.asarray(states[: len(self.orbit.system.states)])

    @cached_property
    def normal_form(self) -> NormalForm | EquilibriumNormalForm:
        """Normal form at the point, computed on first access.

        For orbits that of the Poincare map at an SN, PD or TR: docs/theory/loci.md, "Normal forms". For equilibria that
        of the field at an SN, HB, CP or BT: docs/theory/equilibria.md, "Normal forms". For cycles of maps that of the
        iterate at an SN, PD or TR: docs/theory/cycles.md, "Normal forms".

        Raises
        ------
        InputError
            The point is of another type, or several eigenvalues or pairs of an equilibrium are critical at once.
        """
        count = self.multiplicity
        if isinstance(self.solution, Equilibrium):
            if count > 1:
                hint = f"{count} are critical at once; switch_branch(point, which=...) gives the branches"
                raise InputError("point", self.label, "critical in one direction", hint)
            problem = self.solution.problem(*self.varied)
            values = [self.parameters[name] for name in self.varied]
            return equilibrium_form(problem, np.append(self.solution.state, values), self.type, self.scale)
        if count > 1 and self.type in NORMAL_FORMS:  # both multipliers of a conservative map's period doubling are -1
            return NormalForm(self.type, math.nan, math.nan, count)
        if isinstance(self.solution, MapOrbit):
            return NormalForm(self.type, *map_normal_form(self.solution, self.type))
        if self.type not in NORMAL_FORMS:
            raise InputError("type", self.type, f"one of {', '.join(NORMAL_FORMS)}", "no normal form belongs to it")
        return normal_form(self.orbit, self.type)

    def sensitivity(self, parameters: Sequence[str] | None = None) -> xr.Dataset:
        """Return how the point moves along its branch as other parameters change, exactly.

        docs/theory/sensitivities.md, "Special points", derives it.

        Parameters
        ----------
        parameters : sequence of str, optional
            All other parameters of the system by default.

        Returns
        -------
        xarray.Dataset
            One variable, named by the parameter of the branch, along ``parameter``: its derivatives at the point. The
            attributes ``value`` and ``type`` are those of the point. NaN where a branch point does not persist.

        Raises
        ------
        InputError
            The point is none that moves so: SN, PD, TR, BP, GR of orbits; SN, HB, BE of equilibria; SN, PD, TR, BC of
            cycles. It is not isolated, or on no branch along a parameter. A name that is no other parameter.

        Examples
        --------
        >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
        >>> fold = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 3.0})
        >>> branch = continue_equilibrium(find_equilibrium(fold, {}, [2.0]), "r", (-4.0, 4.0))
        >>> slopes = branch["SN1"].sensitivity()["r"]
        >>> round(slopes.attrs["value"], 9), round(float(slopes.sel(parameter="h")), 9)
        (2.0, 1.0)
        """
        import xarray as xr

        system, along = self.solution.system, self.varied[0]
        if len(self.varied) > 1 or along not in system.parameters:
            raise InputError(
                "varied", self.varied, "one parameter", "a special point of a branch along a parameter moves"
            )
        rest = tuple(name for name in system.parameter_names if name != along)
        others = rest if parameters is None else checks.names("parameters", parameters, "names of parameters")
        others = tuple(checks.chosen("parameters", name, rest) for name in others)
        if isinstance(self.solution, Equilibrium):
            slopes = moved_equilibrium(self.solution, Place(self.type, along, others, self.scale))
        elif isinstance(self.solution, MapOrbit):
            slopes = moved_cycle(self.solution, Place(self.type, along, others, self.scale))
        else:
            slopes = moved_orbit(self.orbit, Place(self.type, along, others, self.sizes))
        attributes = {"value": self.parameters[along], "type": self.type}
        if isinstance(self.solution, PeriodicOrbit) and self.type in ("PD", "TR", "BP"):
            rooted = self.solution.system.compiled.rooted[list(self.solution.form.modes)].any()
            attributes |= {"note": ROUGH} if rooted else {}
        if np.any(np.isnan(slopes)):
            attributes["note"] = "the branch point does not persist as the parameter changes"
        return xr.Dataset({along: ("parameter", slopes, attributes)}, {"parameter": list(others)})

    def __repr__(self) -> str:
        meaning = f", {_MEANING[self.type]}" if self.type in _MEANING else ""
        if self.type == "HB" and not isinstance(self.solution, Equilibrium):
            meaning += ": the cycle shrinks to an equilibrium"
        if self.multiplicity > 1:
            meaning += f", {self.multiplicity} at once"
        of = f" of {self.of}" if self.of else ""
        end = "" if self.homoclinic is None else f"\n{self.homoclinic!r}"
        return f"SpecialPoint {self.label}{meaning}{of}, test function {self.test:.2g}{end}\n{self.solution!r}"


def _row(solution: PeriodicOrbit | Equilibrium | MapOrbit) -> dict[str, Any]:
    """Return what a table of special points says of a solution."""
    states = solution.system.states
    if isinstance(solution, Equilibrium):
        row: dict[str, Any] = dict(zip(states, solution.state.tolist(), strict=True))
        return row | {"stable": solution.stable, "mode": solution.mode, "regular": solution.regular}
    if isinstance(solution, MapOrbit):
        row = dict(zip(states, solution.points[0].tolist(), strict=True))
        row |= {"period": solution.period, "stable": solution.stable, "itinerary": solution.itinerary}
        return row | {"regular": solution.regular}
    row = {f"x0_{name}": value for name, value in zip(states, solution.x0, strict=True)}
    row |= {f"min_{name}": value for name, value in solution.min.items()}
    row |= {f"max_{name}": value for name, value in solution.max.items()}
    return row | {
        "period": solution.period,
        "stable": solution.stable,
        "signature": solution.signature,
        "admissible": solution.admissible,
    }


class SpecialPoints(Sequence[SpecialPoint[Solution]]):
    """Special points in their order along a curve."""

    def __init__(self, points: Sequence[SpecialPoint[Solution]], parameters: tuple[str, ...]) -> None:
        self._points = tuple(points)
        self._parameters = parameters

    @overload
    def __getitem__(self, index: int) -> SpecialPoint[Solution]: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[SpecialPoint[Solution]]: ...
    def __getitem__(self, index: int | slice) -> SpecialPoint[Solution] | Sequence[SpecialPoint[Solution]]:
        return self._points[index]

    def __len__(self) -> int:
        return len(self._points)

    def __iter__(self) -> Iterator[SpecialPoint[Solution]]:
        return iter(self._points)

    def of_type(self, *types: str) -> list[SpecialPoint[Solution]]:
        """Return the points of the given types."""
        return [point for point in self._points if point.type in types]

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of label, type, parameters, x0, extremes, period, stability, signature and test function."""
        import pandas as pd

        rows = []
        for p in self._points:
            row: dict[str, Any] = {"label": p.label, "type": p.type}
            row |= {"of": p.of} if len(self._parameters) > 1 else {}
            row |= {name: p.value(name) for name in self._parameters}
            row |= _row(p.solution)
            rows.append(row | {"multiplicity": p.multiplicity, "test": p.test})
        return pd.DataFrame(rows)

    def __repr__(self) -> str:
        lines = []
        for p in self._points:
            values = ", ".join(f"{name} = {p.value(name):.12g}" for name in self._parameters)
            several = f" ({p.multiplicity} at once)" if p.multiplicity > 1 else ""
            lines.append(f"{p.label:5s} {values}" + (f" ({p.of})" if p.of else "") + several)
        return "\n".join(lines) or "no special points"
