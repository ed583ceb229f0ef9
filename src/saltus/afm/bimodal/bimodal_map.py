"""A map of bimodal microscopy as a result: values and readings at each pixel, their errors, derivatives and reasons."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from saltus import checks
from saltus.afm.bimodal.balance import OF_MODES, mode_of
from saltus.afm.models.readings import READINGS, Reading
from saltus.afm.probe.units import quantity_of
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result, frozen

if TYPE_CHECKING:
    import xarray as xr

    from saltus.contents import Contents

__all__ = ["BimodalMap", "reading_of"]

_READINGS = {
    "shift_Hz": Reading("Hz", "frequency shift"),
    "excitation_nm": Reading("nm", "excitation, as a free amplitude"),
    "mean_gap_nm": Reading("nm", "mean gap"),
    "Zc_nm": Reading("nm", "distance"),
    "virial_eV": Reading("eV", "virial"),
    "E_ts_eV": Reading("eV", "energy to the sample in a cycle"),
    "E_GPa": Reading("GPa", "effective modulus"),
    "eta_Pa_s": Reading("Pa s", "viscosity"),
    "H_aJ": Reading("aJ", "Hamaker constant"),
}
_SIGMA = "sigma_"  # prefix of standard errors in a Dataset
_SLOPES = "derivatives"  # variable of derivatives in a Dataset


def reading_of(name: str) -> Reading:
    """Return unit and long name of a column; one of a mode says of which."""
    first, mode = mode_of(name)
    known = _READINGS.get(first) or READINGS.get(first)
    if known is None:
        quantity = quantity_of(name)
        return Reading(quantity.unit if quantity else "", first.split("_")[0])
    several = mode or first in (*OF_MODES, "virial_eV", "E_ts_eV")
    return Reading(known.unit, f"{known.long_name}, mode {1 + mode}" if several else known.long_name)


@dataclass(frozen=True, eq=False, repr=False)
class BimodalMap(Result):
    """Values and readings at each pixel; `saltus.afm.bimodal` and `saltus.afm.bimodal_map` make it.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape of the map
        ``Zc_nm``, ``mean_gap_nm``, ``indentation_nm``, ``deflection_pm`` and the law's parameters. Readings of modes
        are ``amplitude_nm``, ``lag_deg``, ``shift_Hz`` and ``excitation_nm``, of the second and third with ``_2`` and
        ``_3``. Each mode has ``virial_eV`` and ``E_ts_eV``, in a cycle of its own. NaN where there is no solution.
    found : tuple of str
        The columns that were sought.
    sigma : mapping of str to ndarray
        Standard errors of the values sought, from those of the readings; empty where none are known.
    derivatives : mapping of (str, str) to ndarray
        Derivative of a value sought along a value given: ``derivatives["E_GPa", "shift_Hz_2"]``.
    solutions : ndarray of int
        How many solutions were found; above 1 the reason tells which one is meant.
    chi2 : ndarray
        What readings and law lack in agreement, in squared standard errors; 0 where all equations are met.
    freedom : int
        Equations less unknowns, the mean of `chi2` for a true law.
    status : ndarray of int
        Number of the reason in `reasons` at each pixel; 0 where there is nothing to tell.
    reasons : tuple of str
        Reasons, the first of which is empty.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
    >>> law, modes = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0), (afm.AM(A0_nm=30.0), afm.FM(A_nm=0.5))
    >>> seen = afm.bimodal(probe, law, (afm.AM(A0_nm=30.0, setpoint_nm=25.0), modes[1]))
    >>> round(float(seen["lag_deg"]), 2)
    56.57
    """

    columns: Mapping[str, NDArray[np.float64]]
    found: tuple[str, ...]
    sigma: Mapping[str, NDArray[np.float64]]
    derivatives: Mapping[tuple[str, str], NDArray[np.float64]]
    solutions: NDArray[np.int64]
    chi2: NDArray[np.float64]
    freedom: int
    status: NDArray[np.int64]
    reasons: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("columns", "sigma", "derivatives"):
            object.__setattr__(self, name, {key: frozen(values) for key, values in getattr(self, name).items()})
        object.__setattr__(self, "chi2", frozen(self.chi2))
        for name in ("solutions", "status"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.int64))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the map."""
        return tuple(self.status.shape)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.columns[checks.chosen("column", name, tuple(self.columns))]

    def reason(self, *place: int) -> str:
        """Return what is to be told of a pixel, an empty text where there is nothing.

        Parameters
        ----------
        *place : int
            Indices of the pixel.

        Returns
        -------
        str

        Raises
        ------
        InputError
            There is no such pixel.
        """
        try:
            return self.reasons[int(self.status[place])]
        except (IndexError, TypeError):
            raise InputError("place", place, f"{len(self.shape)} indices of a map of shape {self.shape}") from None

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the map as a Dataset along ``axis_0``, ``axis_1`` and so on; errors have the prefix ``sigma_``."""
        from saltus.extras import xr

        axes = tuple(f"axis_{i}" for i in range(len(self.shape)))
        data: dict[str, Any] = {"status": (axes, self.status), "solutions": (axes, self.solutions)}
        data["chi2"] = (axes, self.chi2)
        for prefix, values in (("", self.columns), (_SIGMA, self.sigma)):
            for name, value in values.items():
                reading = reading_of(name)
                told = ("standard error of " if prefix else "") + reading.long_name
                data[prefix + name] = (axes, value, {"units": reading.unit, "long_name": told})
        pairs = list(self.derivatives)
        if pairs:
            data[_SLOPES] = (("pair", *axes), np.stack([self.derivatives[pair] for pair in pairs]))
        attrs = {
            "columns": json.dumps(list(self.columns)),
            "found": json.dumps(self.found),
            "sigma": json.dumps(list(self.sigma)),
            "of": json.dumps([of for of, _ in pairs]),
            "along": json.dumps([along for _, along in pairs]),
            "reasons": json.dumps(self.reasons),
            "freedom": self.freedom,
            "axes": len(axes),
        }
        return xr.Dataset(data, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> BimodalMap:
        axes = tuple(f"axis_{i}" for i in range(held.count("axes", most=10)))
        columns = {name: held.array(name, axes, finite=False) for name in held.texts("columns")}
        sigma = {name: held.array(_SIGMA + name, axes, finite=False) for name in held.texts("sigma")}
        pairs = list(zip(held.texts("of"), held.texts("along"), strict=False))
        slopes = held.array(_SLOPES, ("pair", *axes), finite=False) if pairs else np.empty((0,))
        if len(slopes) != len(pairs) or len(held.texts("along")) != len(pairs):
            raise InputError("attribute 'of'", len(pairs), f"as many names as there are derivatives: {len(slopes)}")
        status, solutions = (held.array(name, axes, int) for name in ("status", "solutions"))
        reasons, found = tuple(held.texts("reasons")), tuple(held.texts("found"))
        if status.size and not (status.min() >= 0 and status.max() < len(reasons)):
            raise InputError("status", int(status.max()), f"a number below {len(reasons)}, one of the reasons")
        if unknown := set(found) - set(columns):
            raise InputError("attribute 'found'", sorted(unknown), "names of columns")
        derivatives = dict(zip(pairs, slopes, strict=True))
        chi2 = held.array("chi2", axes, finite=False)
        freedom = held.count("freedom")
        return cls(columns, found, sigma, derivatives, solutions, chi2, freedom, status, reasons)

    def __repr__(self) -> str:
        size, solved = self.status.size, int(np.isfinite(self.columns["mean_gap_nm"]).sum())
        lines = [f"BimodalMap, {' x '.join(map(str, self.shape)) or 'one point'}: {solved} of {size} solved"]
        for name in self.found:
            values = self.columns[name][np.isfinite(self.columns[name])]
            if len(values):
                told = f"{values.min():.6g} to {values.max():.6g}" if len(values) > 1 else f"{values[0]:.9g}"
                if name in self.sigma:
                    told += f", standard error {np.nanmedian(self.sigma[name]):.3g}"
                lines.append(f"  {name:16} {told}")
        counts = np.bincount(self.status.ravel(), minlength=len(self.reasons))
        lines += [f"  {n} x {text}" for n, text in zip(counts, self.reasons, strict=True) if n and text]
        return "\n".join(lines)
