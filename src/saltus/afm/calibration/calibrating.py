"""The calibration of a cantilever by a thermal spectrum, with errors."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from saltus import checks
from saltus.afm.calibration.calibration import Calibration, values_with_errors
from saltus.afm.calibration.spectra import read_spectrum, spectrum_of
from saltus.afm.calibration.stiffness import (
    BOLTZMANN_AJ_K,
    check_plan,
    modal_over_static,
    optical_chi,
    sader_stiffness,
)
from saltus.afm.calibration.thermal import Peak, fitted_peak
from saltus.afm.probe.fluid import Fluid
from saltus.afm.probe.probe import MOST_MODES
from saltus.afm.probe.units import Quantity, checked
from saltus.errors import InputError

__all__ = ["CalibrationOptions", "calibrate"]

Measured = float | tuple[float, float]

_STEP = 1e-5  # change of a logarithm by which derivatives are taken
_BROAD = 5.0  # quality factor below which the fluid's load changes over the peak
_APART = 3.0  # difference of two stiffnesses, in standard errors, that is told
_FEW = 5.0  # bins in the width of a peak below which a window widens it
_SCATTER = 5.0  # deviation of the scatter from that of the averages, in its standard errors, that is told
_LEVERS = ("optical", "displacement")
_METHODS = ("given", "sader", "equipartition")


@dataclass(frozen=True, kw_only=True)
class CalibrationOptions:
    """How a thermal spectrum is read.

    Attributes
    ----------
    method : {"given", "sader", "equipartition"}
        Which stiffness the probe has; by default the first of these that is known.
    mode : int
        Number of the mode whose peak it is.
    lever : {"optical", "displacement"}
        What a spectrum in nm shows: a deflection scaled by pressing on a sample, as reflected light does; or the true
        displacement of the end, as of an interferometer.
    averages : int
        Independent spectra that were averaged; by default what the scatter of the bins tells.
    range_kHz : (float, float)
        Frequencies that are fitted; by default around the highest peak, from 0.4 to 2.5 times its frequency at most.
    check : bool
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed.

    Examples
    --------
    >>> CalibrationOptions(mode=2, range_kHz=(300.0, 500.0)).lever
    'optical'
    """

    method: str | None = None
    mode: int = 1
    lever: str = "optical"
    averages: int | None = None
    range_kHz: tuple[float, float] | None = None
    check: bool = True

    def __post_init__(self) -> None:
        checks.flag("check", self.check)
        checks.chosen("lever", self.lever, _LEVERS)
        checks.count("mode", self.mode, 1, MOST_MODES)
        if self.method is not None:
            checks.chosen("method", self.method, _METHODS)
        if self.averages is not None:
            checks.count("averages", self.averages, 1)
        if self.range_kHz is not None:
            checks.interval("range_kHz", self.range_kHz, finite=True)


def calibrate(
    spectrum: object,
    *,
    T_K: Measured = 298.15,
    length_um: Measured | None = None,
    width_um: Measured | None = None,
    fluid: Fluid | None = None,
    invols_nm_V: Measured | None = None,
    k_static_N_m: Measured | None = None,
    options: CalibrationOptions | None = None,
) -> Calibration:
    """Return a cantilever's frequency, quality factor, stiffness and lever sensitivity from a thermal spectrum.

    A harmonic oscillator with white noise is fitted by maximum likelihood. The stiffness is Sader's, from `length_um`,
    `width_um` and `fluid`; or by equipartition, from a spectrum in nm^2/Hz, or in V^2/Hz with `invols_nm_V`. A spectrum
    in V^2/Hz and a stiffness give `invols_nm_V`. docs/afm/calibration.md has the formulas.

    Measured quantities are numbers, or numbers with their standard errors: ``length_um=(225.0, 1.0)``.

    Parameters
    ----------
    spectrum : path-like, pandas.DataFrame, xarray.Dataset or mapping of str to array
        A file that `saltus.afm.read_spectrum` reads, or columns as it returns: one-sided densities.
    T_K : float or (float, float), optional
        Temperature, in K: 60 to 500, unless `check` of the options is False.
    length_um, width_um : float or (float, float), optional
        The beam's length and width, in um.
    fluid : Fluid, optional
        What the cantilever was in, for Sader's method.
    invols_nm_V : float or (float, float), optional
        Inverse sensitivity of the lever in nm/V, from the slope of a curve on a hard sample.
    k_static_N_m : float or (float, float), optional
        A static stiffness that is known.
    options : CalibrationOptions, optional
        Which mode, which stiffness, what a spectrum shows, and what of it is fitted.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        Columns or values that cannot be used, or a spectrum without a peak: the message has the number that says so.
    ConvergenceError
        No optimum is found.

    References
    ----------
    J. L. Hutter, J. Bechhoefer, Rev. Sci. Instrum. 64, 1868 (1993); H.-J. Butt, M. Jaschke, Nanotechnology 6, 1 (1995);
    J. E. Sader et al., Rev. Sci. Instrum. 70, 3967 (1999); M. J. Higgins et al., Rev. Sci. Instrum. 77, 013701 (2006).

    Examples
    --------
    >>> f = np.linspace(10.0, 150.0, 1401)
    >>> shape = 70.0**3 / 150.0 / ((f**2 - 70.0**2) ** 2 + (f * 70.0 / 150.0) ** 2)
    >>> noise = np.random.default_rng(1).gamma(50, size=f.size) / 50
    >>> data = {"f_kHz": f, "psd_nm2_Hz": (1.1e-6 * shape + 1e-8) * noise}
    >>> found = calibrate(data, length_um=240.0, width_um=35.0, fluid=Fluid.air())
    >>> print(f"{found['f0_kHz']:.1f} kHz", abs(found["Q"] - 150.0) < 3.0 * found.errors["Q"])
    70.0 kHz True
    >>> found.probe(R_nm=10.0).modes
    1
    """
    if isinstance(spectrum, str | os.PathLike):
        spectrum = read_spectrum(Path(spectrum))
    f, psd, unit = spectrum_of(spectrum)
    options = CalibrationOptions() if options is None else options
    checks.instance("options", options, CalibrationOptions)
    number, method, check = options.mode, options.method, options.check
    given = _quantities(
        check,
        {
            "T_K": T_K, "length_um": length_um, "width_um": width_um, "invols_nm_V": invols_nm_V,
            "k_static_N_m": k_static_N_m,
        },
    )  # fmt: skip
    _check_together(given, fluid, unit, method)
    if check and fluid is not None:
        check_plan(given["length_um"][0], given["width_um"][0])
    peak = fitted_peak(f, psd, options.averages, options.range_kHz)
    known = dict(zip(("f0_kHz", "Q", "variance", "white"), peak.values.tolist(), strict=True))
    checked("f0_kHz", known["f0_kHz"], plausible=check)
    inputs = known | {name: value for name, (value, _) in given.items()}
    chi = optical_chi(number) if options.lever == "optical" else 1.0

    def outcome(values: Mapping[str, float]) -> dict[str, float]:
        return _outcome(values, fluid, unit, number, chi, method)

    found = outcome(inputs)
    logs, covariance = _logarithms(peak, given, inputs)
    slopes = np.array([_slope(outcome, inputs, name, list(found)) for name in logs]).T
    kept = values_with_errors(list(found), found, slopes, covariance)
    used = method or ("given" if "k_static_N_m" in given else _first_of(found))
    return Calibration(
        **kept, f_kHz=f, psd=psd, used=peak.used, unit=unit, mode=number, averages=peak.averages, method=used,
        notes=_notes(peak, found, f, options.averages, kept),
    )  # fmt: skip


_KEYS = {"given": "k_given_N_m", "sader": "k_sader_N_m", "equipartition": "k_equipartition_N_m"}
_STIFFNESS = Quantity("N/m", 1e-4, 1e4, "+")


def _first_of(found: Mapping[str, float]) -> str:
    """Return the method of the first stiffness that was found; an empty text where there is none."""
    return next((one for one in _METHODS if _KEYS[one] in found), "")


def _quantities(check: bool, values: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return measured quantities with their standard errors, 0 where none is given."""
    found = {}
    for name, value in values.items():
        if value is None:
            continue
        number, error = value if isinstance(value, tuple | list) and len(value) == 2 else (value, 0.0)
        quantity = _STIFFNESS if name == "k_static_N_m" else None
        number = checked(name, number, plausible=check, quantity=quantity)
        error = checks.non_negative(f"error of {name}", error)
        if error >= number:
            raise InputError(f"error of {name}", error, f"below the value {number:g}")
        found[name] = number, error
    return found


