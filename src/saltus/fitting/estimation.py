"""Fits of models to measured data, with exact derivatives."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus import checks
from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.continuation.many.retracing import Retraced
from saltus.errors import ConvergenceError, InputError
from saltus.fitting.beside import dataset_of
from saltus.fitting.instrument import Instrument
from saltus.fitting.jumps import read_points
from saltus.fitting.limits import Linear, limited
from saltus.fitting.measured import Measured, MeasuredPoint, read_measured
from saltus.fitting.optimum import Minimum, Objective, covariance, degeneracies, minimised
from saltus.fitting.own_places import at_own_places
from saltus.fitting.priors import NO_PRIORS, Priors, read_priors
from saltus.fitting.profiles import Profiles
from saltus.fitting.remedy import remedy_of
from saltus.fitting.repeated import contradictions
from saltus.fitting.rereading import Reading, reread
from saltus.fitting.result import Fit
from saltus.fitting.search import fits, searched
from saltus.progress import Reporter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.progress import Report

__all__ = ["FitOptions", "Sheeted", "fit", "fitted"]

_CORRELATED = 0.95  # size of a correlation from which a parameter is profiled
_MOST = 60  # evaluations of a search, at most
_REPEATED = 3  # times that profiles are computed, at most: a better fit that one finds makes them void
_REACH = 0.1  # how far behind a jump its fold may lie, over the range of the data, where nothing else is told
_NO_EFFECT = 1e-6  # change of a datum by a parameter over all its range, in standard errors, that is rounding


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
        Angles after which observables repeat; by default 2 pi of phases, 360 of phases in degrees, 0 of all others.
    start : mapping of str to float
        Where the search starts; by default at the branch's values.
    profile : sequence of str or None
        Parameters of which the profile likelihood is computed; None for those that correlate above 0.95.
    steps : StepControl or None
        Steps of the branches that are traced; by default those of the functions that trace them.
    max_evaluations : int
        Evaluations of the search, at most. Searches from further starts have as many together.
    reach : float or None
        How far behind a jump in the data its fold may lie; None for a tenth of the data's range, 0 for a jump at its
        fold. Noise makes a motion jump before its fold.

    Examples
    --------
    >>> from saltus.options import FitOptions
    >>> FitOptions(max_evaluations=30).max_evaluations
    30
    """

    observables: Mapping[str, str] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    profile: Sequence[str] | None = None
    steps: StepControl | None = None
    max_evaluations: int = _MOST
    reach: float | None = None


@dataclass(frozen=True)
class Task:
    """A fit that is to be made: data, the model's branches, parameters with starts and bounds."""

    measured: Measured
    trace: Retraced
    names: tuple[str, ...]
    start: NDArray[np.float64]
    bounds: NDArray[np.float64]
    options: FitOptions
    sought: bool  # whether jumps were looked for in the data
    priors: Priors = NO_PRIORS  # what is known of the parameters beforehand
    instrument: Instrument = field(default_factory=Instrument)  # unknowns of the measurement that are varied
    candidates: Instrument = field(default_factory=Instrument)  # all unknowns that the measurement may have
    others: tuple[Reading, ...] = ()  # other readings of the data, tried where they do not fit


def fit(
    data: object,
    branch: Branch | Sheeted,
    vary: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, Any],
    *,
    jumps: bool | Sequence[MeasuredPoint] = False,
    priors: Mapping[str, tuple[float, float]] | None = None,
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
    priors : mapping of str to (float, float), optional
        Values of varied parameters that are known beforehand, with standard errors. They count as data, but not in
        `Fit.chi2`.
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
    branches, (low, high) = _traced(branch)
    if branches[0].fixed is not None:
        hint = "this one goes along a quantity"
        raise InputError("branch", branches[0].parameter, "a branch along a parameter", hint)
    steps, along = options.steps, branches[0].parameter
    trace = Retraced(branches, lambda orbit, _: continue_orbit(orbit, along, (low, high), steps=steps))
    return fitted(task(data, trace, (low, high), vary, sigma, jumps, options, priors), progress)


@singledispatch
def _traced(curve: Any) -> tuple[tuple[Branch, ...], tuple[float, float]]:
    """Return the branches that data are fitted to, and the range over which they are traced."""
    branches = getattr(curve, "branches", None)
    if not isinstance(branches, tuple) or not branches or {type(one) for one in branches} != {Branch}:
        raise InputError("branch", type(curve).__name__, "a Branch of periodic orbits, or a curve of such branches")
    low, high = curve.bounds
    return branches, (float(low), float(high))


