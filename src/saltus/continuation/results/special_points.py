"""Special points of a curve of periodic orbits, of equilibria or of orbits of a map."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Self, overload

import numpy as np

from saltus import checks
from saltus.continuation.core.point_types import accumulates, meaning_of
from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.continuation.results.point_normal_forms import Critical, NoNormalForm, normal_form_at
from saltus.continuation.results.point_sensitivities import Place, moved
from saltus.continuation.results.prefixed import own_attributes, prefixed_part, side_by_side
from saltus.described import described
from saltus.equilibria import Equilibrium
from saltus.equilibria.normal_forms import EquilibriumNormalForm
from saltus.errors import InputError
from saltus.maps import MapOrbit
from saltus.orbits import PeriodicOrbit
from saltus.orbits.normal_forms import NormalForm
from saltus.result import Result, frozen
from saltus.solution import Solution

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Solved", "SpecialPoint", "SpecialPoints"]

if TYPE_CHECKING:
    from typing_extensions import TypeVar

    Solved = TypeVar("Solved", bound=Solution, default=PeriodicOrbit)
else:
    from typing import TypeVar

    Solved = TypeVar("Solved", bound=Solution)

_SOLUTIONS: dict[str, Any] = {kind.__name__: kind for kind in (PeriodicOrbit, Equilibrium, MapOrbit)}
_TEXTS = ("type", "label", "of", "locus", "kind")
_NUMBERS = ("test", "position", "arclength")


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint(Result, Generic[Solved]):
    """A special point of a branch or of a locus, located.

    docs/theory/continuation.md, docs/theory/loci.md and docs/theory/equilibria.md derive the test functions.

    Attributes
    ----------
    type : str
        On a branch of orbits ``SN``, ``PD``, ``TR``, ``BP``, ``GR``, ``HB``, ``BE``, ``HOM``, ``SNIC``, ``CH``,
        ``EX`` or the name of a user's event. On a locus ``CP``, ``GPD``, ``CH``, ``R1`` to ``R4``, ``FF`` or ``TP``, or
        the type of another locus that meets it. `Locus` explains them; `EquilibriumBranch` and `EquilibriumLocus` list
        those of equilibria.
    label : str
        The type with its number along the curve, as in ``SN1``.
    solution : PeriodicOrbit, Equilibrium or MapOrbit
        The orbit, the equilibrium or the map orbit at the point; its parameters are those of the point.
    test : float
        Test function at the point, whose zero defines the type:

        - SN, TP: the parameter's component of the tangent.
        - PD: ``abs(mu + 1)`` of the nearest multiplier.
        - TR: ``abs(mu)**2 - 1`` of the complex pair nearest to the unit circle.
        - BP, FF: the determinant, over its size nearby.
        - GR: the normal velocity, the duration, or the distance from the surface.
        - HB: the amplitude of the last cycle; of equilibria the product of the sums of two eigenvalues.
        - HOM: the parameter's last change while it was located. At a BC where an equilibrium meets an event, the
          largest last change of an unknown.
        - SNIC: the parameter's distance from the last cycle.
        - BE: of equilibria the event function, over its size; of map orbits that of a GR.
        - BT, GH, ZH, HH: what docs/theory/equilibria.md, "Loci", lists.
        - CP, GPD, CH: the coefficient of the normal form, over its size nearby.
        - R1 to R4: cosine of the multipliers' angle less that of the resonance.
        - CH of a branch: the condition of docs/theory/chatter.md, "Where motions stop resting". The solution has
          the hits that are followed one by one. What is left of its equations is what the others move.
        - EX: the derivative of the quantity by arclength.
        - Users' events: the quantity less the wanted value.
    position : float
        Place among the curve's points: 3.5 lies between points 3 and 4.
    arclength : float
        Arclength at the point, as in the curve's `arclength`.
    varied : tuple of str
        The parameters that vary along the curve.
    of : str
        Of a TP the parameter that turns, of an EX the quantity, of a CH of a branch the event that hits. Of a BC the
        event that an equilibrium meets. At a BE, too. Where a GR locus meets another, the side of the
        grazing (``smaller`` or ``larger`` signature).
    locus : str
        The type of the locus that the point belongs to; empty on a branch.
    tangent : ndarray, shape (unknowns + 1,), or None
        At a BP the tangent of its own branch, the parameter last.
    kind : str
        Of a BE or BC ``persistence``, ``nonsmooth fold`` or ``two-fold``; empty where none is told.
    scale : ndarray, shape (unknowns,), or None
        Typical sizes of the unknowns on a curve of equilibria or of orbits of a map; None on one of orbits.
    homoclinic : Homoclinic or None
        At a HOM its saddle with the leading eigenvalues, at a SNIC its saddle-node. At a BC the equilibrium that meets
        an event, where the period grows without bound. The solution is the longest cycle. At a BE of orbits the
        boundary equilibrium to which cycles shrink.

    Examples
    --------
    >>> import saltus
    >>> lorenz = saltus.HybridSystem.smooth(
    ...     {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, {"r": 0.5}
    ... )
    >>> branch = saltus.continue_equilibrium(saltus.find_equilibrium(lorenz), "r", bounds=(0.0, 3.0))
    >>> point = branch["BP1"]
    >>> point.type, round(point.parameters["r"], 9)
    ('BP', 1.0)
    """

    type: str
    label: str
    solution: Solved
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

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the point as a Dataset: variables of its solution begin with ``solution0_``.

        Those of the equilibrium of a HOM, a SNIC or a BC begin with ``solution1_``. All else is in attributes, the
        tangent and the sizes in variables.
        """
        held: list[Any] = [self.solution] if self.homoclinic is None else [self.solution, self.homoclinic.saddle]
        datasets = [one.to_xarray() for one in held]
        told = [
            {"kind": type(one).__name__, "attributes": own_attributes(part)}
            for one, part in zip(held, datasets, strict=True)
        ]
        dataset = side_by_side(datasets, "solution")
        for name, values in (("tangent", self.tangent), ("scale", self.scale)):
            if values is not None:
                dataset[name] = (f"{name}_of", values)
        dataset.attrs = {
            "definition": datasets[0].attrs["definition"],
            "solutions": json.dumps(told, default=float),
            "varied": json.dumps(list(self.varied)),
            "event": "" if self.homoclinic is None else self.homoclinic.event,
            **{name: getattr(self, name) for name in _TEXTS},
            **{name: float(getattr(self, name)) for name in _NUMBERS},
        }
        return dataset

    @classmethod
    def _read(cls, held: Contents) -> Self:
        solutions = []
        for i, told in enumerate(held.json("solutions", list)):
            one = checks.instance(f"solution {i}", told, dict)
            kind = _SOLUTIONS[checks.chosen(f"kind of solution {i}", one.get("kind"), _SOLUTIONS)]
            solutions.append(kind.from_xarray(prefixed_part(held, "solution", i, one.get("attributes"))))
        if len(solutions) not in (1, 2) or not all(isinstance(one, Equilibrium) for one in solutions[1:]):
            raise InputError("attribute 'solutions'", len(solutions), "a solution, and an equilibrium of a homoclinic")
        tangent, scale = (
            frozen(held.array(name, (f"{name}_of",), least=least)) if name in held.dataset else None
            for name, least in (("tangent", -math.inf), ("scale", 0.0))
        )
        given: dict[str, Any] = {name: held.text(name) for name in _TEXTS}
        given |= {name: held.number(name, finite=False) for name in _NUMBERS}
        saddle = Homoclinic(solutions[1], held.text("event")) if solutions[1:] else None
        varied = tuple(held.texts("varied"))
        return cls(solution=solutions[0], varied=varied, tangent=tangent, scale=scale, homoclinic=saddle, **given)

    def plot(self, *args: Any, **options: Any) -> Any:
        """Draw the solution.

        Parameters
        ----------
        *args, **options
            As the picture of an orbit, an equilibrium or an orbit of a map takes them.

        Returns
        -------
        matplotlib.axes.Axes
            What was drawn on.

        Raises
        ------
        InputError
            An option that this kind of solution does not know.
        """
        return self.solution.plot(*args, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def _key(self) -> tuple[Any, ...]:
        return self.type, self.label, self.position, self.arclength, self.varied

    def __eq__(self, other: object) -> bool:
        if self is other or not isinstance(other, SpecialPoint):
            return self is other
        return self._key() == other._key() and super().__eq__(other)

    def __hash__(self) -> int:  # type: ignore[override]  # a point has a label
        return hash(self._key())

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """Say where an accessor is now that stood here up to version 0.1."""
            now = ": it is now map_orbit" if name == "cycle" else ""
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}{now}")

    @property
    def orbit(self) -> PeriodicOrbit:
        """The orbit at the point of a curve of orbits."""
        return checks.instance(
            f"solution of {self.label}", self.solution, PeriodicOrbit, "use .equilibrium or .map_orbit"
        )

    @property
    def equilibrium(self) -> Equilibrium:
        """The equilibrium at the point of a curve of equilibria, or that of a HOM, a SNIC, or a BC of a cycle."""
        if self.homoclinic is not None:
            return self.homoclinic.saddle
        return checks.instance(f"solution of {self.label}", self.solution, Equilibrium, "use .orbit or .map_orbit")

    @property
    def map_orbit(self) -> MapOrbit:
        """The orbit at the point of a curve of orbits of a map."""
        return checks.instance(f"solution of {self.label}", self.solution, MapOrbit, "use .orbit or .equilibrium")

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters at the point; at a HOM, SNIC or BC with an equilibrium those of the latter."""
        return self.solution.parameters if self.homoclinic is None else self.homoclinic.saddle.parameters

    @property
    def itself(self) -> SpecialPoint[Any]:
        """The point; at a BC or BE of cycles, where an equilibrium meets an event, the boundary equilibrium BE."""
        if self.type not in ("BC", "BE") or self.homoclinic is None:
            return self
        point: SpecialPoint[Any] = self
        return replace(point, type="BE", solution=self.homoclinic.saddle, of="", tangent=None, kind="", homoclinic=None)

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
        held = self.solution._held_value(name) if name in self.varied else None
        if held is not None:
            return held
        return self.parameters[checks.chosen("name", name, [*self.parameters, *self.varied])]

    @property
    def multiplicity(self) -> int:
        """How many eigenvalues, multipliers or complex pairs are critical at once, as by a symmetry; 1 for most points.

        At an SN, BP, PD, TR or HB; `switch_branch(point, which=...)` gives the branches one by one.
        """
        return self.solution.multiplicity(self.type, self.varied)

    @property
    def sizes(self) -> NDArray[np.float64] | None:
        """The `scale`, or sizes of an orbit's states by the branch's tangent; None where neither is known."""
        if self.scale is not None or self.tangent is None:
            return self.scale
        wide = len(self.orbit.system.all_states) + 1
        states = np.abs(self.tangent[:-1].reshape(-1, wide)).max(axis=0)
        return np.asarray(states[: len(self.orbit.system.states)])

    @cached_property
    def normal_form(self) -> NormalForm | EquilibriumNormalForm | NoNormalForm:
        """Normal form at the point, computed on first access.

        For orbits that of the Poincare map at an SN, PD or TR: docs/theory/loci.md, "Normal forms". For equilibria that
        of the field at an SN, HB, CP or BT: docs/theory/equilibria.md, "Normal forms". For orbits of maps that of the
        iterate at an SN, PD or TR: docs/theory/map_orbits.md, "Normal forms". An HB of orbits has that of the
        equilibrium to which they shrink.

        Any other point has a `NoNormalForm`, whose ``reason`` says why: its type has none, or several eigenvalues are
        critical at once.
        """
        if accumulates(self.type, self.locus):
            return NoNormalForm(self.type, "hits become infinitely many there; it is no bifurcation of one signature")
        return normal_form_at(self.solution, Critical(self.type, self.label, self.varied, self.scale))

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
        from saltus.extras import xr

        if self.itself is not self:
            return self.itself.sensitivity(parameters)
        system, along = self.solution.system, self.varied[0]
        if len(self.varied) > 1 or along not in system.parameters:
            raise InputError(
                "varied", self.varied, "one parameter", "a special point of a branch along a parameter moves"
            )
        rest = tuple(name for name in system.parameter_names if name != along)
        others = rest if parameters is None else checks.names("parameters", parameters, "names of parameters")
        others = tuple(checks.chosen("parameters", name, rest) for name in others)
        slopes, note = moved(self.solution, Place(self.type, along, others, self.sizes))
        attributes = {"value": self.parameters[along], "type": self.type} | ({"note": note} if note else {})
        if np.any(np.isnan(slopes)):
            attributes["note"] = "the branch point does not persist as the parameter changes"
        return xr.Dataset({along: ("parameter", slopes, attributes)}, {"parameter": list(others)})

    def __repr__(self) -> str:
        known = meaning_of(self.type, self.locus)
        meaning = f", {known}" if known else ""
        if self.type == "HB" and not self.solution.at_rest:
            meaning += ": the cycle shrinks to an equilibrium"
        if self.multiplicity > 1:
            meaning += f", {self.multiplicity} at once"
        of = f" of {self.of}" if self.of and self.of != self.kind else ""
        of += f", {self.kind}" if self.kind else ""
        end = "" if self.homoclinic is None else f"\n{self.homoclinic!r}"
        return f"SpecialPoint {self.label}{meaning}{of}, test function {self.test:.2g}{end}\n{self.solution!r}"


class SpecialPoints(Sequence[SpecialPoint[Solved]]):
    """Special points in their order along a curve."""

    def __init__(self, points: Sequence[SpecialPoint[Solved]], parameters: tuple[str, ...]) -> None:
        self._points = tuple(points)
        self._parameters = parameters

    @overload
    def __getitem__(self, index: int) -> SpecialPoint[Solved]: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[SpecialPoint[Solved]]: ...
    def __getitem__(self, index: int | slice) -> SpecialPoint[Solved] | Sequence[SpecialPoint[Solved]]:
        return self._points[index]

    def __len__(self) -> int:
        return len(self._points)

    def __iter__(self) -> Iterator[SpecialPoint[Solved]]:
        return iter(self._points)

    def of_type(self, *types: str) -> list[SpecialPoint[Solved]]:
        """Return the points of the given types."""
        return [point for point in self._points if point.type in types]

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table of label, type, parameters, x0, extremes, period, stability, signature and test function."""
        from saltus.extras import pd

        rows = []
        for p in self._points:
            row: dict[str, Any] = {"label": p.label, "type": p.type}
            row |= {"of": p.of} if len(self._parameters) > 1 else {}
            row |= {name: p.value(name) for name in self._parameters}
            row |= p.solution.row()
            rows.append(row | {"multiplicity": p.multiplicity, "test": p.test})
        return pd.DataFrame(rows)

    def __repr__(self) -> str:
        lines = []
        for p in self._points:
            values = ", ".join(f"{name} = {p.value(name):.12g}" for name in self._parameters)
            several = f" ({p.multiplicity} at once)" if p.multiplicity > 1 else ""
            lines.append(f"{p.label:5s} {values}" + (f" ({p.of})" if p.of else "") + several)
        return "\n".join(lines) or "no special points"
