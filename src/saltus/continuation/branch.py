"""A branch of periodic orbits along one parameter."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.orbit_curve import OrbitCurve
from saltus.orbits.unfolding import Fixed, read_fixed
from saltus.results import frozen
from saltus.system.plain import held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Branch"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Branch(OrbitCurve):
    """Periodic orbits along one parameter.

    Attributes
    ----------
    parameter : str
        The parameter that varies, or a quantity, as ``max_x``. Its values along the branch are in `values`, shape
        (point,). Types of `special_points` are SN, PD, TR, BP, GR, HB, BE, HOM, SNIC, TP and users' events.
        `OrbitCurve` lists the other attributes.
    fixed : Fixed or None
        Along a quantity: its name and its value at the start, and the parameter that is free.
    freed : ndarray, shape (point,)
        Values of the free parameter; NaN where none is free.
    """

    parameter: str
    fixed: Fixed | None = None
    freed: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        super().__post_init__()
        freed = self.freed if self.freed.size else np.full(len(self.values), np.nan)
        object.__setattr__(self, "freed", frozen(freed))

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameter, in a tuple."""
        return (self.parameter,)

    def column(self, name: str) -> NDArray[np.float64]:
        """Return a quantity along the branch.

        Parameters
        ----------
        name : str
            As `OrbitCurve.column` takes it, or the free parameter.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name.
        """
        if self.fixed is not None and self.fixed.free and name == self.fixed.free:
            return self.freed
        return super().column(name)

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {}

    def _parameters(self, index: int) -> dict[str, float]:
        if self.fixed is None:
            return super()._parameters(index)
        free = {self.fixed.free: float(self.freed[index])} if self.fixed.free else {}
        return dict(self.parameters) | free

    def _fixed(self, index: int) -> Fixed | None:
        return None if self.fixed is None else replace(self.fixed, value=float(self.values[index]))

    def to_xarray(self) -> xr.Dataset:
        """Return the branch as a Dataset: points against ``point``, special points against ``special``."""
        dataset = super().to_xarray()
        if self.fixed is not None:
            dataset["freed"] = ("point", self.freed)
            dataset.attrs["fixed"] = json.dumps(self.fixed.as_list())
        return dataset

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...]) -> dict[str, Any]:
        held.expect(parameter=1)
        fields: dict[str, Any] = {"parameter": varied[0], "values": cls._varied_columns(held)[0]}
        fixed = read_fixed(held, held_system(held))
        if fixed is not None:
            fields |= {"fixed": fixed, "freed": held.array("freed", ("point",), finite=False)}
        return fields

    def __repr__(self) -> str:
        return self._described("Branch")