def _check_together(given: Mapping[str, Any], fluid: Fluid | None, unit: str, method: str | None) -> None:
    """Raise `InputError` where quantities are given that do not go together."""
    sizes = [name for name in ("length_um", "width_um") if name in given]
    if fluid is not None:
        checks.instance("fluid", fluid, Fluid)
    if 0 < len(sizes) + (fluid is not None) < 3:
        told = [*sizes, *(["fluid"] if fluid is not None else [])]
        raise InputError("given", told, "length_um, width_um and fluid together", "Sader's method needs all three")
    if "invols_nm_V" in given and unit != "psd_V2_Hz":
        raise InputError("invols_nm_V", given["invols_nm_V"][0], "left out for a spectrum in nm^2/Hz")
    if method is not None:
        needed = {
            "given": "k_static_N_m" in given,
            "sader": bool(sizes),
            "equipartition": unit == "psd_nm2_Hz" or "invols_nm_V" in given,
        }
        if not needed[method]:
            raise InputError("method", method, f"one of {', '.join(one for one in _METHODS if needed[one]) or 'none'}")


def _outcome(
    values: Mapping[str, float], fluid: Fluid | None, unit: str, mode: int, chi: float, method: str | None
) -> dict[str, float]:
    """Return what follows from the peak and the quantities given, by name."""
    found = {name: values[name] for name in ("f0_kHz", "Q", "variance", "white")}
    thermal, ratio = BOLTZMANN_AJ_K * values["T_K"], modal_over_static(mode)
    if "k_static_N_m" in values:
        found["k_given_N_m"] = values["k_static_N_m"]
    if fluid is not None:
        found["k_sader_N_m"] = sader_stiffness(
            values["f0_kHz"], values["Q"], length_um=values["length_um"], width_um=values["width_um"], fluid=fluid,
            mode=mode, check=False,
        )  # fmt: skip
    scale = 1.0 if unit == "psd_nm2_Hz" else values.get("invols_nm_V")
    if scale is not None:
        found["amplitude_nm"] = chi * scale * math.sqrt(values["variance"])
        found["k_equipartition_N_m"] = thermal / found["amplitude_nm"] ** 2 / ratio
    wanted = _METHODS if method is None else (method,)
    for one in wanted:
        if _KEYS[one] in found:
            found["k_static_N_m"] = found[_KEYS[one]]
            found["k_N_m"] = found["k_static_N_m"] * ratio
            break
    found.pop("k_given_N_m", None)
    if "k_N_m" in found and unit == "psd_V2_Hz":
        found["amplitude_nm"] = math.sqrt(thermal / found["k_N_m"])
        found["invols_nm_V"] = found["amplitude_nm"] / chi / math.sqrt(values["variance"])
    return found


