"""Parameters of a law of force whose averages over each oscillation are those of data."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from saltus import checks
from saltus.afm.laws.law import Law, Sum
from saltus.afm.laws.prescribed import ForceTable
from saltus.afm.probe.units import checked
from saltus.afm.reconstruction.averages import bent_gaps, cosines
from saltus.afm.reconstruction.nearest_readings import NearestReadings
from saltus.errors import InputError
from saltus.fitting.search import largest_chi2

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Averages", "LawFit", "fitted_law"]

_NODES = 240  # angles of half a cycle at which the force is taken
_ROUNDS = 2  # in which the harmonics of the motion come to rest
_FALL = 1e-6  # fall of chi2, over itself, at which a search beside errors of gaps ends
_UNTOLD = 1e-9  # change of the data by unknowns, over the greatest one, that is none
_STEP = 1e-6  # of differences, over a value
_OF_GAP = "origin_nm"  # unknown: what is added to all gaps
_OF_TIP = "R_nm"  # unknown: radius of the tip


class Averages(NamedTuple):
    """The data that a fit needs."""

    k_N_m: float  # stiffness of the mode
    changed: NDArray[np.float64]  # by the error of each reading: centre, amplitude, shift; none where estimated
    centre_nm: NDArray[np.float64]  # gaps in the middle of the oscillation
    amplitude_nm: NDArray[np.float64]
    shift: NDArray[np.float64]  # reduced shifts
    shift_sigma: NDArray[np.float64]
    errors_given: bool  # whether these errors are known, and not estimated


@dataclass(frozen=True)
class LawFit:
    """A law of force with its best parameters; `ReconstructedForce.fit` makes it.

    Attributes
    ----------
    law : Law
        The law with these values.
    values, sigma : dict of str to float
        Best values of what was varied, and their standard errors. These are infinite where the data do not tell.
    correlation : ndarray, shape (unknown, unknown)
        Correlations of the errors.
    chi2 : float
        Sum of squares of what is left, over the errors of the data.
    count : int
        How many data count.
    at_bounds : tuple of str
        What was varied and ends at one of its bounds.
    misfit : str
        In words, that the data do not fit by known errors; empty where they do, and where errors are estimated.

    Examples
    --------
    >>> import numpy as np
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2600.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> Zc = 10.0 + np.geomspace(1.0, 10.0, 40)
    >>> shift = -300e3 * 0.12 * 12.0 / (6.0 * 2600.0 * (Zc**2 - 10.0**2) ** 1.5)
    >>> force = afm.reconstruct_force({"Zc_nm": Zc, "shift_Hz": shift, "deflection_pm": 0.0 * Zc}, probe, A_nm=10.0)
    >>> found = force.fit(afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3), {"H_aJ": (0.01, 1.0)})
    >>> round(found.values["H_aJ"], 5), found.count
    (0.12, 40)
    """

    law: Law
    values: dict[str, float]
    sigma: dict[str, float]
    correlation: NDArray[np.float64]
    chi2: float
    count: int
    at_bounds: tuple[str, ...]
    misfit: str = ""

    def __str__(self) -> str:
        lines = [f"{name} = {value:.6g} +- {self.sigma[name]:.2g}" for name, value in self.values.items()]
        lines += [f"{name} ends at a bound" for name in self.at_bounds]
        lines += [self.misfit] if self.misfit else []
        return "\n".join([*lines, f"chi2 = {self.chi2:.4g} of {self.count} data"])


def fitted_law(
    data: Averages,
    law: Law,
    vary: Mapping[str, tuple[float, float]],
    D_nm: tuple[float, float] | None,
    R_nm: float,
) -> LawFit:
    """Return the best values of a law; see `ReconstructedForce.fit`."""
    start, low, high = _unknowns(law, vary, R_nm)
    counts = np.ones(len(data.shift), dtype=bool)
    if D_nm is not None:
        least, most = checks.interval("D_nm", D_nm)
        nearest = data.centre_nm - data.amplitude_nm
        counts = (nearest >= least) & (nearest <= most)
    if np.count_nonzero(counts) <= len(start):
        raise InputError("D_nm", D_nm, f"a range with more than {len(start)} data", f"{counts.sum()} are within")
    centre, amplitude, measured = data.centre_nm[counts], data.amplitude_nm[counts], data.shift[counts]
    names = list(start)

    def shifts(
        x: NDArray[np.float64], centre: NDArray[np.float64], amplitude: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        values = dict(zip(names, x.tolist(), strict=True))
        radius, origin = values.pop(_OF_TIP, R_nm), values.pop(_OF_GAP, 0.0)
        moment = _moments(_with_values(law, values), centre + origin, amplitude, data.k_N_m, radius)
        return -moment / (data.k_N_m * amplitude)

    x0 = np.array(list(start.values()))
    scales = np.maximum(np.abs(x0), 1e-3 * (high - low))
    best = least_squares(
        lambda x: (shifts(x, centre, amplitude) - measured) / data.shift_sigma[counts],
        x0, bounds=(low, high), x_scale=scales, diff_step=_STEP,
    )  # fmt: skip
    if len(data.changed):
        near = NearestReadings(shifts, centre, amplitude, measured, data.changed[..., counts], scales)
        best = least_squares(near.residuals, best.x, near.jacobian, bounds=(low, high), x_scale=scales, ftol=_FALL)
        near.expect(best.x)
        best = least_squares(near.residuals, best.x, near.jacobian, bounds=(low, high), x_scale=scales, ftol=_FALL)
    chi2, covariance = 2.0 * float(best.cost), _covariance(best.jac, scales)
    if not data.errors_given:
        covariance *= chi2 / (len(measured) - len(x0))
    sigma = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        correlation = covariance / np.outer(sigma, sigma)
    values = dict(zip(names, map(float, best.x), strict=True))
    own = {name: value for name, value in values.items() if name not in (_OF_TIP, _OF_GAP)}
    misfit = _misfit(chi2, len(measured)) if data.errors_given else ""
    if misfit:
        warnings.warn(f"saltus: {misfit}", RuntimeWarning, stacklevel=3)
    return LawFit(
        _with_values(law, own),
        values,
        dict(zip(names, map(float, sigma), strict=True)),
        correlation,
        chi2,
        len(measured),
        tuple(name for name, active in zip(names, best.active_mask, strict=True) if active),
        misfit,
    )


def _misfit(chi2: float, count: int) -> str:
    """Return in words that data do not fit; empty where they do."""
    most = largest_chi2(count)
    told = (
        f"the data do not fit: chi2/n = {chi2 / count:.3g} is above {most:.3g}; the law, origin_nm or sigma is another"
    )
    return told if chi2 > most * count else ""


def _covariance(jacobian: NDArray[np.float64], scales: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance of unknowns: infinite variances of those that the data do not tell."""
    _, sizes, ways = np.linalg.svd(jacobian * scales, full_matrices=False)
    told = sizes > _UNTOLD * sizes.max()
    inverse = (ways[told].T / sizes[told] ** 2) @ ways[told]
    untold = np.flatnonzero(np.any(np.abs(ways[~told]) > _UNTOLD, axis=0))
    inverse[untold, untold] = math.inf
    return np.asarray(inverse * np.outer(scales, scales))


