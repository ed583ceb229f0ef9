"""Special points of a curve of periodic orbits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.normal_forms import NORMAL_FORMS, NormalForm, normal_form

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

__all__ = ["SpecialPoint", "SpecialPoints"]

# What each type of special point means, in a `repr`.
_MEANING = {
    "SN": "saddle-node (fold)",
    "PD": "period doubling (flip)",
    "TR": "torus (Neimark-Sacker)",
    "BP": "branch point",
    "GR": "grazing",
    "HB": "Hopf: the cycle shrinks to an equilibrium",
    "CP": "cusp",
    "GPD": "generalised period doubling",
    "CH": "Chenciner",
    "R1": "strong resonance 1:1",
    "R2": "strong resonance 1:2",
    "R3": "strong resonance 1:3",
    "R4": "strong resonance 1:4",
    "FF": "fold-flip",
    "TP": "turning point of a parameter",
}


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint:
    """A special point of a branch or of a locus, located.

    docs/theory/continuation.md and docs/theory/loci.md derive the test functions.

    Attributes
    ----------
    type : str
        On a branch ``SN``, ``PD``, ``TR``, ``BP``, ``GR``, ``HB`` or the name of a user's event. On a locus ``CP``,
        ``GPD``, ``CH``, ``R1`` to ``R4``, ``FF`` or ``TP``, or the type of another locus that meets it. `Locus`
        explains them.
    label : str
        The type with its number along the curve, as in ``SN1``.
    orbit : PeriodicOrbit
        The orbit at the point; its parameters are those of the point.
    test : float
        Test function at the point, whose zero defines the type:

        - SN, TP: the parameter's component of the tangent.
        - PD: ``abs(mu + 1)`` of the nearest multiplier.
        - TR: ``abs(mu)**2 - 1`` of the complex pair nearest to the unit circle.
        - BP, FF: the determinant, over its size nearby.
        - GR: the normal velocity, the duration, or the distance from the surface.
        - HB: the amplitude of the last cycle.
        - CP, GPD, CH: the coefficient of the normal form, over its size nearby.
        - R1 to R4: cosine of the multipliers' angle less that of the resonance.
        - Users' events: the quantity less the wanted value.
    position : float
        Place among the curve's points: 3.5 lies between points 3 and 4.
    arclength : float
        Arclength at the point, as in the curve's `arclength`.
    varied : tuple of str
        The parameters that vary along the curve.
    of : str
        Of a TP the parameter that turns. Where a GR locus meets another, the side of the grazing (``smaller`` or
        ``larger`` signature).
    locus : str
        The type of the locus that the point belongs to; empty on a branch.
    tangent : ndarray, shape (unknowns + 1,), or None
        At a BP the tangent of its own branch, the parameter last.
    """

    type: str
    label: str
    orbit: PeriodicOrbit
    test: float
    position: float
    arclength: float
    varied: tuple[str, ...]
    of: str = ""
    locus: str = ""
    tangent: NDArray[np.float64] | None = None

    @property
    def parameters(self) -> Mapping[str, float]:
        """All parameters at the point."""
        return self.orbit.parameters

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
        fixed = self.orbit.fixed
        if fixed is not None and name in self.varied and name == fixed.quantity:
            return fixed.value
        return self.parameters[checks.chosen("name", name, [*self.parameters, *self.varied])]

    @property
    def sizes(self) -> NDArray[np.float64] | None:
        """Sizes of the states by the branch's tangent, for an orbit at rest; None without a tangent."""
        if self.tangent is None:
            return None
        wide = len(self.orbit.system.all_states) + 1
        states = np.abs(self.tangent[:-1].reshape(-1, wide)).max(axis=0)
        return np.asarray(states[: len(self.orbit.system.states)])

    @cached_property
    def normal_form(self) -> NormalForm:
        """Normal form of the Poincare map at an SN, PD or TR, computed on first access.

        docs/theory/loci.md, "Normal forms", derives the coefficients.

        Raises
        ------
        InputError
            The point is of another type.
        """
        if self.type not in NORMAL_FORMS:
            raise InputError("type", self.type, f"one of {', '.join(NORMAL_FORMS)}", "no normal form belongs to it")
        return normal_form(self.orbit, self.type)

    def __repr__(self) -> str:
        meaning = f", {_MEANING[self.type]}" if self.type in _MEANING else ""
        of = f" of {self.of}" if self.of else ""
        return f"SpecialPoint {self.label}{meaning}{of}, test function {self.test:.2g}\n{self.orbit!r}"


class SpecialPoints(Sequence[SpecialPoint]):
    """Special points in their order along a curve."""

    def __init__(self, points: Sequence[SpecialPoint], parameters: tuple[str, ...]) -> None:
        self._points = tuple(points)
        self._parameters = parameters

    @overload
    def __getitem__(self, index: int) -> SpecialPoint: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[SpecialPoint]: ...
    def __getitem__(self, index: int | slice) -> SpecialPoint | Sequence[SpecialPoint]:
        return self._points[index]

    def __len__(self) -> int:
        return len(self._points)

    def __iter__(self) -> Iterator[SpecialPoint]:
        return iter(self._points)

    def of_type(self, *types: str) -> list[SpecialPoint]:
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
            row |= {f"x0_{name}": value for name, value in zip(p.orbit.system.states, p.orbit.x0, strict=True)}
            row |= {f"min_{name}": value for name, value in p.orbit.min.items()}
            row |= {f"max_{name}": value for name, value in p.orbit.max.items()}
            row |= {
                "period": p.orbit.period,
                "stable": p.orbit.stable,
                "signature": p.orbit.signature,
                "admissible": p.orbit.admissible,
            }
            rows.append(row | {"test": p.test})
        return pd.DataFrame(rows)

    def __repr__(self) -> str:
        lines = []
        for p in self._points:
            values = ", ".join(f"{name} = {p.value(name):.12g}" for name in self._parameters)
            lines.append(f"{p.label:5s} {values}" + (f" ({p.of})" if p.of else ""))
        return "\n".join(lines) or "no special points"
