"""The force between tip and sample from a curve of amplitude and lag, or of the frequency shift."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.afm.models.modelling import frequency_of
from saltus.afm.probe.drive import Drive, Drives
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import NONE_INSISTS, checked
from saltus.afm.reconstruction.averages import averages, bent_gaps, cosines, grid_of
from saltus.afm.reconstruction.force import ReconstructedForce
from saltus.afm.reconstruction.formulas import FORMULAS, force_matrix
from saltus.afm.reconstruction.inflection import inflections
from saltus.afm.reconstruction.inversion import Estimate, inverted
from saltus.afm.reconstruction.observed import (
    LEAST,
    Observed,
    amplitude_modulation,
    errors_beside,
    frequency_modulation,
)
from saltus.afm.reconstruction.repeated_rows import contradictions
from saltus.errors import InputError
from saltus.fitting.measured import read_table
from saltus.linear_threads import one_thread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.afm.reconstruction.averages import Grid

__all__ = ["reconstruct_force"]

_KNOTS = 150  # gaps at which the force is told, at most
_LEAST_OF_HALF = 3  # gaps that every other datum must have
_ROUNDS = 3  # in which the motion of the lever under the force, and errors of amplitudes, come to rest
_NODES = 300  # angles of half a cycle at which the force is taken along a motion that is not harmonic
_FAR = 50.0  # times the greatest gap up to which formulas integrate
_SPARSE = 0.1  # difference of the force that every other datum tells, over the greatest one, that is told
_CUT = 0.04  # force at the last gap, over the greatest one, that is told
_MISSED = 0.2  # difference of the averages of the force from the data that is told
_BLURRED = 0.15  # error of the gaps, over the least length in which the force changes, that is told
_STEP = 0.5  # change of the force between neighbouring gaps, over the greatest force, that is told
_WIDER = 3.0  # distance of neighbouring gaps over those beside it, from which data are missing there
_UNLIKELY = 5.0  # standard deviations of chi2 above the number of data that are told
_GIVES = 0.9  # energy of the drive over the lever's loss below which it is told
_NO_FORCE = 3.0  # standard errors that the greatest force must have
_NOISY = 10.0  # standard errors below which the greatest force is told to be uncertain


class _Made(NamedTuple):
    """A force in the making."""

    gaps: NDArray[np.float64]
    force: NDArray[np.float64]
    sigma: NDArray[np.float64]
    centre: NDArray[np.float64]  # gap in the middle of the oscillation of the bent lever
    errors: NDArray[np.float64]  # of the reduced shifts
    blur: float  # error of the gaps, in nm
    chi2: float
    missed: float  # what is left of the reduced shifts, over their size


def reconstruct_force(
    data: object,
    probe: Probe,
    *,
    A_nm: float | None = None,
    drive: Drive | Drives | None = None,
    f_kHz: float | str = "f0",
    sigma: Mapping[str, Any] | None = None,
    method: str = "matrix",
) -> ReconstructedForce:
    """Return the force between tip and sample that a distance curve tells, without a law of force.

    Data of frequency modulation come with the amplitude `A_nm`, those of amplitude modulation with the `drive`. The tip
    is taken to swing harmonically. ``deflection_pm``, where it is among the data, bends the lever; else the mean of
    the force does.

    Parameters
    ----------
    data : pandas.DataFrame, xarray.Dataset or mapping of str to array
        ``Zc_nm`` with ``shift_Hz``, as `FrequencyShift.to_xarray` has them; or ``Zc_nm`` with ``amplitude_nm`` and
        ``lag_deg``, as `Curve.path` has them, or one way of what `read_curve` reads. Rows with gaps are left out.
    probe : Probe
        The cantilever.
    A_nm : float, optional
        The amplitude that is held, in nm.
    drive : Drive or sum of drives, optional
        The force that drives the tip. Of several, the first is meant: the others blur the force by their amplitudes.
    f_kHz : float or {"f0", "peak"}, optional
        Frequency of the drive, as `saltus.afm.model` takes it.
    sigma : mapping of str to float or array, optional
        Standard errors of columns, in their units. Without, one error of all shifts is estimated.
    method : {"matrix", "sader-jarvis", "katan", "hoelscher", "payam"}, optional
        ``"matrix"`` finds the smoothest force whose averages are the data, at any amplitudes, in any order of the
        gaps. The others are formulas in print. They hold for small and large amplitudes, or for large ones
        (``"hoelscher"``), and need distinct least gaps.

    Returns
    -------
    ReconstructedForce

    Raises
    ------
    InputError
        A value or a column is missing or not allowed. There are less than 8 data, or less than 8 least gaps. No force
        is clear of the noise. Two data have one least gap, and the method is a formula.

    Warns
    -----
    RuntimeWarning
        The data are sparse or noisy, or the inflection point test says that their amplitude makes the inversion
        ill-posed. `ReconstructedForce.messages` has the same.

    References
    ----------
    F. J. Giessibl, Appl. Phys. Lett. 78, 123 (2001): the inversion as a matrix. `saltus.afm.reconstruction.formulas`
    has the formulas, `saltus.afm.reconstruction.inflection` the test, both with their sources.

    Examples
    --------
    >>> import numpy as np
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2600.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> Zc = 10.0 + np.geomspace(1.0, 10.0, 40)
    >>> shift = -300e3 * 0.12 * 12.0 / (6.0 * 2600.0 * (Zc**2 - 10.0**2) ** 1.5)  # Hz; van der Waals
    >>> data = {"Zc_nm": Zc, "shift_Hz": shift, "deflection_pm": 0.0 * Zc}
    >>> force = afm.reconstruct_force(data, probe, A_nm=10.0)
    >>> print(f"{force.F_nN[0]:.4f} nN at {force.D_nm[0]:.3f} nm, by the law {-0.12 * 12.0 / 6.0:.4f} nN")
    -0.2400 nN at 1.000 nm, by the law -0.2400 nN
    """
    checks.instance("probe", probe, Probe)
    checks.chosen("method", method, ("matrix", *FORMULAS))
    table = read_table(data)
    if (A_nm is None) == (drive is None):
        hint = "A_nm for data of frequency modulation, drive for those of amplitude modulation"
        raise InputError("A_nm, drive", (A_nm, drive), "one of both", hint)
    if drive is None:
        if f_kHz != "f0":
            raise InputError("f_kHz", f_kHz, "not given with A_nm: shift_Hz counts from f0")
        observed = frequency_modulation(table, probe, checked("A_nm", A_nm, insists=NONE_INSISTS), sigma)
    else:
        first = checks.instance("drive", drive, Drive | Drives).parts[0]
        mode = first.mode - 1
        if mode >= probe.modes:
            raise InputError("mode", first.mode, f"a mode of the probe, up to {probe.modes}")
        f = frequency_of(f_kHz, list(probe.f0_kHz)[mode], list(probe.Q)[mode])  # type: ignore[arg-type]
        observed = amplitude_modulation(table, probe, first, checked("f_kHz", f, insists=NONE_INSISTS), sigma)
    with one_thread(len(observed.shift)):
        return _made(observed, probe, method, bool(sigma))


def _made(observed: Observed, probe: Probe, method: str, errors_given: bool) -> ReconstructedForce:
    made = _inverted(observed, method, errors_given, LEAST)
    half = _inverted(_every_other(observed), method, errors_given, _LEAST_OF_HALF)
    greatest = float(np.abs(made.force).max())
    both = np.interp(half.gaps, made.gaps, made.force)
    halved = float(np.abs(half.force - both).max()) / greatest
    signal = float(np.max(np.abs(made.force) / np.maximum(made.sigma, 1e-300)))
    if signal < _NO_FORCE:
        allowed = f"{_NO_FORCE:g} standard errors or more, for a force to be seen"
        raise InputError("greatest force over its error", float(f"{signal:.3g}"), allowed, "the data are too noisy")
    nearest = made.centre - observed.amplitude
    order = np.argsort(nearest)
    if made.missed > 1.0:
        told = float(f"{made.missed:.3g}")
        allowed = "below 1: the averages of this force are not the data"
        soft = "is the motion far from a cosine, as of a soft lever at a low Q? afm.fit of a law takes any motion"
        hint = soft if method == "matrix" else "method='matrix' takes data with gaps"
        raise InputError(f"what {method!r} leaves of the data", told, allowed, hint)
    tested = inflections(
        made.gaps,
        made.force,
        made.sigma,
        lambda gap: float(np.interp(gap, nearest[order], observed.amplitude[order])),
    )
    messages = _spoken(made, greatest, signal, halved, errors_given)
    if observed.given < _GIVES:
        less = f"the drive gives {observed.given:.2g} of what the lever loses"
        messages.append(f"{less}, and a sample gives none: A0_nm, Q or the phase are others")
    messages += [
        f"ill-posed: the force bends at D = {one.D_nm:.3g} nm with S = {one.S:.2g}, below -1; amplitudes from "
        f"{one.least_nm:.3g} to {one.most_nm:.3g} nm spoil it, and that of the data is {one.A_nm:.3g} nm"
        for one in tested
        if one.ill_posed
    ]
    for message in messages:
        warnings.warn(f"saltus: {message}", RuntimeWarning, stacklevel=4)
    messages += _left_out(made, greatest) + contradictions(observed, made.errors)
    return ReconstructedForce(
        made.gaps, made.force, made.sigma, method, probe.R_nm, observed.k, made.centre, observed.amplitude,
        observed.shift, made.errors, observed.changed, made.chi2, halved, tested, tuple(messages), errors_given,
    )  # fmt: skip


def _spoken(made: _Made, greatest: float, signal: float, halved: float, errors_given: bool) -> list[str]:
    """Return what speaks against a force, in words."""
    messages = []
    if halved > _SPARSE:
        messages.append(f"too few data: every other one tells a force that differs by {100.0 * halved:.2g} %")
    if signal < _NOISY:
        messages.append(f"noisy data: the greatest force is {signal:.2g} of its standard errors")
    if (cut := abs(made.force[-1]) / greatest) > _CUT:
        messages.append(f"data that end early: at the last gap the force is {100.0 * cut:.2g} %, its fall is assumed")
    steps, apart = np.abs(np.diff(made.force)), np.diff(made.gaps)
    length = greatest / float(np.max(steps / apart))
    if made.blur > _BLURRED * length:
        messages.append(f"blurred data: errors of gaps are {made.blur:.2g} nm, the force changes in {length:.2g} nm")
    count = len(made.errors)
    if errors_given and made.chi2 > count + _UNLIKELY * (2.0 * count) ** 0.5:
        messages.append(f"chi2 = {made.chi2:.4g} of {count} data: no smooth force has these data with such errors")
    if made.missed > _MISSED:
        messages.append(f"the averages of this force differ from the data by {100.0 * made.missed:.2g} %")
    return messages


def _left_out(made: _Made, greatest: float) -> list[str]:
    """Return in words where no datum comes as near, as where a motion jumps, though the force changes there."""
    steps, apart = np.abs(np.diff(made.force)), np.diff(made.gaps)
    beside = np.maximum(np.append(apart[1:], np.inf), np.append(np.inf, apart[:-1]))
    unseen = np.where(apart > _WIDER * beside, steps, 0.0)
    at = int(unseen.argmax())
    if unseen[at] <= _STEP * greatest:
        return []
    near, far = made.gaps[at], made.gaps[at + 1]
    told = f"none comes as near as D = {near:.3g} to {far:.3g} nm, where the force changes by {steps[at]:.3g} nN"
    return [f"a gap in the data: {told}; there it is taken to be smooth"]


def _inverted(observed: Observed, method: str, errors_given: bool, least: int) -> _Made:
    """Return the force, after some rounds in which the lever bends under it."""
    bent = observed.deflection
    centre = observed.centre + (0.0 if bent is None else bent)
    errors, wanted = None, observed.shift
    blur = float(np.median(np.sqrt(np.sum((observed.changed[:, 0] - observed.changed[:, 1]) ** 2, axis=0))))
    for _ in range(_ROUNDS + errors_given):  # errors of gaps are known from the second one on
        nearest = centre - observed.amplitude
        grid = grid_of(nearest, float((centre + observed.amplitude).max()), _KNOTS, blur)
        if len(grid.knots) < least:
            allowed = f"{least} or more, further apart than a thousandth of their range"
            raise InputError("different least gaps", len(grid.knots), allowed)
        mean, moment = averages(centre, observed.amplitude, grid)
        shifts = -moment / (observed.k * observed.amplitude[:, None])
        if method == "matrix":
            found = inverted(shifts, wanted, errors, grid)
        else:
            found = _by_formula(replace(observed, shift=wanted), method, nearest, grid, shifts, errors)
        along = found.along
        if bent is None:
            centre = observed.centre + observed.compliance * (mean @ along)
        wanted = observed.shift - _beyond_harmonic(observed, centre, grid, along)
        if errors_given:
            errors = _beside(observed, grid, along, centre)
    known = np.full(len(centre), found.noise) if errors is None else errors
    missed = float(np.linalg.norm(shifts @ along - observed.shift) / np.linalg.norm(observed.shift))
    return _Made(grid.knots, found.force, found.sigma, centre, known, blur, found.chi2, missed)


def _beyond_harmonic(
    observed: Observed, centre: NDArray[np.float64], grid: Grid, along: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return by how much the higher harmonics of the motion change the reduced shifts."""
    cosine = cosines(_NODES)[1]
    gaps = centre[:, None] + observed.amplitude[:, None] * cosine
    felt = np.interp(gaps, grid.places, along)
    bent = np.interp(bent_gaps(felt, centre, observed.amplitude, observed.k), grid.places, along)
    return np.asarray(-((bent - felt) * cosine).mean(axis=1) / (observed.k * observed.amplitude))