def _unknowns(
    law: Law, vary: Mapping[str, tuple[float, float]], R_nm: float
) -> tuple[dict[str, float], NDArray[np.float64], NDArray[np.float64]]:
    """Return the first values, least and greatest values of what is varied."""
    has = {_OF_TIP: R_nm, _OF_GAP: 0.0} | law.parameters
    asked = checks.mapping("vary", vary, "names to least and greatest values", known=has)
    if not asked:
        raise InputError("vary", vary, f"one or more of {', '.join(has)}")
    bounds = {name: checks.interval(f"vary[{name!r}]", ends, finite=True) for name, ends in asked.items()}
    for name, (low, high) in bounds.items():
        for end in (low, high):
            if name != _OF_GAP:
                checked(name, end, plausible=False)
        if not low < has[name] < high:
            raise InputError(
                name, has[name], f"between {low:g} and {high:g}, as vary has it", "the search starts there"
            )
    start = {name: has[name] for name in bounds}
    return start, np.array([one[0] for one in bounds.values()]), np.array([one[1] for one in bounds.values()])


def _with_values(law: Law, values: Mapping[str, float]) -> Law:
    """Return a law with other values of some parameters."""
    parts = []
    for part in law.parts:
        given = {one.name for one in fields(part) if getattr(part, one.name, None) is not None}
        parts.append(replace(part, check=False, **{name: v for name, v in values.items() if name in given}))
    return parts[0] if len(parts) == 1 else Sum(laws=tuple(parts))


def _moments(
    law: Law, centre: NDArray[np.float64], amplitude: NDArray[np.float64], k: float, R_nm: float
) -> NDArray[np.float64]:
    """Return the mean of force times ``cos`` of the angle over both halves of a cycle."""
    table = ForceTable(law.parts, R_nm)
    cosine = cosines(_NODES)[1]
    gaps = centre[:, None] + amplitude[:, None] * cosine
    for _ in range(_ROUNDS):
        gaps = bent_gaps(_force(table, gaps), centre, amplitude, k)
    return np.asarray((_force(table, gaps) * cosine).mean(axis=1))


def _force(table: ForceTable, gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of the forces on both ways."""
    inwards, rest = table.regions_on_approach(gaps), np.zeros(gaps.shape)
    force = table.force_in(gaps, rest, inwards)
    outwards = table.regions_on_retraction(gaps, inwards[:, -1:])
    return force if np.array_equal(inwards, outwards) else 0.5 * (force + table.force_in(gaps, rest, outwards))
