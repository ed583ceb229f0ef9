"""Fits of models of a probe over a sample to measured curves."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.curves.curves import distance_curve, frequency_curve
from saltus.afm.curves.sheets import Tracing, sheet_again
from saltus.afm.models.parts import check_model
from saltus.afm.models.readings import formulas
from saltus.afm.probe.units import Quantity, checked
from saltus.continuation.many.retracing import Retraced
from saltus.errors import InputError
from saltus.fitting.estimation import FitOptions, fitted, task
from saltus.fitting.instrument import Instrument
from saltus.fitting.measured import numbers_of, read_table
from saltus.fitting.rereading import Reading

if TYPE_CHECKING:
    from saltus.continuation import Branch, StepControl
    from saltus.fitting import Fit, MeasuredPoint
    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["fit"]

_ALONG = ("Zc_nm", "f_kHz")  # columns along which curves are measured
_MARGIN = 0.02  # share of the data's range by which the model's curve goes beyond it on each side
OFFSET = "Zc_offset_nm"  # what is added to the distances of data
GAIN = "gain"  # what the detector multiplies amplitudes by
DRIFT = "f0_drift_Hz"  # change of f0 from the first datum to the last
_OWN = {
    OFFSET: Quantity("nm", 1e-5, 1e5, "any"),
    GAIN: Quantity("", 1e-3, 1e3, "+"),
    DRIFT: Quantity("Hz", 1e-4, 1e6, "any"),
}
_FREQUENCY = re.compile(r"f0_kHz(_\d+)?")  # natural frequencies, which drift in proportion
_OTHER_LAGS = (  # what lags may be in place of the numbers in a column: in words, offset and factor
    ("90 - lag_deg, of phase_convention 'bruker0'", 90.0, -1.0),
    ("-lag_deg", 0.0, -1.0),
    ("180 - lag_deg", 180.0, -1.0),
    ("-90 - lag_deg", -90.0, -1.0),
    ("90 + lag_deg", 90.0, 1.0),
    ("180 + lag_deg", 180.0, 1.0),
    ("lag_deg - 90", -90.0, 1.0),
    ("lag_deg in radians", 0.0, math.degrees(1.0)),
    ("90 - lag_deg in radians", 90.0, -math.degrees(1.0)),
)
_TURN_DEG = 360.0  # angle after which a lag repeats, in degrees


def fit(
    data: object,
    model: HybridSystem,
    vary: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, Any],
    *,
    jumps: bool | Sequence[MeasuredPoint] = True,
    priors: Mapping[str, tuple[float, float]] | None = None,
    options: FitOptions | None = None,
    progress: bool | Report = False,
) -> Fit:
    """Return the parameters with which a model fits measured distance or frequency curves best.

    The curve is followed anew from afar at each set of parameters (`saltus.afm.distance_curve`,
    `saltus.afm.frequency_curve`). `saltus.fit` has the method: nearest stable sheets, jumps as data, exact derivatives.

    Parameters
    ----------
    data : pandas.DataFrame, xarray.Dataset or mapping of str to array
        A column ``Zc_nm``, ``f_kHz`` or ``f_Hz``, and readings, as ``amplitude_nm`` and ``lag_deg``. The column
        ``direction`` has ``approach`` and ``retract``, or ``up`` and ``down``. `saltus.afm.read_curve` reads it.
    model : HybridSystem
        A model of `saltus.afm.model`; the search starts at its values.
    vary : mapping of str to (float, float)
        Parameters that are sought, with least and greatest values. Three unknowns of the measurement may be among
        them. ``Zc_offset_nm`` is added to the distances of the data. ``gain`` multiplies the model's amplitudes.
        ``f0_drift_Hz`` is the change of f0 from the first datum to the last: by a column ``time_s``, or else row by
        row.
    sigma : mapping of str to float or array
        Standard errors of the readings that are fitted, in the units of their names.
    jumps : bool or sequence of MeasuredPoint, optional
        Whether the jumps in the data are data, too. Without a column ``direction`` there are none.
    priors : mapping of str to (float, float), optional
        Values of varied parameters that are known beforehand, with standard errors, as `saltus.fit` takes them and
        `Calibration.priors` has them.
    options : FitOptions, optional
        Starts, profiles, steps.
    progress : bool or callable, optional
        As `saltus.fit` takes it.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        The system is no such model; data, bounds or names that cannot be used, or a parameter on which no datum
        depends. A bound is no plausible value of its parameter.
    ConvergenceError
        The model has no motion at the far end of its curve, at the start.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    >>> path = afm.distance_curve(system, (5.0, 11.0)).path("approach")
    >>> start = afm.model(probe, afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.5), afm.Drive(A0_nm=12.0),
    ...                   Zc_nm=20.0)
    >>> data = path[["amplitude_nm", "lag_deg"]].to_dataframe()
    >>> found = fit(data, start, {"H_aJ": (0.01, 1.0)}, {"amplitude_nm": 0.03, "lag_deg": 0.3}, jumps=False)
    >>> round(found["H_aJ"], 5)
    0.12
    """
    check_model(model, "model")
    options = FitOptions() if options is None else checks.instance("options", options, FitOptions)
    table = _in_kHz(read_table(data))
    along = _along(table)
    sigma = checks.mapping("sigma", sigma, "standard errors by column, as {'amplitude_nm': 0.03}")
    vary = checks.mapping("vary", vary, "bounds by parameter, as {'H_aJ': (0.01, 1.0)}")
    instrument = _instrument(along, model, sigma)
    _check_unknowns(vary, along, model, instrument)
    options = _with_readings(options, sigma, model)
    bounds = _range(numbers_of(table, along), along, vary.get(OFFSET, (0.0, 0.0)))
    start = {name: options.start.get(name, model.parameters[name]) for name in instrument.of_model(list(vary))}
    if isinstance(jumps, bool) and "direction" not in table:
        jumps = False
    trace = _curve(model, along, bounds, start, options.steps)
    lags = tuple(name for name in sigma if _is_lag(name))
    others = [Reading(f"lags read as {told}", lags, *numbers) for told, *numbers in _OTHER_LAGS] if lags else []
    return fitted(task(table, trace, bounds, vary, sigma, jumps, options, priors, instrument, others), progress)


def _is_lag(name: str) -> bool:
    """Whether a column is of lags, of the first drive or a further one."""
    return str(name).startswith("lag_deg")


def _check_unknowns(
    vary: Mapping[str, tuple[float, float]], along: str, model: HybridSystem, instrument: Instrument
) -> None:
    """Raise `InputError` where an unknown is neither the model's nor the measurement's, or a bound is implausible."""
    if along in vary:
        raise InputError("vary", along, "unknowns: data are along this one", f"{OFFSET} varies its origin")
    names = [*model.parameter_names, *instrument.names]
    for name, limits in checks.mapping("vary", vary, "bounds by parameter", known=names).items():
        for limit in checks.interval(f"vary[{name!r}]", limits, finite=True):
            checked(name, limit, insists="choose plausible bounds", quantity=_OWN.get(name))


def _with_readings(options: FitOptions, sigma: Mapping[str, Any], model: HybridSystem) -> FitOptions:
    """Return options with the formulas of the readings that are fitted, and the turns of the lags among them."""
    known = formulas(model)
    for name in sigma:
        if units := [reading for reading in known if reading.startswith(f"{name}_")]:
            raise InputError(f"column {name!r}", name, f"named with its unit: {' or '.join(units)}")
    observables = {name: known[name] for name in sigma if name in known} | dict(options.observables)
    turns = {name: _TURN_DEG for name in sigma if _is_lag(name)} | dict(options.turns)
    return replace(options, observables=observables, turns=turns)


def _curve(
    model: HybridSystem, along: str, bounds: tuple[float, float], start: Mapping[str, float], steps: StepControl | None
) -> Retraced:
    """Return the model's curve at the start, which is traced again at other parameters."""
    make, how = distance_curve if along == "Zc_nm" else frequency_curve, Tracing(along, bounds, steps, False)

    def whole(changes: Mapping[str, float]) -> tuple[Branch, ...]:
        return make(model, bounds, parameters=changes, steps=steps).branches

    return Retraced(whole(start), lambda orbit, known: sheet_again(orbit, known, how), whole)


