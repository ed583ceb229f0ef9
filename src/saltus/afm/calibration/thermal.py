"""A thermal peak in a power spectral density: a harmonic oscillator with white noise, by maximum likelihood.

A bin of n averaged periodograms is the spectrum times a gamma variable of shape n and mean 1. Then the likelihood's
maximum does not depend on n: it is the minimum of the deviance ``2 sum(P/S - 1 - ln(P/S))``, and n only scales errors.
Least squares of the spectrum itself would be biased, as low bins get large weights. Neighbouring bins of a windowed
spectrum are alike, which widens errors: the correlation of the residuals tells by how much.

References
----------
S. F. Norrelykke, H. Flyvbjerg, Rev. Sci. Instrum. 81, 075103 (2010): maximum likelihood of averaged periodograms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from saltus.afm.probe.units import other_unit
from saltus.errors import ConvergenceError, InputError

__all__ = ["Peak", "fitted_peak", "oscillator"]

Real = NDArray[np.float64]

_LEAST_BINS = 20  # bins of a fit, at least
_FINE = 400  # bins of the survey for a peak, at most
_TOPS = 6  # highest bins, over their neighbours, that are tried as peaks beside a grid
_GRID = 80  # frequencies of the grid
_NEIGHBOURS = 25  # bins on each side whose median a bin is held against
_QUALITIES = np.geomspace(0.7, 1000.0, 8)  # quality factors that the survey tries
_SPAN = (0.4, 2.5)  # frequencies of the fit over the peak's, at most
_WIDTHS = 100.0  # half widths of the peak on each side of it that are fitted, at most
_CHANCE = 25.0  # gain of the likelihood by a peak, in units of chi2, that noise has in one of 10 000 spectra
_WILD = 1e-3  # bins above what the noise explains, in a spectrum of noise, on average
_ROUNDS = 3  # times that wild bins are left out
_NARROW = 2.0  # bins in the width of a peak, at least
_AT_EDGE = 1e-3  # distance of a peak to the end of the range, over the range, at least
_LOW = 0.02  # share of the bins below a low one
_PALE = 0.3  # white noise over such a low bin at a start, at least
_LOST = 1e-9  # white noise over the least of the spectrum below which there is none
_MOST = 60  # steps of a search, at most; 5 to 20 reach rounding where there is a peak
_REACH = 3  # bins over which residuals may be correlated
_GROUPS = (6, 24)  # groups of neighbouring bins that a fit is held against
_GROUP = 20  # bins in a group, at least
_MISFIT = 1e-4  # chance of a misfit that is told


@dataclass(frozen=True)
class Peak:
    """A peak, fitted."""

    values: Real  # shape (4,): f0 in kHz, Q, variance, white noise
    covariance: Real  # shape (4, 4): of the logarithms of the values; 0 for white noise that is nothing
    used: NDArray[np.bool_]  # shape (bin,): what was fitted
    wild: int  # bins left out, which the noise does not explain
    averages: float  # spectra that were averaged, told by the scatter or given
    scatter: float  # variance of the bins over that of so many averages
    gain: float  # gain of the likelihood by the peak, over a smooth spectrum, in units of chi2
    misfit: float  # chi2 of the means of groups of bins, over what noise has in one of 10 000 spectra; 0 with few bins


def oscillator(f: Real, values: Real) -> Real:
    """Return the one-sided spectrum of an oscillator and white noise.

    Parameters
    ----------
    f : ndarray, in kHz
        Frequencies.
    values : ndarray, shape (4,)
        Natural frequency in kHz, quality factor, variance, density of the white noise per Hz.

    Returns
    -------
    ndarray, per Hz

    Examples
    --------
    >>> f = np.linspace(0.0005, 5000.0, 5_000_001)
    >>> print(f"{oscillator(f, np.array([20.0, 3.0, 7.0, 0.0])).sum() * (f[1] - f[0]) * 1e3:.4f}")  # the variance
    7.0000
    """
    f0, Q, variance, white = values
    return np.asarray(white + variance * _line(f, f0, Q))


def _line(f: Real, f0: float, Q: float) -> Real:
    """Return the spectrum, per Hz, of an oscillator of variance 1."""
    return np.asarray(2e-3 / np.pi * f0**3 / Q / ((f * f - f0 * f0) ** 2 + (f * f0 / Q) ** 2))


def fitted_peak(f: Real, psd: Real, averages: float | None, span: tuple[float, float] | None) -> Peak:
    """Return the thermal peak of a spectrum.

    Parameters
    ----------
    f, psd : ndarray, shape (bin,)
        Frequencies in kHz, ascending, and densities per Hz.
    averages : float or None
        Periodograms that were averaged; by default what the scatter tells.
    span : tuple of (float, float) or None
        Range of frequencies in kHz; by default one around the highest peak.

    Raises
    ------
    InputError
        There are too few bins, or no peak that noise would not make.
    ConvergenceError
        No optimum is found.
    """
    inside = np.ones(len(f), dtype=bool) if span is None else (f >= span[0]) & (f <= span[1])
    _check_bins(f, inside, span)
    start = _surveyed(f[inside], psd[inside])
    if span is None:
        rough = _around(f, start)
        start = _best(f[rough], psd[rough], start)
        span = float(f[rough][0]), float(f[rough][-1])
        if _around(f, start).sum() >= _LEAST_BINS:
            inside = _around(f, start)
    used = inside.copy()
    for _ in range(_ROUNDS):
        values = _best(f[used], psd[used], start)
        ratio = psd / oscillator(f, values)
        shape = _shape_by_quartiles(ratio[used]) if averages is None else averages
        wild = inside & (ratio > _largest(shape, int(inside.sum())))
        if np.array_equal(used, inside & ~wild):
            break
        used, start = inside & ~wild, values
        _check_bins(f, used, span)
    values = _best(f[used], psd[used], start)
    ratio = (psd / oscillator(f, values))[used]
    scatter = float(np.mean((ratio - 1.0) ** 2)) * len(ratio) / (len(ratio) - 4)
    shape = 1.0 / scatter if averages is None else float(averages)
    alike = _correlation(ratio)
    gain = shape / alike * (_smooth_deviance(f[used], psd[used]) - _deviance(psd[used], oscillator(f[used], values)))
    _check_peak(f[used], values, gain)
    covariance = _covariance(f[used], values) * alike / shape
    return Peak(values, covariance, used, int((inside & ~used).sum()), shape, scatter * shape, gain, _misfit(ratio))


def _around(f: Real, values: Real) -> NDArray[np.bool_]:
    """Return which bins are about a peak: within so many of its widths, and of its frequency."""
    f0, Q = float(values[0]), float(values[1])
    reach = _WIDTHS * f0 / (2.0 * Q)
    return np.asarray((f >= max(_SPAN[0] * f0, f0 - reach)) & (f <= min(_SPAN[1] * f0, f0 + reach)))


def _check_bins(f: Real, used: NDArray[np.bool_], span: tuple[float, float] | None) -> None:
    if used.sum() < _LEAST_BINS:
        where = "" if span is None else f" between {span[0]:.6g} and {span[1]:.6g} kHz"
        hint = "measure more finely, or give a wider range_kHz"
        if span is not None:
            slip = other_unit("kHz", span, lambda ends: ((f >= ends[0]) & (f <= ends[1])).sum() >= _LEAST_BINS)
            hint = slip.removesuffix("; ") or hint
        raise InputError("spectrum", f"{int(used.sum())} bins{where}", f"at least {_LEAST_BINS} bins", hint)


def _check_peak(f: Real, values: Real, gain: float) -> None:
    """Raise `InputError` where what was fitted is no peak of a cantilever, with the number that says so."""
    least = _CHANCE + 2.0 * np.log(len(f))
    f0, Q = float(values[0]), float(values[1])
    if not gain > least:
        told = f"gain of chi2 {gain:.3g} by a peak at {f0:.5g} kHz"
        raise InputError("spectrum", told, f"one with a peak: a gain above {least:.3g}", "noise alone has as much")
    margin = _AT_EDGE * (f[-1] - f[0])
    if not f[0] + margin < f0 < f[-1] - margin:
        allowed = f"one with a peak within {f[0]:.5g} to {f[-1]:.5g} kHz"
        raise InputError("spectrum", f"f0 = {f0:.5g} kHz", allowed, "the range_kHz ends on its flank")
    width = f0 / Q / float(np.median(np.diff(f)))
    if width < _NARROW:
        allowed = f"one whose peak has a width of at least {_NARROW:g} bins"
        raise InputError("spectrum", f"width {width:.2g} bins at {f0:.5g} kHz", allowed, "a line, or too coarse bins")


def _surveyed(f: Real, psd: Real) -> Real:
    """Return a start: frequency and quality factor whose oscillator gains most over a power law, by steps of each."""
    rough, mean, count = _coarse(f, psd)
    tried = np.unique(np.concatenate([np.geomspace(f[0] * 1.05, f[-1] / 1.05, _GRID), _highest(f, psd)]))
    best, found = -np.inf, None
    for f0 in tried.tolist():
        near = (rough >= _SPAN[0] * f0) & (rough <= _SPAN[1] * f0)
        if near.sum() < _LEAST_BINS // 2:
            continue
        x, y, n = rough[near], mean[near], count[near]
        slope, level = np.polyfit(np.log(x), np.log(y), 1)
        flat = np.exp(level + slope * np.log(x))
        flat *= np.average(y / flat, weights=n)
        without = np.sum(n * (np.log(flat) + y / flat))
        for Q in _QUALITIES.tolist():
            if _around(f, np.array([f0, Q])).sum() < _LEAST_BINS:
                continue
            line = _line(x, f0, Q)
            variance, white = _amounts(line, y, n)
            spectrum = white + variance * line
            gain = without - np.sum(n * (np.log(spectrum) + y / spectrum))
            if gain > best:
                best, found = gain, (f0, Q, variance, white)
    if found is None:
        raise InputError("spectrum", f"{len(f)} bins", "bins on both sides of a peak", "give a wider range_kHz")
    return np.array(found)


def _coarse(f: Real, psd: Real) -> tuple[Real, Real, Real]:
    """Return means over neighbouring bins, in equal steps of the logarithm, and numbers of bins."""
    if len(f) <= _FINE:
        return f, psd, np.ones(len(f))
    edges = np.geomspace(f[0], f[-1] * (1.0 + 1e-12), _FINE + 1)
    place = np.searchsorted(edges, f, side="right")
    _, start, count = np.unique(place, return_index=True, return_counts=True)
    return np.add.reduceat(f, start) / count, np.add.reduceat(psd, start) / count, count.astype(float)


def _highest(f: Real, psd: Real) -> Real:
    """Return the frequencies of the bins that are highest over the median of their neighbours."""
    from scipy.ndimage import median_filter, uniform_filter1d

    over = np.log(uniform_filter1d(psd, 3) / median_filter(psd, 2 * _NEIGHBOURS + 1, mode="nearest"))
    return np.asarray(f[np.argsort(over)[-_TOPS:]])


def _amounts(line: Real, y: Real, n: Real) -> tuple[float, float]:
    """Return variance and white noise, both positive, by least squares of relative deviations, twice."""
    size = y
    variance, white = 0.0, float(np.average(y, weights=n))
    for _ in range(3):
        weights = n / size**2
        table = np.array([[weights @ line**2, weights @ line], [weights @ line, weights.sum()]])
        variance, white = np.linalg.solve(table, np.array([weights @ (line * y), weights @ y])).tolist()
        if white <= 0.0:
            variance, white = float((weights @ (line * y)) / (weights @ line**2)), 0.0
        if variance <= 0.0:
            variance, white = 0.0, float(np.average(y, weights=n))
        size = white + variance * line
    return max(variance, 1e-12 * float(y.max() / line.max())), max(white, 1e-6 * float(y.min()))


def _best(f: Real, psd: Real, start: Real) -> Real:
    """Return the four values of greatest likelihood, from a start and from other quality factors."""
    # White noise that an earlier search made nothing of has no slope any more, and would stay nothing.
    start = np.append(start[:3], max(start[3], _PALE * float(np.quantile(psd, _LOW))))
    tried = [start * np.array([1.0, factor, 1.0, 1.0]) for factor in (1.0, 3.0, 1.0 / 3.0)]
    found = [_minimised(psd, np.log(one), lambda logs: oscillator(f, np.exp(logs))) for one in tried]
    return np.exp(min(found, key=lambda one: one[1])[0])


def _minimised(psd: Real, start: Real, spectrum: Callable[[Real], Real]) -> tuple[Real, float]:
    """Return the parameters of least deviance, and the deviance; the residuals are its signed roots."""
    from scipy.optimize import least_squares

    def residuals(logs: Real) -> Real:
        ratio = psd / spectrum(logs)
        excess = ratio - 1.0
        logarithm = np.where(ratio > 0.5, np.log1p(np.maximum(excess, -0.5)), np.log(ratio))
        return np.asarray(np.sign(excess) * np.sqrt(np.maximum(2.0 * (excess - logarithm), 0.0)))

    low, high = start - 40.0, start + 40.0
    found = least_squares(
        residuals, start, bounds=(low, high), x_scale=0.1, xtol=1e-10, ftol=1e-12, gtol=1e-10, max_nfev=_MOST
    )
    if not np.all(np.isfinite(found.x)):
        raise ConvergenceError("thermal peak", np.inf, found.nfev)
    return found.x, _deviance(psd, spectrum(found.x))


def _deviance(psd: Real, spectrum: Real) -> float:
    """Return twice the negative logarithm of the likelihood of one average, but for a constant."""
    return float(2.0 * np.sum(np.log(spectrum) + psd / spectrum))


def _smooth_deviance(f: Real, psd: Real) -> float:
    """Return the least deviance of a spectrum without a peak: white noise and a power law."""
    x = np.log(f / f[0])
    level = np.log(np.mean(psd))
    starts = [np.array([level, level, exponent]) for exponent in (-1.0, 1.0)]
    return min(_minimised(psd, one, lambda v: np.exp(v[0]) + np.exp(v[1] + v[2] * x))[1] for one in starts)


def _covariance(f: Real, values: Real) -> Real:
    """Return the inverse of the information of one average, of the logarithms of the values."""
    spectrum = oscillator(f, values)
    kept = [0, 1, 2] if values[3] < _LOST * spectrum.min() else [0, 1, 2, 3]
    slopes = np.empty((len(f), len(kept)))
    for column, i in enumerate(kept):
        step = np.zeros(4)
        step[i] = 1e-6
        ends = [oscillator(f, values * np.exp(sign * step)) for sign in (1.0, -1.0)]
        slopes[:, column] = (ends[0] - ends[1]) / 2e-6 / spectrum
    found = np.zeros((4, 4))
    found[np.ix_(kept, kept)] = np.linalg.inv(slopes.T @ slopes)
    return found


def _shape_by_quartiles(ratio: Real) -> float:
    """Return the shape of a gamma distribution by the ratio of its quartiles, which wild bins leave alone."""
    from scipy.optimize import brentq
    from scipy.stats import gamma

    low, high = np.quantile(ratio, [0.25, 0.75])
    wanted = np.log(high / low)

    def excess(logarithm: float) -> float:
        ends = gamma.ppf([0.25, 0.75], np.exp(logarithm))
        return float(np.log(ends[1] / ends[0]) - wanted)

    ends = np.log(0.2), np.log(1e6)
    if excess(ends[0]) < 0.0 or excess(ends[1]) > 0.0:
        return float(np.exp(ends[0 if excess(ends[0]) < 0.0 else 1]))
    return float(np.exp(brentq(excess, *ends)))


def _largest(shape: float, count: int) -> float:
    """Return the ratio of a bin to the spectrum that `_WILD` bins of so many exceed, on average."""
    from scipy.stats import gamma

    return float(gamma.isf(_WILD / count, shape) / shape)


def _correlation(ratio: Real) -> float:
    """Return by how much the variance of sums over bins exceeds that of independent ones: 1 where they are."""
    excess = ratio - 1.0
    size = float(excess @ excess)
    lags = [float(excess[:-lag] @ excess[lag:]) / size for lag in range(1, _REACH + 1)]
    noise = 3.0 / np.sqrt(len(ratio))
    return 1.0 + 2.0 * sum(lag for lag in lags if lag > noise)


def _misfit(ratio: Real) -> float:
    """Return chi2 of the means of groups of neighbouring bins over the greatest that noise has; 0 with few bins."""
    from scipy.stats import chi2

    count = min(_GROUPS[1], len(ratio) // _GROUP)
    if count < _GROUPS[0]:
        return 0.0
    groups = np.array_split(ratio, count)
    within = np.concatenate([one - one.mean() for one in groups])
    variance = float(within @ within) / (len(ratio) - count) * _correlation(within + 1.0)
    found = sum(len(one) * float(one.mean() - 1.0) ** 2 for one in groups) / variance
    return found / float(chi2.isf(_MISFIT, count))
