"""A calibrated cantilever as a result: values, errors, the spectrum that they come from."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.calibration.spectra import PSD_UNITS
from saltus.afm.calibration.thermal import oscillator
from saltus.afm.probe.probe import Probe
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result, frozen

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Calibration"]

_FITTED = ("f0_kHz", "Q", "variance", "white")  # what the peak's fit has, first among the values
_PROBE = ("f0_kHz", "Q", "k_N_m")  # what a probe takes of a mode


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Calibration(Result):
    """A cantilever's mode from a thermal spectrum; `saltus.afm.calibrate` makes it.

    ``calibration["k_N_m"]`` is a value, ``calibration.errors["k_N_m"]`` its standard error.

    Attributes
    ----------
    names : tuple of str
        ``f0_kHz``, ``Q``, ``variance`` (of the peak) and ``white`` (density of the noise), in the spectrum's units;
        then what is known of ``k_sader_N_m``, ``k_equipartition_N_m``, ``k_static_N_m``, ``k_N_m`` (modal, for a
        probe), ``invols_nm_V`` (by pressing on a sample) and ``amplitude_nm`` (root mean square, of the mode's end).
    values : ndarray, shape (name,)
        Their values.
    covariance : ndarray, shape (name, name)
        Of the values.
    f_kHz, psd : ndarray, shape (bin,)
        The spectrum.
    used : ndarray of bool, shape (bin,)
        What was fitted.
    unit : {"psd_nm2_Hz", "psd_V2_Hz"}
        Name of the spectrum's column, with its unit.
    mode : int
        Number of the mode, from 1.
    averages : float
        Spectra that were averaged, as given or as the scatter tells.
    method : str
        Where the stiffness is from: ``"sader"``, ``"equipartition"``, ``"given"``, or an empty text.
    notes : tuple of str
        What was found about the spectrum.

    Examples
    --------
    >>> import numpy as np
    >>> from saltus import afm
    >>> f = np.linspace(10.0, 150.0, 1401)
    >>> shape = 70.0**3 / 150.0 / ((f**2 - 70.0**2) ** 2 + (f * 70.0 / 150.0) ** 2)
    >>> noise = np.random.default_rng(1).gamma(50, size=f.size) / 50
    >>> data = {"f_kHz": f, "psd_nm2_Hz": (1.1e-6 * shape + 1e-8) * noise}
    >>> found = afm.calibrate(data, length_um=240.0, width_um=35.0, fluid=afm.Fluid.air())
    >>> print(f"{found['f0_kHz']:.1f} kHz")
    70.0 kHz
    """

    names: tuple[str, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    f_kHz: NDArray[np.float64]
    psd: NDArray[np.float64]
    used: NDArray[np.bool_]
    unit: str
    mode: int
    averages: float
    method: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "f_kHz", "psd"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        object.__setattr__(self, "used", frozen(self.used, bool))

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(checks.chosen("value", name, self.names))])

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors of the values, by linear theory."""
        return dict(zip(self.names, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def priors(self) -> dict[str, tuple[float, float]]:
        """Values and standard errors of ``f0_kHz``, ``Q`` and ``k_N_m``, as `saltus.afm.fit` takes them."""
        errors = self.errors
        known = [name for name in _PROBE if name in self.names and errors[name] > 0.0]
        return {name: (self[name], errors[name]) for name in known}

    def model(self, f_kHz: object = None) -> NDArray[np.float64]:
        """Return the spectrum that was fitted.

        Parameters
        ----------
        f_kHz : array_like, optional
            Frequencies, in kHz; by default those of the spectrum.

        Returns
        -------
        ndarray, shape of `f_kHz`, in the spectrum's unit

        Raises
        ------
        InputError
            A frequency is no number.
        """
        f = self.f_kHz if f_kHz is None else checks.array("f_kHz", f_kHz)
        return oscillator(f, self.values[: len(_FITTED)])

    def probe(self, R_nm: float, *, higher: Sequence[Calibration] = (), check: bool = True) -> Probe:
        """Return the calibrated probe.

        Parameters
        ----------
        R_nm : float
            Radius of the tip, in nm.
        higher : sequence of Calibration, optional
            Calibrations of the modes 2, 3 and so on.
        check : bool, optional
            Whether implausible values are refused.

        Returns
        -------
        Probe

        Raises
        ------
        InputError
            The stiffness is not known, or the modes are not 1, 2, 3 and so on.
        """
        each = [self, *checks.listed("higher", higher, "calibrations of higher modes")]
        for number, one in enumerate(each, 1):
            checks.instance("higher", one, Calibration)
            if one.mode != number:
                raise InputError("mode", one.mode, f"{number} here", "a probe's modes are 1, 2, 3 and so on")
            if "k_N_m" not in one.names:
                hint = "give calibrate length_um, width_um and fluid, invols_nm_V, or k_static_N_m"
                raise InputError("k_N_m", None, "known", hint)
        k, f0, Q = ([one[name] for one in each] for name in ("k_N_m", "f0_kHz", "Q"))
        return Probe(k_N_m=k, f0_kHz=f0, Q=Q, R_nm=R_nm, check=check)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the spectrum along ``bin`` and the values along ``name``."""
        from saltus.extras import xr

        data = {
            "psd": ("bin", self.psd, {"units": PSD_UNITS[self.unit], "long_name": "power spectral density"}),
            "used": ("bin", self.used.astype(np.int8)),
            "value": ("name", self.values),
            "covariance": (("name", "name_other"), self.covariance),
        }
        coords = {
            "f_kHz": ("bin", self.f_kHz, {"units": "kHz", "long_name": "frequency"}),
            "name": list(self.names),
        }
        attrs = {
            "unit": self.unit,
            "mode": self.mode,
            "averages": self.averages,
            "method": self.method,
            "notes": json.dumps(list(self.notes)),
        }
        return xr.Dataset(data, coords, attrs)

    @classmethod
    def _read(cls, held: Contents) -> Calibration:
        held.size("bin", least=1)
        names = tuple(map(str, held.array("name", ("name",), str).tolist()))
        if names[: len(_FITTED)] != _FITTED:
            raise InputError("name", names, f"{', '.join(_FITTED)}, and more")
        held.expect(name_other=len(names))
        return cls(
            names=names,
            values=held.array("value", ("name",)),
            covariance=held.array("covariance", ("name", "name_other")),
            f_kHz=held.array("f_kHz", ("bin",), least=0.0),
            psd=held.array("psd", ("bin",), least=0.0),
            used=held.array("used", ("bin",), int, least=0, most=1).astype(bool),
            unit=checks.chosen("unit", held.text("unit"), PSD_UNITS),
            mode=held.count("mode", least=1),
            averages=held.number("averages", least=0.0),
            method=held.text("method"),
            notes=tuple(held.texts("notes")),
        )

    def __repr__(self) -> str:
        f, errors = self.f_kHz[self.used], self.errors
        lines = [
            f"Calibration of mode {self.mode}: {int(self.used.sum())} of {len(self.psd)} bins,"
            f" {f.min():.5g} to {f.max():.5g} kHz, {self.averages:.3g} averages"
        ]
        wide = max(len(name) for name in self.names)
        lines += [f"  {name:{wide}}  {_rounded(self[name], errors[name])}{self._unit_of(name)}" for name in self.names]
        lines += [f"  the stiffness is that by {self.method}"] if self.method else []
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def _unit_of(self, name: str) -> str:
        """Return the unit of a value whose name has none."""
        squared = PSD_UNITS[self.unit].removesuffix("/Hz")
        return {"variance": f" {squared}", "white": f" {squared}/Hz"}.get(name, "")


def _rounded(value: float, error: float) -> str:
    return f"{value:.6g} +- {error:.2g}"


def values_with_errors(
    names: Sequence[str], found: Mapping[str, float], slopes: NDArray[np.float64], covariance: NDArray[np.float64]
) -> dict[str, Any]:
    """Return names, values and their covariance, from derivatives of logarithms by inputs with a covariance."""
    values = np.array([found[name] for name in names])
    spread = (slopes @ covariance @ slopes.T) * np.outer(values, values)
    return {"names": tuple(names), "values": values, "covariance": 0.5 * (spread + spread.T)}