def _in_kHz(table: Any) -> Any:
    """Return a table whose frequencies are in kHz."""
    if "f_Hz" not in table:
        return table
    if "f_kHz" in table:
        raise InputError("data", list(table.columns), "one column of frequencies: f_kHz or f_Hz")
    return table.assign(f_kHz=numbers_of(table, "f_Hz") / 1e3).drop(columns="f_Hz")


def _along(table: Any) -> str:
    found = [name for name in _ALONG if name in table]
    if len(found) != 1:
        raise InputError("data", list(table.columns), "one column of Zc_nm, f_kHz or f_Hz", "names tell the units")
    return found[0]


def _instrument(along: str, model: HybridSystem, sigma: Mapping[str, Any]) -> Instrument:
    """Return the unknowns that a measurement along a parameter may have."""
    first = model.parameters.get("f0_kHz", 1.0)
    return Instrument(
        offset=OFFSET if along == "Zc_nm" else "",
        gain=GAIN,
        scaled=tuple(name for name in sigma if str(name).startswith("amplitude_nm")),
        drift=DRIFT,
        drifting={name: 1e-3 * model.parameters[name] / first for name in model.parameters if _FREQUENCY.match(name)},
    )


def _range(values: Any, along: str, offsets: tuple[float, float]) -> tuple[float, float]:
    """Return the range of a curve around data whose origin may move."""
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(f"column {along!r}", f"{len(values)} rows", "at least one number")
    low, high = float(known.min()), float(known.max())
    margin = _MARGIN * (high - low) or _MARGIN * abs(high)
    if along == "f_kHz":
        margin = min(margin, 0.5 * low)  # no frequency is negative
    return low - margin + float(offsets[0]), high + margin + float(offsets[1])
