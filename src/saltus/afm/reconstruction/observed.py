"""What an instrument measures, as averages of the force: the reduced shift and its errors.

A tip that swings by ``A cos`` over the gap D has ``<F z>``, the mean of force times displacement. Its frequency, or the
lag behind a drive, tells the reduced shift ``Omega = -<F z>/(k A**2)``. By the balance of the first harmonic

    frequency modulation   Omega = ((f/f0)**2 - 1)/2
    amplitude modulation   Omega = ((f/f0)**2 - 1 + F0/(k A) cos(lag))/2
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from saltus.afm.probe.drive import Drive
    from saltus.afm.probe.probe import Probe

__all__ = ["LEAST", "Observed", "amplitude_modulation", "errors_beside", "frequency_modulation"]

LEAST = 8  # data, at least, of which a force is made
_LEAST_SPAN = 1e-3  # nm; distances of the data
_PM_IN_NM = 1e-3
_ROW = "row"  # number of a row of the table
_LEAST_ERROR = 1e-9  # of a reduced shift, over the greatest one
_NODE = math.sqrt(3.0)  # of Gauss and Hermite's rule for the mean of three values over a normal error
_GIVEN = 0.5  # energy of the drive over the lever's loss below which the sample would give energy, whatever the errors
_TAKEN = 1e3  # the same, above which amplitudes are in another unit


@dataclass(frozen=True)
class Observed:
    """Data as reduced shifts, ordered by the least gap that is reached, shape (datum,) each."""

    centre: NDArray[np.float64]  # gap in the middle of the oscillation, in nm, of a lever that does not bend
    deflection: NDArray[np.float64] | None  # mean deflection, in nm, where it is measured
    amplitude: NDArray[np.float64]  # in nm
    shift: NDArray[np.float64]  # the reduced shift
    k: float  # stiffness of the mode, in N/m
    compliance: float  # of the bent lever, in nm/nN
    changed: NDArray[np.float64]  # changes of the last three by each reading's error, shape (reading, 3, datum)
    row: NDArray[np.int64]  # where it stands among the data
    given: float = 1.0  # energy of the drive over the lever's loss

    def ordered(self) -> Observed:
        """The data with ascending least gaps."""
        order = np.argsort(self.centre + (0.0 if self.deflection is None else self.deflection) - self.amplitude)
        return replace(
            self,
            centre=self.centre[order],
            deflection=None if self.deflection is None else self.deflection[order],
            amplitude=self.amplitude[order],
            shift=self.shift[order],
            changed=self.changed[..., order],
            row=self.row[order],
        )


def frequency_modulation(table: pd.DataFrame, probe: Probe, A_nm: float, sigma: Mapping[str, Any] | None) -> Observed:
    """Return the data of a tip that is held at an amplitude."""
    f0 = 1e3 * next(iter(probe.f0_kHz))  # type: ignore[arg-type]
    columns, errors = _read(table, ("shift_Hz",), sigma)
    if (least := float(columns["shift_Hz"].min())) <= -f0:
        raise InputError("shift_Hz", least, f"above {-f0:.6g} Hz, where the frequency is 0")
    amplitude = np.full(len(columns["Zc_nm"]), A_nm)

    def reduced(seen: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return amplitude, seen["shift_Hz"] / f0 * (1.0 + 0.5 * seen["shift_Hz"] / f0)

    return _observed(columns, errors, reduced, probe, 1)


def amplitude_modulation(
    table: pd.DataFrame, probe: Probe, drive: Drive, f_kHz: float, sigma: Mapping[str, Any] | None
) -> Observed:
    """Return the data of a tip that is driven at a frequency."""
    mode = drive.mode if drive.A0_nm is not None else 1
    k, f0, Q = (list(values)[mode - 1] for values in (probe.k_N_m, probe.f0_kHz, probe.Q))  # type: ignore[arg-type]
    length = _drive_length(drive, k, f0, Q)
    columns, errors = _read(table, ("amplitude_nm", "lag_deg"), sigma)
    if wrong := np.flatnonzero(columns["amplitude_nm"] <= 0.0).tolist():
        allowed = "above 0, in each row"
        raise InputError("amplitude_nm", float(columns["amplitude_nm"][wrong[0]]), allowed, f"not in row {wrong[0]}")
    given = _given(columns["lag_deg"], columns["amplitude_nm"] * f_kHz / (f0 * Q * length))

    def reduced(seen: Mapping[str, NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        A = seen["amplitude_nm"]
        return A, 0.5 * ((f_kHz / f0) ** 2 - 1.0 + length / A * np.cos(np.radians(seen["lag_deg"])))

    return replace(_observed(columns, errors, reduced, probe, mode), given=given)


def errors_beside(
    shift: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]],
    centre: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    measured: NDArray[np.float64],
    changed: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the standard errors of measured reduced shifts beside those of a force.

    An error of an amplitude or a distance moves the datum along the force's shifts: only what is beside them counts.
    Where the shift has an extremum its bend counts, in the mean over the error.

    Parameters
    ----------
    shift : callable
        Reduced shifts of the force by centre and amplitude.
    changed : ndarray, shape (reading, 3, datum)
        Changes of centre, amplitude and measured shift by the error of each reading.
    """
    here, squares = shift(centre, amplitude), np.zeros(len(measured))
    for moved, more, told in changed:
        if moved.any() or more.any():
            ends = [far * told + here - shift(centre + far * moved, amplitude + far * more) for far in (-_NODE, _NODE)]
            squares += np.sum(np.square(ends), axis=0) / (2.0 * _NODE**2)
        else:
            squares += told**2
    found = np.sqrt(squares)
    return np.asarray(np.maximum(found, _LEAST_ERROR * float(np.abs(measured).max())))