def _logarithms(
    peak: Peak, given: Mapping[str, tuple[float, float]], inputs: Mapping[str, float]
) -> tuple[list[str], NDArray[np.float64]]:
    """Return the inputs that have errors, and the covariance of their logarithms."""
    uncertain = [name for name, (_, error) in given.items() if error > 0.0]
    fitted = [name for name in ("f0_kHz", "Q", "variance", "white") if inputs[name] > 0.0]
    covariance = np.zeros((len(fitted) + len(uncertain),) * 2)
    covariance[: len(fitted), : len(fitted)] = peak.covariance[: len(fitted), : len(fitted)]
    for i, name in enumerate(uncertain, len(fitted)):
        covariance[i, i] = (given[name][1] / given[name][0]) ** 2
    return [*fitted, *uncertain], covariance


def _slope(outcome: Any, inputs: Mapping[str, float], name: str, wanted: list[str]) -> list[float]:
    """Return derivatives of the logarithms of results by that of an input."""
    ends = [outcome({**inputs, name: inputs[name] * math.exp(sign * _STEP)}) for sign in (1.0, -1.0)]
    return [(math.log(ends[0][one]) - math.log(ends[1][one])) / (2.0 * _STEP) for one in wanted]


def _notes(
    peak: Peak, found: Mapping[str, float], f: NDArray[np.float64], averages: int | None, kept: Mapping[str, Any]
) -> tuple[str, ...]:
    """Return in words what was found about a spectrum."""
    notes = []
    if peak.wild:
        notes.append(f"{peak.wild} bins are lines or spikes that the noise does not explain, and were left out")
    if peak.misfit > 1.0:
        notes.append("the bins are not those of one oscillator and white noise: give a range_kHz with the peak alone")
    if not peak.covariance[3, 3]:
        notes.append("no white noise is seen beside the peak: a wider range_kHz would tell it, and its error")
    width = found["f0_kHz"] / found["Q"] / float(np.median(np.diff(f[peak.used])))
    if width < _FEW:
        notes.append(f"the peak is {width:.2g} bins wide: a window would widen it, and Q would be too small")
    if averages is not None:
        spread = math.sqrt((2.0 + 6.0 / averages) / peak.used.sum())
        if abs(peak.scatter - 1.0) > _SCATTER * spread:
            notes.append(f"the scatter is {peak.scatter:.3g} times that of {averages} averages: do other errors count?")
    if found["Q"] < _BROAD:
        notes.append(
            f"Q is below {_BROAD:g}: the fluid's load changes over the peak, and one oscillator is a rough model"
        )
    both = [name for name in ("k_sader_N_m", "k_equipartition_N_m") if name in found]
    if len(both) == 2:
        names, spread_of = list(kept["names"]), kept["covariance"]
        i, j = (names.index(name) for name in both)
        apart = found[both[0]] - found[both[1]]
        error = math.sqrt(max(spread_of[i, i] + spread_of[j, j] - 2.0 * spread_of[i, j], 0.0))
        if abs(apart) > _APART * error:
            ratio = found[both[0]] / found[both[1]]
            notes.append(f"Sader's stiffness is {ratio:.3f} times that by equipartition: more than the errors explain")
    return tuple(notes)