def _by_formula(
    observed: Observed,
    method: str,
    nearest: NDArray[np.float64],
    grid: Grid,
    shifts: NDArray[np.float64],
    errors: NDArray[np.float64] | None,
) -> Estimate:
    """Return the force by a formula in print."""
    order = np.argsort(nearest)
    ascending = nearest[order]
    if (same := np.flatnonzero(np.diff(ascending) <= 0.0)).size:
        hint = "method='matrix' takes them"
        raise InputError("least gap", float(ascending[same[0]]), "different in each row", hint)
    amplitude = observed.amplitude[order]
    last = float(amplitude[-1])
    whole = grid_of(ascending, ascending[-1] + _FAR * max(abs(ascending[-1]), last), len(ascending))
    whole = type(whole)(whole.knots, ascending[-1] + _FAR * last, lambda gap: (gap * (gap + 2.0 * last)) ** -1.5)
    matrix = force_matrix(method, observed.k, np.interp(whole.knots, ascending, amplitude), whole)
    shift = np.interp(whole.knots, ascending, observed.shift[order])
    force = matrix @ shift
    at = np.interp(grid.knots, whole.knots, force)
    along = grid.spread @ at
    left = shifts @ along - observed.shift
    known = np.full(len(left), inverted(shifts, observed.shift, None, grid).noise) if errors is None else errors
    variance = matrix**2 @ np.interp(whole.knots, ascending, known[order]) ** 2
    sigma = np.interp(grid.knots, whole.knots, np.sqrt(variance))
    return Estimate(along, at, sigma, float(known[0]), float(np.sum((left / known) ** 2)))


def _beside(
    observed: Observed, grid: Grid, along: NDArray[np.float64], centre: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the standard errors of the reduced shifts beside those of the force at places."""

    def shift(centre: NDArray[np.float64], amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
        found: NDArray[np.float64] = -averages(centre, amplitude, grid)[1] @ along / (observed.k * amplitude)
        return found

    return errors_beside(shift, centre, observed.amplitude, observed.shift, observed.changed)


def _every_other(observed: Observed) -> Observed:
    """Return every other datum."""
    return replace(
        observed,
        centre=observed.centre[::2],
        deflection=None if observed.deflection is None else observed.deflection[::2],
        amplitude=observed.amplitude[::2],
        shift=observed.shift[::2],
        changed=observed.changed[..., ::2],
        row=observed.row[::2],
    )
