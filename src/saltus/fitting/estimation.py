"""Fits of models to measured data, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus import checks
from saltus.continuation import Branch, StepControl
from saltus.errors import ConvergenceError, InputError
from saltus.fitting.jumps import read_points
from saltus.fitting.measured import Channel, Measured, MeasuredPoint, read_measured
from saltus.fitting.optimum import Minimum, Objective, covariance, degeneracies, minimised, profiled
from saltus.fitting.result import Fit
from saltus.fitting.tracing import Retraced, Trace
from saltus.progress import Reporter

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.fitting.evaluation import Evaluation
    from saltus.progress import Report

__all__ = ["FitOptions", "Sheeted", "fit", "fitted"]

_CORRELATED = 0.95  # size of a correlation from which a parameter is profiled
_MOST = 60  # evaluations of a search, at most
_BETTER = 1e-2  # fall of the loss below that of the optimum that is more than rounding
_MOST_PROFILE = 12  # the same of one point of a profile


class Sheeted(Protocol):
    """A curve of several branches along one parameter, as `saltus.afm.Curve`."""

    @property
    def along(self) -> str:
        """The parameter."""

    @property
    def bounds(self) -> tuple[float, float]:
        """Its range."""

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches."""


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """How a fit is made.

    Attributes
    ----------
    observables : mapping of str to str
        Observables of columns with other names, as ``{"amplitude": "amplitude(x, 1)"}``.
    turns : mapping of str to float
        Angles after which observables repeat; by default 2 pi of phases, and 360 of phases in degrees.
    start : mapping of str to float
        Where the search starts; by default at the branch's values.
    profile : sequence of str or None
        Parameters of which the profile likelihood is computed; None for those that correlate above 0.95.
    steps : StepControl
        Steps of the branches that are traced.
    most : int
        Evaluations of the search, at most.
    """

    observables: Mapping[str, str] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    profile: Sequence[str] | None = None
    steps: StepControl = field(default_factory=StepControl)
    most: int = _MOST


@dataclass(frozen=True)
class Task:
    """A fit that is to be made: data, the model's branches, parameters with starts and bounds."""

    measured: Measured
    branches: tuple[Branch, ...]
    trace: Trace
    names: tuple[str, ...]
    start: NDArray[np.float64]
    bounds: NDArray[np.float64]
    options: FitOptions


def fit(
    data: object,
    branch: Branch | Sheeted,
    vary: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, Any],
    *,
    jumps: bool | Sequence[MeasuredPoint] = False,
    options: FitOptions | None = None,
    progress: bool | Report = False,
) -> Fit:
    """Return the parameters with which a branch of periodic orbits fits measured data best.

    The branch is traced again at each set of parameters. Each datum is compared with the nearest stable sheet. A datum
    beyond the end of its sheet is compared with the sheet's last orbits. All derivatives are exact: those of orbits,
    and those of special points. Residuals above 3 standard errors count less than their squares (soft-l1).
    docs/fitting.md has examples.

    Parameters
    ----------
    data : pandas.DataFrame, xarray.Dataset or mapping of str to array
        A column of the branch's parameter, and columns of observables. A complex column is of an observable
        ``"harmonic(x, 1)"``, amplitude times exp(i phase). The column ``direction`` tells the way of each datum.
    branch : Branch or Curve
        The model at the start.
    vary : mapping of str to (float, float)
        Parameters that are sought, with least and greatest values.
    sigma : mapping of str to float or array
        Standard errors by column; these columns are fitted. Those of complex data are of each part.
    jumps : bool or sequence of MeasuredPoint, optional
        Whether the jumps in the data are data, too: True needs the column ``direction``. Or measured special points.
    options : FitOptions, optional
        Names of observables, starts, profiles, steps.
    progress : bool or callable, optional
        True for a bar on stderr, or a function of a `saltus.Progress`. An interrupt (Ctrl-C) ends the search with the
        best so far.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        Data, bounds or names that cannot be used; a parameter on which no datum depends.
    ConvergenceError
        The model has no stable sheet where the data are, at the start.

    References
    ----------
    Branch, Coleman and Li, SIAM J. Sci. Comput. 21 (1999) 1-23 (the trust region); Venzon and Moolgavkar, Appl.
    Statist. 37 (1988) 87-94 (profiles).

    Examples
    --------
    >>> import numpy as np
    >>> from saltus import HybridSystem, continue_orbit, find_orbit
    >>> spring = HybridSystem.smooth(
    ...     {"x": "v", "v": "-c*v - k*x + cos(s)"}, {"k": 1.2, "c": 0.3, "w": 1.0}, phase=("s", "w")
    ... )
    >>> w = np.linspace(0.6, 1.4, 9)
    >>> data = {"w": w, "amplitude(x, 1)": 1.0 / np.hypot(1.0 - w**2, 0.2 * w)}
    >>> branch = continue_orbit(find_orbit(spring, {}, [0.0, 0.0]), "w", (0.5, 1.5))
    >>> found = fit(data, branch, {"k": (0.5, 2.0), "c": (0.05, 1.0)}, {"amplitude(x, 1)": 0.01})
    >>> round(found["k"], 6), round(found["c"], 6)
    (1.0, 0.2)
    """
    options = FitOptions() if options is None else checks.instance("options", options, FitOptions)
    branches = _branches(branch)
    low, high = _range(branch, branches)
    trace = Retraced(branches, (low, high), options.steps)
    return fitted(task(data, branches, trace, (low, high), vary, sigma, jumps, options), progress)


