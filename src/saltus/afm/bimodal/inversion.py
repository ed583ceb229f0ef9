"""From readings of two or three modes to the sample's values, pixel by pixel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from saltus import checks
from saltus.afm.bimodal.approach import depths
from saltus.afm.bimodal.averages import FINE, ROUGH, STANDARD, Nodes
from saltus.afm.bimodal.balance import Balance, mode_of
from saltus.afm.bimodal.bimodal_map import BimodalMap
from saltus.afm.bimodal.operating_points import checked_modes, spread
from saltus.afm.bimodal.operation import AM, FM
from saltus.afm.bimodal.reasons import Reasons
from saltus.afm.bimodal.weighing import Weighing
from saltus.afm.laws.law import Law
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import quantity_of
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

__all__ = ["bimodal_map"]

_CANDIDATES = 3  # depths from which a pixel is solved, at most
_BESIDE = 2  # neighbours of the best depth between which others are looked at
_WITHIN = 1 / 3  # distance of these, over that of neighbours: two solutions may lie close by
_STEPS = 60  # steps of Levenberg and Marquardt, at most
_CONVERGED = 1e-7  # last step over its standard error and its size
_SAME = 1e-3  # relative difference up to which two solutions are one
_WORSE = 9.0  # chi2 above that of the best, up to which another solution agrees with the readings as well
_DOUBT = 1e-4  # probability of a larger chi2 below which readings and law disagree
_MISSED = 1e-2  # share of the drive that equations may lack where no errors are known
_RESOLVED = 1e-5  # relative change of a value by finer nodes
_START = 30.0  # factor by which a start may differ from the law's value
_RIDGE = 1e-10  # added to normal equations whose columns have length 1, for unknowns without influence
_ROUGH_STEPS = 15  # steps with few nodes, after which starts that have come together are one
_HOPELESS = 1e4  # chi2 above that of the best with which no start goes on
_DEGENERATE = 1e-9  # least singular value over the largest


def bimodal_map(
    readings: Mapping[str, ArrayLike],
    probe: Probe,
    law: Law,
    modes: Sequence[AM | FM],
    *,
    unknowns: Sequence[str] = ("E_GPa", "eta_Pa_s"),
    sigma: Mapping[str, ArrayLike] | None = None,
    check: bool = True,
) -> BimodalMap:
    """Return maps of the sample's values from maps of what two or three modes show.

    Each pixel has two equations a mode and one of the mean gap; `bimodal` says what they leave out. Mean gap and
    distance are unknown as well, as are readings that are missing. Depths from afar to four amplitudes are searched,
    so that no start is needed but the law's values. Each solution is checked by its equations with finer nodes.

    Parameters
    ----------
    readings : mapping of str to array_like
        Maps, which are broadcast together, NaN where a reading is missing: ``amplitude_nm``, ``lag_deg``, ``shift_Hz``,
        ``excitation_nm``, those of the second and third mode with ``_2`` and ``_3``, and ``Zc_nm`` where it is known.
        A reading takes the place of the set value that `modes` has.
    probe : Probe
        Two or three modes, and the tip's radius.
    law : Law
        The force, with first guesses of the unknowns and the values of all that is known.
    modes : sequence of AM or FM
        How each mode was operated, for what is held.
    unknowns : sequence of str, optional
        Parameters of the law that are sought.
    sigma : mapping of str to array_like, optional
        Standard errors of readings. Those not given are exact to 1e-5 of the drive. Without any, all equations weigh
        1 % of the drive, and no errors are returned.
    check : bool, optional
        Whether implausible readings are refused.

    Returns
    -------
    BimodalMap
        Values with standard errors, ``chi2``, and derivatives along readings and known values, which are those of the
        least squares where the equations are met. NaN and a reason where there is no solution. A reason beside a value
        tells of several solutions, of readings that disagree with the law, or of a negative loss.

    Raises
    ------
    InputError
        A name is not known, more is unknown than there are equations, or shapes differ. A value is not allowed or,
        with `check`, not plausible.

    References
    ----------
    A. Labuda, M. Kocun, W. Meinhold, D. Walters, R. Proksch, Beilstein J. Nanotechnol. 7, 970 (2016): Hertzian AM-FM
    with finite depth. S. Benaglia, V. G. Gisbert, A. P. Perrino, C. A. Amo, R. Garcia, Nat. Protoc. 13, 2890 (2018):
    modulus and viscosity by bimodal AM-FM.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
    >>> law, modes = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0), (afm.AM(A0_nm=30.0), afm.FM(A_nm=0.5))
    >>> sample, set_point = {"E_GPa": 2.0, "eta_Pa_s": 15.0}, afm.AM(A0_nm=30.0, setpoint_nm=25.0)
    >>> seen = afm.bimodal(probe, law, (set_point, modes[1]), parameters=sample)
    >>> readings = {name: seen[name] for name in ("amplitude_nm", "lag_deg", "shift_Hz_2", "excitation_nm_2")}
    >>> errors = {"lag_deg": 0.1, "shift_Hz_2": 2.0, "excitation_nm_2": 0.005}
    >>> found = bimodal_map(readings, probe, law, modes, sigma=errors)
    >>> print(f"{found['E_GPa']:.3f} +- {found.sigma['E_GPa']:.3f} GPa, chi2 {found.chi2:.2f}")
    2.000 +- 0.029 GPa, chi2 0.00
    """
    checks.flag("check", check)
    with np.errstate(all="ignore"):  # formulas have poles beyond their domain, and what is not finite is left out
        return _inverted(readings, checked_modes(probe, law, modes), modes, unknowns, sigma, check)


def _inverted(
    readings: Mapping[str, ArrayLike],
    balance: Balance,
    modes: Sequence[AM | FM],
    unknowns: Sequence[str],
    sigma: Mapping[str, ArrayLike] | None,
    check: bool,
) -> BimodalMap:
    """Check the names and shapes, and solve."""
    allowed = ("Zc_nm", *balance.readings)
    own = checks.mapping("readings", readings, "names to arrays", known=allowed)
    sought = checks.names("unknowns", unknowns, "parameters of the law", least=1)
    for name in sought:
        checks.chosen("unknowns", name, [one for one in balance.layers.names if one != "R_nm"])
    held = {f"{name}{end}": v for mode, end in zip(modes, balance.ends, strict=True) for name, v in mode.held.items()}
    given = {**held, **own}
    for name in balance.amplitudes:
        if name not in given:
            raise InputError("readings", sorted(own), f"with {name}", "the amplitude is neither held nor read")
    errors = dict(checks.mapping("sigma", sigma or {}, "names to arrays", known=allowed))
    if stray := [name for name in errors if name not in given]:
        raise InputError("sigma", stray, "errors of readings that are given or held")
    missing = [name for name in ("Zc_nm", *balance.readings) if name not in given]
    unknown = ["mean_gap_nm", *missing, *sought]
    freedom = balance.equations - len(unknown)
    if freedom < 0:
        hint = f"besides {', '.join(missing)}, which are not read"
        raise InputError(
            "unknowns", list(sought), f"at most {len(sought) + freedom}: there are {balance.equations} equations", hint
        )
    maps, shape = spread(given, check, errors)
    q = balance.values({name: maps[name] for name in given}, math.prod(shape))
    for name in missing:
        q[balance.at[name]] = _guess(balance, name, q)
    spreads = {name: maps["sigma_" + name] for name in errors}
    return _Inversion(balance, q, unknown, sought, spreads, freedom).solved(shape)


def _guess(balance: Balance, name: str, q: Floats) -> Floats:
    """Start of a reading that is missing."""
    if name.startswith("excitation_nm"):
        return np.asarray(q[balance.at[name.replace("excitation", "amplitude")]])
    return np.full(q.shape[1], 90.0 if name.startswith("lag_deg") else 0.0)


class _Inversion:
    """The solutions of all pixels."""

    def __init__(
        self,
        balance: Balance,
        q: Floats,
        unknown: Sequence[str],
        sought: Sequence[str],
        sigma: dict[str, Floats],
        freedom: int,
    ) -> None:
        self.balance, self.q, self.unknown, self.sought, self.freedom = balance, q, list(unknown), list(sought), freedom
        signs = {name: quantity_of(name) for name in sought}
        positive = {name for name, one in signs.items() if name == "E_GPa" or (one is not None and one.sign == "+")}
        self.weighing = Weighing(balance, unknown, sigma, {name for name in positive if q[balance.at[name], 0] > 0.0})
        self.sigma, self.pixels = sigma, q.shape[1]

    def starts(self) -> tuple[Floats, NDArray[np.intp]]:
        """Variables at depths where the equations are met best in their surroundings, and which pixel each is of."""
        q, at = self.q, self.balance.at
        amplitudes = q[[at[name] for name in self.balance.amplitudes]].sum(0)
        size = float(np.nanmax(amplitudes))
        places = depths(bool(self.balance.layers.levels), size, 4.0 * size)
        if self.balance.layers.above[0] is None:
            places = places[places > 0.0]
        chi2, states = self.along(np.repeat(places[:, None], self.pixels, axis=1))
        nearest = np.clip(np.argmin(chi2, axis=0), _BESIDE, len(places) - 1 - _BESIDE)
        between = nearest + np.arange(-_BESIDE, _BESIDE + _WITHIN / 2, _WITHIN)[:, None]
        picked = [
            self.best(chi2, states, _CANDIDATES),
            self.best(*self.along(np.interp(between, np.arange(len(places)), places)), _CANDIDATES),
        ]
        return np.concatenate([own for own, _ in picked], axis=1), np.concatenate([of for _, of in picked])

    def along(self, places: Floats) -> tuple[Floats, Floats]:
        """Return what is left of the equations at depths, shape (depth, pixel), and the unknowns there."""
        amplitudes = self.q[[self.balance.at[name] for name in self.balance.amplitudes]].sum(0)
        chi2, states = [], []
        for depth in places:
            own = self.q.copy()
            own[self.balance.at["mean_gap_nm"]] = self.balance.level(self.q) - depth + amplitudes
            for _ in range(2):
                own, left = self.at_depth(own, np.arange(self.pixels), ROUGH)
            chi2.append(left)
            states.append(own[self.weighing.rows])
        values = np.array(chi2)
        values[~np.isfinite(values)] = np.inf
        return values, np.array(states)

    def best(self, values: Floats, states: Floats, most: int) -> tuple[Floats, NDArray[np.intp]]:
        """Return the variables at the best depths that are better than their neighbours, and which pixel each is of."""
        around = np.pad(values, ((1, 1), (0, 0)), constant_values=np.inf)
        least = np.where((values <= around[:-2]) & (values <= around[2:]), values, np.inf)
        order = np.argsort(least, axis=0)[:most]
        picked, of = [], []
        for places in order:
            some = np.flatnonzero(np.isfinite(least[places, np.arange(self.pixels)]))
            own = self.q[:, some].copy()
            own[self.weighing.rows] = states[places[some], :, some].T
            picked.append(own)
            of.append(some)
        return np.concatenate(picked, axis=1), np.concatenate(of)

    def at_depth(self, q: Floats, of: NDArray[np.intp], nodes: Nodes) -> tuple[Floats, Floats]:
        """Solve for all unknowns but the mean gap, in which the equations are nearly linear; return what is left."""
        rest = list(range(1, len(self.unknown)))
        weighed = self.weighing.at(q, of, nodes)
        slopes = weighed.slopes[..., rest]
        sizes = np.linalg.norm(slopes, axis=1)
        sizes[~(sizes > 0.0)] = 1.0
        good = np.isfinite(slopes).all((1, 2)) & np.isfinite(weighed.residual).all(1)
        steps = np.zeros((len(of), len(rest)))
        scaled = slopes[good] / sizes[good][:, None]
        normal = scaled.transpose(0, 2, 1) @ scaled + _RIDGE * np.eye(len(rest))
        down = scaled.transpose(0, 2, 1) @ weighed.residual[good][..., None]
        steps[good] = -np.linalg.solve(normal, down)[..., 0] / sizes[good]
        left = np.sum((weighed.residual + (slopes @ steps[..., None])[..., 0]) ** 2, axis=1)
        out = q.copy()
        for i, place in enumerate(rest):
            row = self.weighing.rows[place]
            out[row] = q[row] + steps[:, i]
            if place in self.weighing.logarithmic:
                first = self.q[row, of]
                out[row] = np.clip(out[row], first / _START**3, first * _START**3)
        return out, np.where(good, left, np.nan)

    def refined(
        self, q: Floats, of: NDArray[np.intp], nodes: Nodes, most: int
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Levenberg's and Marquardt's method from the starts: variables, chi2, whether it has converged."""
        q, total = q.copy(), len(of)
        chi2, done = np.full(total, np.inf), np.zeros(total, dtype=bool)
        damping, active = np.full(total, 1e-3), np.arange(total)
        trial = q.copy()
        weighed = self.weighing.at(q, of, nodes)
        residual, slopes = weighed.residual.copy(), self.weighing.scaled(q, weighed.slopes)
        weights = weighed.weights.copy()
        chi2 = np.sum(residual**2, axis=1)
        for _ in range(most):
            sound = np.isfinite(chi2[active]) & np.isfinite(slopes[active]).all((1, 2))
            active = active[sound & ~done[active]]
            if not len(active):
                break
            J, r = slopes[active], residual[active]
            sizes = np.linalg.norm(J, axis=1)
            sizes[~(sizes > 0.0)] = 1.0
            scaled = J / sizes[:, None]
            matrix = scaled.transpose(0, 2, 1) @ scaled
            matrix[:, range(matrix.shape[1]), range(matrix.shape[1])] += damping[active][:, None] ** 2
            down = -(scaled.transpose(0, 2, 1) @ r[..., None])
            steps = np.linalg.solve(matrix, down)[..., 0] / sizes
            # equations that are nearly exact make curved valleys: all but the gap are solved for again
            trial, _ = self.at_depth(self.weighing.moved(q[:, active], steps.T), of[active], nodes)
            seen = self.weighing.at(trial, of[active], nodes)
            # the weights are those before the step: they are no part of what is made least
            new = np.sum((weights[active] @ seen.plain[..., None])[..., 0] ** 2, axis=1)
            with np.errstate(invalid="ignore"):
                better = new <= chi2[active] * (1.0 + 1e-9) + 1e-18
                small = np.abs(steps * sizes).max(1) < _CONVERGED * (1.0 + np.sqrt(chi2[active]))
            taken = active[better]
            q[:, taken] = trial[:, better]
            residual[taken], weights[taken] = seen.residual[better], seen.weights[better]
            chi2[taken] = np.sum(seen.residual[better] ** 2, axis=1)
            slopes[taken] = self.weighing.scaled(trial[:, better], seen.slopes[better])
            done[active[small & (better | (damping[active] < 1.0))]] = True
            damping[active] = np.where(
                better, np.maximum(damping[active] * 0.1, 1e-6), np.maximum(damping[active], 1e-6) * 10.0
            )
        return q, chi2, done

    def solved(self, shape: tuple[int, ...]) -> BimodalMap:
        """Return the best solution of each pixel, with its errors."""
        starts, of = self.starts()
        q, chi2, _ = self.refined(starts, of, ROUGH, _ROUGH_STEPS)
        kept = self.distinct(q, chi2, of)
        q, of = q[:, kept], of[kept]
        q, chi2, done = self.refined(q, of, STANDARD, _STEPS)
        best, count, fair = np.full(self.pixels, -1), np.zeros(self.pixels, dtype=np.int64), self.fair(q, chi2)
        for i in np.lexsort((chi2, of)):
            if not done[i]:
                continue
            pixel = of[i]
            if best[pixel] < 0:
                best[pixel], count[pixel] = i, 1
            elif fair[i] and chi2[i] < chi2[best[pixel]] + _WORSE and not self.same(q[:, i], q[:, best[pixel]]):
                count[pixel] += 1
        return self.told(q, chi2, (best, count, fair), shape)

    def distinct(self, q: Floats, chi2: Floats, of: NDArray[np.intp]) -> NDArray[np.intp]:
        """Starts with which to go on: no two with one solution, none far worse than the best of its pixel."""
        kept: list[int] = []
        best: dict[int, list[int]] = {}
        for i in np.lexsort((chi2, of)):
            others = best.setdefault(int(of[i]), [])
            hopeless = others and not chi2[i] < chi2[others[0]] + _HOPELESS
            if np.isfinite(chi2[i]) and not hopeless and not any(self.same(q[:, i], q[:, j]) for j in others):
                others.append(int(i))
                kept.append(int(i))
        return np.array(kept, dtype=np.intp)

    def fair(self, q: Floats, chi2: Floats) -> NDArray[np.bool_]:
        """Whether readings and law agree."""
        exact = 1e-6 if self.freedom == 0 else 1.0  # of equations that are met, or lack 1 % of a drive
        return np.asarray(chi2 <= (stats.chi2.isf(_DOUBT, self.freedom) if self.sigma and self.freedom else exact))

    def same(self, a: Floats, b: Floats) -> bool:
        """Whether two solutions have the same values."""
        rows = [self.balance.at[name] for name in self.sought]
        return bool(np.all(np.abs(a[rows] - b[rows]) <= _SAME * np.maximum(np.abs(a[rows]), np.abs(b[rows]))))

    def told(
        self,
        q: Floats,
        chi2: Floats,
        choice: tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.bool_]],
        shape: tuple[int, ...],
    ) -> BimodalMap:
        """The result: values, errors, derivatives, and what is to be told of each pixel."""
        best, count, fair = choice
        reasons, balance, weighing = Reasons(self.pixels), self.balance, self.weighing
        good = np.flatnonzero(best >= 0)
        own = q[:, best[good]]
        weighed = weighing.at(own, good)
        sizes = np.linalg.norm(weighed.slopes, axis=1)
        singular = np.linalg.svd(weighed.slopes / np.where(sizes > 0.0, sizes, 1.0)[:, None], compute_uv=False)
        clear = (singular[:, -1] > _DEGENERATE * singular[:, 0]) & (sizes > 0.0).all(1)
        exact = np.ones(len(good), dtype=bool) if self.freedom else fair[best[good]]
        fine = self.unmoved(own, good, weighed.slopes)
        reasons.tell(best < 0, "no values are found that meet the equations best")
        known = [balance.at[name] for name in balance.names if name not in self.unknown]
        reasons.tell(np.asarray(~np.isfinite(self.q[known]).all(0)), "a reading is missing")
        reasons.tell(
            good[~fine], "the means over the motion are not resolved: finer nodes change the values by more than 1e-5"
        )
        reasons.tell(good[~clear], "the readings do not determine all unknowns, as where the tip does not touch")
        reasons.tell(good[~exact], "no values of the unknowns meet the equations")
        felt = self.felt(own, weighed.weights)
        reasons.tell(good[~felt], "no force is felt: the readings are those of a free probe, within their errors")
        kept = fine & clear & exact & felt
        good, own, weighed = good[kept], own[:, kept], weighing.at(own[:, kept], good[kept])
        for name in self.sought:
            quantity = quantity_of(name)
            if quantity is not None and quantity.sign == "0+":
                reasons.tell(
                    good[own[balance.at[name]] < 0.0], f"{name} is negative: errors of the readings, or another law"
                )
        doubtful = ~fair[best[good]]
        what = f"chi2 has a probability below {_DOUBT:g}" if self.sigma else "equations lack more than 1 % of the drive"
        reasons.tell(good[doubtful], f"readings and law disagree: {what}")
        reasons.tell(
            good[count[good] > 1], "several solutions agree with the readings; that with the least chi2 is told"
        )
        whole = np.full_like(self.q, math.nan)
        whole[:, good] = own
        whole[known] = self.q[known]
        normal = np.linalg.inv(weighed.slopes.transpose(0, 2, 1) @ weighed.slopes)
        gains = -(normal @ weighed.slopes.transpose(0, 2, 1) @ weighed.readings)
        slopes = np.full((len(self.unknown), len(known), self.pixels), math.nan)
        slopes[..., good] = gains.transpose(1, 2, 0)
        means = balance.unknown_means(self.pixels)
        means[..., good] = balance.means(own)
        values = {name: whole[i] for name, i in balance.at.items()} | balance.told(whole, means)
        sigma = {}
        if self.sigma:
            for i, name in enumerate(self.unknown):
                sigma[name] = np.full(self.pixels, math.nan)
                sigma[name][good] = np.sqrt(normal[:, i, i])
        left = np.full(self.pixels, math.nan)
        left[good] = chi2[best[good]]
        return BimodalMap(
            {name: value.reshape(shape) for name, value in values.items()},
            tuple(self.unknown),
            {name: value.reshape(shape) for name, value in sigma.items()},
            {
                (of, along): slopes[i, j].reshape(shape)
                for i, of in enumerate(self.unknown)
                for j, along in enumerate(weighing.known)
            },
            np.where(np.isfinite(left), count, 0).reshape(shape),
            left.reshape(shape),
            self.freedom,
            reasons.status.reshape(shape),
            tuple(reasons.texts),
        )

    def felt(self, q: Floats, weights: Floats) -> NDArray[np.bool_]:
        """Whether the readings differ from those of a probe without a sample by more than their errors."""
        means = np.zeros_like(self.balance.unknown_means(q.shape[1]))
        lack, _ = self.balance.residuals(q, means)
        lack[-1] = 0.0
        free = np.sum((weights @ lack.T[..., None]) ** 2, axis=(1, 2))
        return np.asarray(free > (stats.chi2.isf(_DOUBT, len(lack) - 1) if self.sigma else 1.0))

    def unmoved(self, q: Floats, of: NDArray[np.intp], slopes: Floats) -> NDArray[np.bool_]:
        """Whether finer nodes move the unknowns by less than the tolerance."""
        finer = self.weighing.at(q, of, FINE)
        rough = self.weighing.at(q, of, STANDARD)
        steps = (np.linalg.pinv(slopes) @ (finer.residual - rough.residual)[..., None])[..., 0]
        sizes = np.abs(q[self.weighing.rows].T) + 1e-3 * np.abs(q[self.balance.at["amplitude_nm"]])[:, None]
        for i, name in enumerate(self.unknown):
            if name.startswith("shift_Hz"):
                sizes[:, i] += 1e3 * self.balance.f0[mode_of(name)[1]]
        return np.asarray((np.abs(steps) <= _RESOLVED * sizes).all(1))