@_traced.register(Branch)
def _traced_alone(branch: Branch) -> tuple[tuple[Branch, ...], tuple[float, float]]:
    low, high = branch.options.get("bounds", (float(branch.values.min()), float(branch.values.max())))
    return (branch,), (float(low), float(high))


def task(
    data: object,
    trace: Retraced,
    bounds: tuple[float, float],
    vary: Mapping[str, tuple[float, float]],
    sigma: Mapping[str, Any],
    jumps: bool | Sequence[MeasuredPoint],
    options: FitOptions,
    priors: Mapping[str, tuple[float, float]] | None = None,
    instrument: Instrument | None = None,
    others: Sequence[Reading] = (),
) -> Task:
    """Return the task of a fit, its arguments checked."""
    candidates = Instrument() if instrument is None else instrument
    instrument = candidates.among(vary)
    branch = trace.branches[0]
    system, along = branch.system, branch.parameter
    measured = read_measured(data, along, system, sigma, options.observables, options.turns)
    names, start, limits = _varied(vary, branch, options.start, candidates)
    own = replace(instrument, values=dict(zip(names, start.tolist(), strict=True)))
    x = measured.x + own.moved_by
    outside = (x < bounds[0]) | (x > bounds[1])
    if outside.any():
        hint = f"trace the branch from {x.min():.9g} to {x.max():.9g}"
        told = f"{int(outside.sum())} of {len(measured)} data outside"
        raise InputError(along, told, f"data between {bounds[0]:.9g} and {bounds[1]:.9g}, where the branch is", hint)
    if instrument.drift:
        measured.check_times()
    reach = _REACH * float(np.ptp(x)) if options.reach is None else checks.non_negative("reach", options.reach)
    inside = bounds[0] - own.moved_by, bounds[1] - own.moved_by
    measured = measured.with_points(read_points(jumps, measured, inside, reach))
    checks.count("max_evaluations", options.max_evaluations, 1)
    known = read_priors(priors, names)
    if measured.count + len(known.places) < len(names):
        raise InputError("data", f"{measured.count} numbers", f"at least {len(names)}, one for each varied parameter")
    if options.profile is not None:
        for name in checks.names("profile", options.profile, "varied parameters"):
            checks.chosen("profile", name, names)
    sought = jumps is True
    return Task(measured, trace, names, start, limits, options, sought, known, instrument, candidates, tuple(others))