def _branches(branch: object) -> tuple[Branch, ...]:
    found = (branch,) if isinstance(branch, Branch) else getattr(branch, "branches", None)
    if not isinstance(found, tuple) or not found or not all(isinstance(one, Branch) for one in found):
        raise InputError("branch", type(branch).__name__, "a Branch of periodic orbits, or a curve of such branches")
    if found[0].fixed is not None:
        raise InputError("branch", found[0].parameter, "a branch along a parameter", "this one goes along a quantity")
    return found


def _range(branch: object, branches: Sequence[Branch]) -> tuple[float, float]:
    """Return the range over which branches are traced."""
    if not isinstance(branch, Branch):
        low, high = getattr(branch, "bounds")  # noqa: B009
        return float(low), float(high)
    low, high = branch.options.get("bounds", (float(branch.values.min()), float(branch.values.max())))
    return float(low), float(high)


def task(
    data: object,
    branches: tuple[Branch, ...],
    trace: Trace,
    bounds: tuple[float, float],
    vary: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, Any],
    jumps: bool | Sequence[MeasuredPoint],
    options: FitOptions,
) -> Task:
    """Return the task of a fit, its arguments checked."""
    system, along = branches[0].system, branches[0].parameter
    measured = read_measured(data, along, system, sigma, options.observables, options.turns)
    outside = (measured.x < bounds[0]) | (measured.x > bounds[1])
    if outside.any():
        hint = f"trace the branch from {measured.x.min():.9g} to {measured.x.max():.9g}"
        told = f"{int(outside.sum())} of {len(measured)} data outside"
        raise InputError(along, told, f"data between {bounds[0]:.9g} and {bounds[1]:.9g}, where the branch is", hint)
    measured = measured.with_points(read_points(jumps, measured, bounds))
    names, start, limits = _varied(vary, branches[0], options.start)
    if measured.count < len(names):
        raise InputError("data", f"{measured.count} numbers", f"at least {len(names)}, one for each varied parameter")
    if options.profile is not None:
        for name in checks.names("profile", options.profile, "varied parameters"):
            checks.chosen("profile", name, names)
    return Task(measured, branches, trace, names, start, limits, options)