def _given(lag: NDArray[np.float64], lost: NDArray[np.float64]) -> float:
    """Return the energy that the drive gives over what the lever loses, in the median; raise where no sample can be so.

    The drive gives ``sin(lag)`` of its greatest power, and the lever loses `lost` of it. A sample takes the rest.
    """
    largest = float(np.abs(lag).max())
    given = float(np.median(np.sin(np.radians(lag)) / lost))
    if largest <= math.tau and given < _GIVEN < float(np.median(np.sin(lag) / lost)):
        allowed = f"in degrees: with such lags the drive gives {given:.2g} of what the lever loses"
        hint = f"in rad? then it is {math.degrees(largest):.4g} degrees; numpy.degrees converts"
        raise InputError("greatest lag_deg", largest, allowed, hint)
    if not _GIVEN <= given <= _TAKEN:
        told = float(f"{given:.3g}")
        hint = "lags are 90 at f0; are columns, units, phase convention, Q, f_kHz and the drive those of the data?"
        allowed = f"between {_GIVEN:g} and {_TAKEN:g}: a sample gives no energy"
        raise InputError("energy of the drive over the lever's loss", told, allowed, hint)
    return given


def _drive_length(drive: Drive, k: float, f0: float, Q: float) -> float:
    """Return the amplitude of a drive's force over the stiffness, in nm."""
    if drive.Y_nm is not None:
        raise InputError("drive", drive, "a force, as Drive(A0_nm=...)", "light does not show the motion of a base")
    if drive.F0_nN is not None:
        return drive.F0_nN / k
    at = {"f0": f0, "peak": f0 * math.sqrt(max(1.0 - 0.5 / Q**2, 0.0))}.get(str(drive.at), drive.at)
    ratio = float(at) / f0
    return float(drive.A0_nm or 0.0) * math.hypot(1.0 - ratio**2, ratio / Q)


def _read(
    table: pd.DataFrame, readings: tuple[str, ...], sigma: Mapping[str, Any] | None
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Return the columns that count, and the standard errors of some of them; rows with gaps are left out."""
    wanted = ("Zc_nm", *readings, *(("deflection_pm",) if "deflection_pm" in table.columns else ()))
    for name in wanted:
        if name not in table.columns:
            raise InputError("data", list(map(str, table.columns)), f"columns {', '.join(wanted)}", f"no {name!r}")
    try:
        columns = {name: np.asarray(table[name], dtype=float) for name in wanted}
    except (TypeError, ValueError) as error:
        raise InputError("data", list(wanted), "columns of numbers", str(error)) from None
    errors = {
        name: _error(name, value, len(table))
        for name, value in checks.mapping("sigma", sigma, "readings to standard errors", known=wanted).items()
    }
    whole = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    if np.count_nonzero(whole) < LEAST:
        raise InputError("data", int(np.count_nonzero(whole)), f"{LEAST} rows or more with numbers in all columns")
    span = float(np.ptp(columns["Zc_nm"][whole]))
    if span < _LEAST_SPAN:
        hint = f"in m? then they span {span * 1e9:g} nm" if span else "all are one"
        raise InputError("Zc_nm", span, f"distances that span {_LEAST_SPAN:g} nm or more", hint)
    columns[_ROW] = np.arange(len(table), dtype=float)
    return {k: v[whole] for k, v in columns.items()}, {k: v[whole] for k, v in errors.items()}


def _error(name: str, value: Any, rows: int) -> NDArray[np.float64]:
    """Return the standard errors of a reading, one a row."""
    found = checks.array(f"sigma[{name!r}]", value)
    if found.shape not in ((), (rows,)) or (found < 0.0).any():
        raise InputError(f"sigma[{name!r}]", value, "a number that is not negative, or one a row")
    return np.broadcast_to(found, (rows,)).copy()


def _observed(
    columns: Mapping[str, NDArray[np.float64]],
    errors: Mapping[str, NDArray[np.float64]],
    reduced: Any,
    probe: Probe,
    mode: int,
) -> Observed:
    stiffnesses = list(probe.k_N_m)  # type: ignore[arg-type]
    amplitude, shift = reduced(columns)
    if not shift.any():
        raise InputError(
            "data", 0.0, "changed by a force", "the frequency, or the lag, is that of a free lever in each row"
        )
    bent = columns.get("deflection_pm")
    changed = []
    for name, error in errors.items():
        seen = dict(columns) | {name: columns[name] + error}
        moved = (seen["deflection_pm"] - columns["deflection_pm"]) * _PM_IN_NM if bent is not None else 0.0
        other = reduced(seen)
        changed.append((seen["Zc_nm"] - columns["Zc_nm"] + moved, other[0] - amplitude, other[1] - shift))
    return Observed(
        columns["Zc_nm"],
        None if bent is None else bent * _PM_IN_NM,
        amplitude,
        shift,
        stiffnesses[mode - 1],
        sum(1.0 / k for k in stiffnesses),
        np.array(changed).reshape(len(changed), 3, len(shift)),
        columns[_ROW].astype(np.int64),
    ).ordered()