def _varied(
    vary: object, branch: Branch, starts: Mapping[str, float], instrument: Instrument
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
    """Return names, starts and bounds of the varied parameters."""
    known = [name for name in branch.system.parameter_names if name != branch.parameter] + list(instrument.names)
    wanted = checks.mapping("vary", vary, "bounds by parameter, as {'c': (0.01, 1.0)}", known=known)
    if not wanted:
        raise InputError("vary", vary, "at least one parameter with its bounds")
    checks.mapping("start", starts, "values by parameter", known=wanted)
    bounds = np.array([checks.interval(f"vary[{name!r}]", limits, finite=True) for name, limits in wanted.items()]).T
    given = {name: checks.number(f"start[{name!r}]", value) for name, value in starts.items()}
    ours = {**branch.parameters, **{name: instrument.value(name) for name in instrument.names}}
    start = np.array([given.get(name, ours[name]) for name in wanted])
    for i, name in enumerate(wanted):
        low, high = bounds[:, i]
        if not low <= start[i] <= high:
            hint = f"the bounds exclude the start; choose others, or start={{{name!r}: ...}}"
            raise InputError(f"start of {name}", float(start[i]), f"between {low:.9g} and {high:.9g}", hint)
    return tuple(wanted), start, bounds


def fitted(wanted: Task, progress: bool | Report) -> Fit:
    """Return the fit that a task asks for; warn where the data or what was known beforehand do not fit."""
    names, bounds = wanted.names, wanted.bounds
    with Reporter(progress) as reporter:
        objective = Objective(
            wanted.measured, wanted.trace, names, reporter, wanted.priors, instrument=wanted.instrument
        )
        _begin(objective, wanted)
        most = wanted.options.max_evaluations
        lenient = searched(objective, wanted.start, bounds, most)
        found = at_own_places(objective, lenient, bounds, most)
        if found is not lenient and fits(lenient) and not (found.is_interrupted or fits(found)):
            found = searched(objective, found.values, bounds, most)
        refused = len(objective.failures)
        for _ in range(_REPEATED):
            spread = covariance(found.evaluation.jacobian, found.evaluation.residuals)
            profiles = Profiles(objective, found, spread, bounds)
            if not found.is_interrupted:
                profiles.compute(_profiled_names(wanted, spread))
            del objective.failures[refused:]
            if profiles.better is None:
                break
            found = minimised(objective, profiles.better.values, bounds, most=most)
    limits, intervals = limited(Linear(found.evaluation, found.values, bounds, spread))
    fit = Fit(
        system=wanted.trace.branches[0].system,
        along=wanted.measured.along,
        names=names,
        values=found.values,
        start=wanted.start,
        bounds=bounds,
        covariance=spread,
        branches=found.evaluation.branches,
        formulas={one.name: one.formulas for one in wanted.measured.channels},
        data=dataset_of(found.evaluation),
        evaluations=objective.evaluations,
        stopped=found.stopped,
        profiles=profiles.intervals,
        limits=limits,
        limited=intervals | {name: profiles.intervals[name] for name in limits if name in profiles.intervals},
        instrument=found.evaluation.instrument,
        notes=(*_notes(wanted, found, objective), *profiles.notes),
    )
    if fit.misfit and not found.is_interrupted:
        told = [reread(objective, found, wanted.start, bounds, wanted.others)]
        if not told[0] or found is not lenient:  # the lenient comparison has no walls: linear estimates reach farther
            told.append(remedy_of(lenient.evaluation, lenient.values, bounds, wanted.candidates))
        fit = replace(fit, remedy="; ".join([*contradictions(found.evaluation), *filter(None, told)]))
        warnings.warn(f"saltus: {fit.message}", RuntimeWarning, stacklevel=3)
    for one in wanted.priors.contradicted(found.values, names):
        warnings.warn(f"saltus: {one}", RuntimeWarning, stacklevel=3)
    return fit


def _begin(objective: Objective, wanted: Task) -> None:
    """Compare the model with the data at the start.

    Raises
    ------
    InputError
        The model has no stable motions where data are; a parameter on which no datum depends.
    """
    try:
        first = objective.at(wanted.start)
    except ConvergenceError as error:
        hint = f"{error}; start elsewhere, or leave out data there"
        given = dict(zip(wanted.names, wanted.start.tolist(), strict=True))
        raise InputError("start", given, "values at which the model has what the data need", hint) from error
    reach = np.abs(first.jacobian).max(axis=0) * np.ptp(wanted.bounds, axis=0)
    silent = [name for name, most in zip(wanted.names, reach.tolist(), strict=True) if not most > _NO_EFFECT]
    if silent:
        hint = "leave it out of `vary`, or start where a datum depends on it"
        raise InputError("vary", ", ".join(silent), "parameters on which a datum depends", hint)


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
        notes.append(f"{measured.dropped} rows with missing or infinite numbers were left out")
    if repeated := measured.repeated:
        notes.append(f"{repeated} rows repeat others, and count as measured again")
    notes += contradictions(found.evaluation)
    if wanted.sought and not measured.points:
        notes.append("jumps were sought, but the data show none")
    if measured.unused:
        notes.append(f"columns without a standard error are not fitted: {', '.join(measured.unused)}")
    for point, one in zip(measured.points, found.evaluation.special, strict=True):
        if one is None:
            what = f"jump on the way {point.direction}" if point.direction else point.type
            notes.append(f"the {what} at {point.value:.6g} has none in the model")
    notes += [
        f"the jump {point.direction} at {point.value:.6g} bounds its fold from one side: it lies there, or behind by"
        f" {point.reach:.3g} at most"
        for point in measured.points
        if point.reach
    ]
    notes += wanted.priors.contradicted(found.values, wanted.names)
    notes += degeneracies(found.evaluation.jacobian, found.values, wanted.names)
    for i, name in enumerate(wanted.names):
        low, high = wanted.bounds[:, i]
        if min(found.values[i] - low, high - found.values[i]) <= 1e-6 * (high - low):
            notes.append(f"{name} is at its bound: its error does not mean much")
    if objective.failures:
        notes.append(f"{len(objective.failures)} steps were refused, as: {objective.failures[-1]}")
    return tuple(notes)