def _varied(
    vary: object, branch: Branch, starts: Mapping[str, float]
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
    """Return names, starts and bounds of the varied parameters."""
    known = [name for name in branch.system.parameter_names if name != branch.parameter]
    wanted = checks.mapping("vary", vary, "bounds by parameter, as {'c': (0.01, 1.0)}", known=known)
    if not wanted:
        raise InputError("vary", vary, "at least one parameter with its bounds")
    checks.mapping("start", starts, "values by parameter", known=wanted)
    bounds = np.array([checks.interval(f"vary[{name!r}]", limits, finite=True) for name, limits in wanted.items()]).T
    start = np.array([float(starts.get(name, branch.parameters[name])) for name in wanted])
    for i, name in enumerate(wanted):
        low, high = bounds[:, i]
        if not low <= start[i] <= high:
            hint = f"the bounds exclude the start; choose others, or start={{{name!r}: ...}}"
            raise InputError(f"start of {name}", float(start[i]), f"between {low:.9g} and {high:.9g}", hint)
    return tuple(wanted), start, bounds


def fitted(wanted: Task, progress: bool | Report) -> Fit:
    """Return the fit that a task asks for."""
    names, bounds, options = wanted.names, wanted.bounds, wanted.options
    with Reporter(progress) as reporter:
        objective = Objective(wanted.measured, wanted.trace, names, reporter)
        try:
            first = objective.at(wanted.start)
        except ConvergenceError as error:
            hint = f"{error}; start elsewhere, or leave out data there"
            given = dict(zip(names, wanted.start.tolist(), strict=True))
            raise InputError("start", given, "values at which the model has what the data need", hint) from error
        silent = [name for name, column in zip(names, first.jacobian.T, strict=True) if not np.any(column)]
        if silent:
            hint = "leave it out of `vary`, or start where a datum depends on it"
            raise InputError("vary", ", ".join(silent), "parameters on which a datum depends", hint)
        found = minimised(objective, wanted.start, bounds, most=options.most)
        spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
        profiles, told = dict[str, tuple[float, float]](), list[str]()
        if not found.stopped.startswith("interrupted"):
            refused = len(objective.failures)
            profiles, told = _with_profiles(objective, found, spread, wanted)
            del objective.failures[refused:]
    return Fit(
        system=wanted.branches[0].system,
        along=wanted.measured.along,
        names=names,
        values=found.values,
        start=wanted.start,
        bounds=bounds,
        covariance=spread,
        branches=found.evaluation.branches,
        formulas={one.name: one.formulas for one in wanted.measured.channels},
        data=_dataset(found.evaluation),
        evaluations=objective.evaluations,
        stopped=found.stopped,
        profiles=profiles,
        notes=(*_notes(wanted, found, objective), *told),
    )


def _with_profiles(
    objective: Objective, found: Minimum, spread: NDArray[np.float64], wanted: Task
) -> tuple[dict[str, tuple[float, float]], list[str]]:
    """Return the profiles of what is asked for or correlates, and in words what happened on the way."""
    profiles: dict[str, tuple[float, float]] = {}
    notes: list[str] = []

    def solve(index: int, value: float) -> float:
        start = found.values + spread[:, index] / spread[index, index] * (value - found.values[index])
        start = np.clip(start, *wanted.bounds)
        start[index] = value
        there = minimised(objective, start, wanted.bounds, fixed=(index,), most=_MOST_PROFILE)
        if there.stopped.startswith("interrupted"):
            raise KeyboardInterrupt
        if there.loss < found.loss - _BETTER:
            told = ", ".join(f"{name} = {value:.6g}" for name, value in zip(wanted.names, there.values, strict=True))
            notes.append(f"a profile found a better fit, at {told}: start there")
        return there.loss

    try:
        for name in _profiled_names(wanted, spread):
            i = wanted.names.index(name)
            if not np.isfinite(spread[i, i]):
                notes.append(f"{name} has no profile: the data do not tell it")
                continue
            limits = float(wanted.bounds[0, i]), float(wanted.bounds[1, i])
            try:
                error = float(np.sqrt(spread[i, i]))
                profiles[name] = profiled(solve, i, float(found.values[i]), error, found.loss, limits)
            except ConvergenceError as failed:
                notes.append(f"{name} has no profile: {failed}")
    except KeyboardInterrupt:
        notes.append("interrupted: not all profiles are known")
    return profiles, list(dict.fromkeys(notes))


def _profiled_names(wanted: Task, spread: NDArray[np.float64]) -> list[str]:
    """Return the parameters that are profiled: what is asked for, or what correlates above 0.95."""
    if wanted.options.profile is not None:
        return list(wanted.options.profile)
    sizes = np.sqrt(np.diag(spread))
    known = np.isfinite(sizes) & (sizes > 0.0)
    table = np.eye(len(sizes))
    table[np.ix_(known, known)] = spread[np.ix_(known, known)] / np.outer(sizes[known], sizes[known])
    strong = np.abs(table - np.eye(len(sizes))) > _CORRELATED
    return [name for name, row in zip(wanted.names, strong, strict=True) if row.any()]


def _notes(wanted: Task, found: Minimum, objective: Objective) -> tuple[str, ...]:
    """Return in words what was found about the data, and what they do not tell."""
    measured, notes = wanted.measured, []
    if measured.dropped:
        notes.append(f"{measured.dropped} rows with missing numbers were left out")
    if measured.unused:
        notes.append(f"columns without a standard error are not fitted: {', '.join(measured.unused)}")
    for point, one in zip(measured.points, found.evaluation.special, strict=True):
        if one is None:
            what = f"jump on the way {point.direction}" if point.direction else point.type
            notes.append(f"the {what} at {point.value:.6g} has none in the model")
    notes += degeneracies(found.evaluation.jacobian, found.values, wanted.names)
    for i, name in enumerate(wanted.names):
        low, high = wanted.bounds[:, i]
        if min(found.values[i] - low, high - found.values[i]) <= 1e-6 * (high - low):
            notes.append(f"{name} is at its bound: its error does not mean much")
    if objective.failures:
        notes.append(f"{len(objective.failures)} steps were refused, as: {objective.failures[-1]}")
    return tuple(notes)


def _dataset(found: Evaluation) -> xr.Dataset:
    """Return the data with the model beside them."""
    import xarray as xr

    measured, (sheet, _, side) = found.measured, found.assigned
    count, rows = len(measured), measured.rows
    model = [_beside(one, found.seen[[measured.formulas.index(f) for f in one.formulas]]) for one in measured.channels]
    residual = found.residuals[: rows * count].reshape(rows, count).T
    each = ("datum", "channel")
    table = np.array([one.values for one in measured.channels], dtype=np.complex128).T
    shown = np.array(model, dtype=np.complex128).T
    points = measured.points
    return xr.Dataset(
        {
            "x": ("datum", measured.x),
            "side": ("datum", side),
            "sheet": ("datum", sheet),
            "direction": ("datum", np.array(measured.direction, dtype=object)),
            "residual": (("datum", "row"), residual),
            "measured": (each, table.real),
            "measured_im": (each, table.imag),
            "model": (each, shown.real),
            "model_im": (each, shown.imag),
            "sigma": (each, np.array([one.sigma for one in measured.channels]).T),
            "turn": ("channel", np.array([one.turn for one in measured.channels])),
            "special_value": ("special_datum", np.array([point.value for point in points], dtype=float)),
            "special_sigma": ("special_datum", np.array([point.sigma for point in points], dtype=float)),
            "special_residual": ("special_datum", found.residuals[rows * count :]),
            "special_type": ("special_datum", np.array([point.type for point in points], dtype=object)),
        },
        {"channel": [one.name for one in measured.channels]},
    )


def _beside(channel: Channel, seen: NDArray[np.float64]) -> NDArray[Any]:
    """Return an observable of the model; an angle in the turn of the data."""
    found = channel.model(seen)
    return found - channel.turn * np.round((found - channel.values) / channel.turn) if channel.turn else found
