"""A curve of periodic orbits as a result that is saved: along one parameter or two, with its special points."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus.contents import Contents
from saltus.continuation.results.curve_files import (
    column_name,
    complex_table,
    ragged_rows,
    special_points_of,
    special_variables,
)
from saltus.continuation.results.orbit_columns import OrbitColumns
from saltus.continuation.results.special_points import SpecialPoints
from saltus.described import described
from saltus.errors import InputError
from saltus.orbits.orbit import TOLERANCES
from saltus.orbits.signature import signature_from
from saltus.orbits.unfolding import read_fixed
from saltus.scales import PRINTED
from saltus.system.plain import expect_values, held_parameters, held_system

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["OrbitCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OrbitCurve(OrbitColumns):
    """Orbits in order along a curve, their properties, and special points: the base of `Branch` and `Locus`."""

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        from saltus.extras import xr

        signatures = [form.names(self.system) for form in self.forms]
        written = [" -> ".join(f"{mode}:{transition}" for mode, transition in names) for names in signatures]
        n = len(self.system.all_states)
        table = self.values.reshape(len(self), -1)
        data: dict[str, Any] = {name: ("point", values) for name, values in self._own_columns().items()}
        data |= {
            "x0": (("point", "state"), self.x0),
            "multiplier_re": (("point", "multiplier"), self.multipliers.real),
            "multiplier_im": (("point", "multiplier"), self.multipliers.imag),
            "stable": ("point", self.stable.astype(np.int8)),
            "admissible": ("point", self.admissible.astype(np.int8)),
            "implicit": ("point", self.implicit.astype(np.int8)),
            "period": ("point", self.period),
            "residual": ("point", self.residual),
            "arclength": ("point", self.arclength),
            "form": ("point", self.form),
            "signature": ("point", np.array([written[form] for form in self.form.tolist()], dtype=object)),
            "unknown": ("ragged", np.concatenate([*self.unknowns, np.empty(0)])),
            "unknown_count": ("point", np.array([len(u) for u in self.unknowns], dtype=np.int64)),
        }
        skip = None if self.system.phase is None else self.system.phase[0]
        for i, q in enumerate(self.quantities):
            if q != skip:
                data[f"min_{q}"] = ("point", self.lows[:, i])
                data[f"max_{q}"] = ("point", self.highs[:, i])
        each = ("point", "quantity")
        data |= {"lows": (each, self.lows), "highs": (each, self.highs), "means": (each, self.means)}
        data |= {"harmonic_re": (each, self.harmonics.real), "harmonic_im": (each, self.harmonics.imag)}
        forms = list(dict.fromkeys([*self.forms, *(point.orbit.form for point in self.special_points)]))
        data |= special_variables(self.special_points, self.varied, self.multipliers.shape[1], forms, self.system)
        coords = {
            "state": list(self.system.states),
            "quantity": list(self.quantities),
            "parameter": list(self.varied),
        }
        taken = {*data, *coords, *(dim for dims, *_ in data.values() for dim in np.atleast_1d(dims))}
        columns = [column_name(name, taken) for name in self.varied]
        data = {column: ("point", table[:, i]) for i, column in enumerate(columns)} | data
        attrs = {
            **self._kept_attributes(),
            "columns": json.dumps(columns),
            "forms": json.dumps([form.as_list(self.system) for form in forms]),
            "signatures": json.dumps(signatures),
            "n_forms": len(self.forms),
            "tolerance": self.tolerance,
            "ragged": f"unknown: unknown_count numbers for each point: state ({n}) and duration of each segment",
        }
        return xr.Dataset(data, coords=coords, attrs=attrs)

    def _of_each(self) -> dict[str, Any]:
        seen = [q for q in self.quantities if self.system.phase is None or q != self.system.phase[0]]
        extremes = {f"{side}_{q}": self.column(f"{side}_{q}") for q in seen for side in ("min", "max")}
        written = [" -> ".join(f"{mode}:{transition}" for mode, transition in f.names(self.system)) for f in self.forms]
        signatures = np.array([written[form] for form in self.form.tolist()], dtype=object)
        found = super()._of_each()
        more = {"period": self.period, **extremes, "signature": signatures, "implicit": self.implicit}
        return found | {name: values for name, values in more.items() if name not in found}

    def _spectrum(self) -> list[tuple[str, NDArray[np.complex128]]]:
        return [("multiplier", self.multipliers)]

    @classmethod
    def _varied_columns(cls, held: Contents) -> list[NDArray[np.float64]]:
        """Return the values of the varied parameters, shape (point,) each, as `to_xarray` described them."""
        columns = held.texts("columns" if "columns" in held.dataset.attrs else "varied")  # absent from earlier files
        if len(columns) != len(held.texts("varied")):
            raise InputError("attribute 'columns'", columns, "one for each varied parameter")
        return [held.array(column, ("point",)) for column in columns]

    @classmethod
    def _read(cls, held: Contents) -> Self:
        point = ("point",)
        system = held_system(held)
        parameters, varied = held_parameters(held, system), tuple(held.texts("varied"))
        fixed = read_fixed(held, system)
        known = system.parameter_names if fixed is None else (fixed.quantity,)
        if not varied or len(set(varied)) < len(varied) or not set(varied) <= set(known):
            raise InputError("attribute 'varied'", varied, f"of {', '.join(known)}")
        quantities = (*system.all_states, *system.output_names)
        for name, wanted in (("state", system.states), ("quantity", quantities), ("parameter", varied)):
            held.names(name, wanted)
        expect_values(held, system, "multiplier", 1.0)
        held.size("point")
        forms = [signature_from(form, system) for form in held.json("forms", list)]
        for form in forms:
            form.check(system)
        n_forms = held.count("n_forms", most=len(forms))
        number = held.array("form", point, int, least=0, most=n_forms - 1)
        wide, tolerance = len(system.all_states) + 1, held.number("tolerance", *TOLERANCES)
        implicit = np.zeros(number.size, dtype=np.bool_)
        if "implicit" in held.dataset:  # absent from earlier files
            implicit = held.array("implicit", point, bool)
        points = special_points_of(held, system, (parameters, varied, fixed), forms, tolerance)
        _expect_copies(held, quantities, [forms[i].names(system) for i in number.tolist()])
        return cls(
            system=system,
            parameters=parameters,
            x0=held.array("x0", ("point", "state")),
            multipliers=complex_table(held, "multiplier", ("point", "multiplier")),
            stable=held.array("stable", point, bool),
            admissible=held.array("admissible", point, bool),
            period=held.array("period", point),
            implicit=implicit,
            residual=held.array("residual", point, least=0.0, finite=False),
            arclength=held.array("arclength", point),
            lows=held.first_finite("lows", ("point", "quantity"), wide - 1),
            highs=held.first_finite("highs", ("point", "quantity"), wide - 1),
            means=held.array("means", ("point", "quantity"), finite=False),
            harmonics=complex_table(held, "harmonic", ("point", "quantity")),
            forms=tuple(forms[:n_forms]),
            form=number,
            unknowns=ragged_rows(held, "unknown", "ragged", "point", [len(forms[i]) * wide for i in number.tolist()]),
            special_points=SpecialPoints(points, varied),
            tolerance=tolerance,
            **cls._kept_fields(held),
            **cls._own_fields(held, varied, np.column_stack(cls._varied_columns(held))),
        )


def _largest(values: NDArray[np.float64]) -> float:
    """Return the largest modulus of the finite ones of some values."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def _expect_copies(held: Contents, quantities: tuple[str, ...], signatures: list[tuple[tuple[str, str], ...]]) -> None:
    """Raise `InputError` where columns for readers, as ``min_x`` and ``signature``, are not those they repeat."""
    for side, table in (("min", "lows"), ("max", "highs")):
        values = held.array(table, ("point", "quantity"), finite=False)
        for i, q in enumerate(quantities):
            name = f"{side}_{q}"
            if name not in held.dataset.data_vars:  # that of a phase, or left out by who wrote the file
                continue
            own = held.array(name, ("point",), finite=False)  # a reading of the same name is an extreme by itself
            if not np.allclose(own, values[:, i], rtol=PRINTED, atol=PRINTED * _largest(values[:, i]), equal_nan=True):
                raise InputError(f"variable {name!r}", "another one", f"the column of {q!r} in {table!r}")
    if "signature" in held.dataset:
        written = [" -> ".join(f"{mode}:{transition}" for mode, transition in names) for names in signatures]
        if held.array("signature", ("point",), str).tolist() != written:
            raise InputError("variable 'signature'", "another one", "that of each point's form")
