"""From a sample to readings: the operating points of two or three modes at their set points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.bimodal.approach import Approach, approached, from_contact, started
from saltus.afm.bimodal.averages import FINE
from saltus.afm.bimodal.balance import Balance, mode_of
from saltus.afm.bimodal.bimodal_map import BimodalMap
from saltus.afm.bimodal.operation import AM, FM
from saltus.afm.bimodal.reasons import Reasons
from saltus.afm.laws.law import Law
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import QUANTITIES, checked
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["bimodal", "checked_modes", "resolved", "spread"]

_NEWTON = 40  # steps of Newton's method, at most
_CONVERGED = 1e-11  # last step, relative
_RESOLVED = 1e-6  # change by finer nodes, relative, up to which a solution is told
_NOT_RESOLVED = "the means over the motion are not resolved: finer nodes change the values by more than 1e-6"
_QUANTITIES = dict.fromkeys(("amplitude_nm", "excitation_nm"), QUANTITIES["A0_nm"])
_REGIMES = ("repulsive", "attractive")


def bimodal(
    probe: Probe,
    law: Law,
    modes: Sequence[AM | FM],
    *,
    Zc_nm: ArrayLike | None = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    regime: str = "repulsive",
    check: bool = True,
) -> BimodalMap:
    """Return readings of two or three modes that are held at their set points over a sample, pixel by pixel.

    The tip moves by a cosine a mode, whose phases are independent. Forces are averaged over the phases. This is exact
    for frequencies without a whole ratio, up to terms of the order of 1/Q: higher harmonics and mixed tones are left
    out.

    Parameters
    ----------
    probe : Probe
        Two or three modes, and the tip's radius.
    law : Law
        The force: elastic in the gap, with losses in proportion to its rate. With two modes, contact may end at another
        gap than it begins, as of `JKR` and `Neck`. The turns of one mode then lead beyond both.
    modes : sequence of AM or FM
        How each mode of the probe is operated.
    Zc_nm : array_like, optional
        Distance, in nm. Left out where a set point of one mode holds the distance, which is then found.
    parameters : mapping of str to array_like, optional
        Maps of the law's parameters, as ``{"E_GPa": ...}``; all maps are broadcast together.
    regime : {"repulsive", "attractive"}, optional
        Whether the virial of the solution that is told is negative or positive. Of several, the first one on the way
        from afar is told, and their number.
    check : bool, optional
        Whether implausible values are refused.

    Returns
    -------
    BimodalMap
        Readings with derivatives along set points and the law's parameters; NaN and a reason where nothing is found.
        Whether a motion is stable is not told.

    Raises
    ------
    InputError
        An argument is of another kind, a value is not allowed or, with `check`, not plausible. The distance is set
        twice or not at all. The law has states of its own, or hysteresis with three modes.

    References
    ----------
    J. R. Lozano, R. Garcia, Phys. Rev. Lett. 100, 076102 (2008) and Phys. Rev. B 79, 014110 (2009): virial and energy
    of two modes. S. Kawai, T. Glatzel, S. Koch, B. Such, A. Baratoff, E. Meyer, Phys. Rev. Lett. 103, 220801 (2009):
    mean stiffness by the second mode. R. Garcia, R. Proksch, Eur. Polym. J. 49, 1897 (2013): AM-FM.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
    >>> law = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0)
    >>> seen = bimodal(probe, law, (afm.AM(A0_nm=30.0, setpoint_nm=25.0), afm.FM(A_nm=0.5)))
    >>> print(f"{seen['lag_deg']:.2f} degrees, {seen['shift_Hz_2']:.1f} Hz, {seen['indentation_nm']:.3f} nm")
    56.57 degrees, 748.8 Hz, 1.108 nm
    """
    checks.chosen("regime", regime, _REGIMES)
    checks.flag("check", check)
    with np.errstate(all="ignore"):  # formulas have poles beyond their domain, and what is not finite is left out
        return _operating(checked_modes(probe, law, modes), modes, Zc_nm, parameters, regime, check)


def _operating(
    balance: Balance,
    modes: Sequence[AM | FM],
    Zc_nm: ArrayLike | None,
    parameters: Mapping[str, ArrayLike] | None,
    regime: str,
    check: bool,
) -> BimodalMap:
    """Check the names and shapes, and solve."""
    given = dict(checks.mapping("parameters", parameters or {}, "names to arrays", known=balance.layers.names))
    setting = [type(mode).__name__ for mode in modes if mode.sets_distance]
    if len(setting) + (Zc_nm is not None) != 1:
        hint = "give Zc_nm, or a set point of one mode: AM(setpoint_nm=...) or FM(setpoint_Hz=...)"
        raise InputError("Zc_nm", Zc_nm, f"given or held by one mode, not by {len(setting)} modes", hint)
    if Zc_nm is not None:
        given["Zc_nm"] = Zc_nm
    maps, shape = spread(given, check)
    held = {f"{name}{end}": v for mode, end in zip(modes, balance.ends, strict=True) for name, v in mode.held.items()}
    q = balance.values({**{name: np.full(1, value) for name, value in held.items()}, **maps}, math.prod(shape))
    unknown = ["mean_gap_nm", *(name for name in ("Zc_nm", *balance.readings) if name not in {**held, **maps})]
    way = approached(balance, modes, q, maps.get("Zc_nm"))
    sign = 1.0 if regime == "attractive" else -1.0
    chosen, counts, others = _chosen(way, sign)
    rest = np.flatnonzero(counts == 0)
    own = maps["Zc_nm"][rest] if "Zc_nm" in maps else None
    beyond = from_contact(balance, modes, q[:, rest], own) if len(rest) else None
    if beyond is not None:
        chosen[:, rest], counts[rest], further = _chosen(beyond, sign)
        others[rest] += further
    for name, values in zip(("mean_gap_nm", *balance.amplitudes), chosen, strict=True):
        q[balance.at[name]] = values
    good = np.flatnonzero(counts > 0)
    reasons = Reasons(counts.size)
    # between the levels of a law with hysteresis, one turn must not depend on the one before
    which = "no motion that leaves the sample in each turn" if balance.layers.memories else "no motion"
    reasons.tell((counts == 0) & (others == 0), f"{which} meets the set points")
    other = _REGIMES[1 - _REGIMES.index(regime)]
    reasons.tell((counts == 0) & (others > 0), f"no {regime} motion meets the set points; {other} ones do")
    reasons.tell(counts > 1, f"several {regime} motions meet the set points; the first from afar is told")
    solved = started(balance, modes, q[:, good])
    solved, converged = _newton(balance, solved, unknown)
    reasons.tell(good[~converged], "Newton's method does not converge")
    fine = resolved(balance, solved, unknown)
    reasons.tell(good[converged & ~fine], _NOT_RESOLVED)
    q[:, good] = np.where(converged & fine, solved, math.nan)
    lost = ~np.isfinite(q[balance.at["mean_gap_nm"]])
    q[[balance.at[name] for name in unknown]] = np.where(lost, math.nan, q[[balance.at[name] for name in unknown]])
    return _made(balance, q, unknown, reasons, counts, shape)


def checked_modes(probe: Probe, law: Law, modes: Sequence[AM | FM]) -> Balance:
    """Return the balance of a probe with two or three modes, each of which is operated in one way."""
    checks.instance("probe", probe, Probe)
    checks.instance("law", law, Law)
    if probe.modes not in (2, 3):
        raise InputError("probe", probe.modes, "a probe with two or three modes", "Probe(k_N_m=(2, 80), ...)")
    listed = checks.listed("modes", modes, "AM(...) and FM(...)")
    if len(listed) != probe.modes:
        allowed = f"{probe.modes} of AM(...) and FM(...), one a mode of the probe"
        raise InputError("modes", len(listed), allowed)
    for number, mode in enumerate(listed, 1):
        checks.instance(f"modes[{number - 1}]", mode, AM | FM)
    return Balance(probe, law)


def spread(
    given: Mapping[str, ArrayLike], check: bool, errors: Mapping[str, ArrayLike] | None = None
) -> tuple[dict[str, NDArray[np.float64]], tuple[int, ...]]:
    """Return maps as rows of pixels, those of errors as ``sigma_...``, and the shape of all together.

    Where errors are given, none of them or more, an entry may be NaN.
    """
    arrays = {name: checks.array(name, value, finite=errors is None) for name, value in given.items()}
    for name, value in (errors or {}).items():
        arrays[f"sigma_{name}"] = error = checks.array(f"sigma_{name}", value)
        checks.refuse(f"sigma_{name}", error, error <= 0.0, "positive")
    try:
        shape = np.broadcast_shapes(*(value.shape for value in arrays.values()))
    except ValueError:
        shapes = {name: value.shape for name, value in arrays.items()}
        raise InputError("maps", shapes, "arrays that can be broadcast together") from None
    for name, value in arrays.items():
        if name.startswith(("amplitude_nm", "excitation_nm")):
            checks.refuse(name, value, value <= 0.0, "positive, in nm")
        if not value.size:
            raise InputError(name, value.shape, "one pixel or more")
        checks.refuse(name, value, np.isinf(value), "finite, or NaN where it is missing")
        known = value[np.isfinite(value)]
        for one in (float(known.min()), float(known.max())) if known.size else ():
            checked(name, one, plausible=check, quantity=_QUANTITIES.get(mode_of(name)[0]))
    return {name: np.broadcast_to(value, shape).ravel() for name, value in arrays.items()}, shape


def _chosen(way: Approach, sign: float) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Return gap and amplitudes where the condition is met first, and how many such places there are of each sign."""
    pixels = way.c.shape[1]
    chosen, counts = np.full((1 + way.A.shape[1], pixels), math.nan), np.zeros((2, pixels), dtype=np.int64)
    for i, lack in ((i, lack) for i in range(len(way.c) - 1) for lack in (way.lack, way.other_lack)):
        before, after = lack[i], lack[i + 1]
        meets = (before * after < 0.0) | ((after == 0.0) & (before != 0.0))
        share = np.where(meets, before / np.where(before == after, 1.0, before - after), 0.0)
        virial = (1.0 - share) * way.virial[i] + share * way.virial[i + 1]
        mine = meets & (np.where(virial == 0.0, sign, virial) * sign > 0.0)
        first = mine & (counts[0] == 0)
        for place, values in ((0, way.c), (slice(1, None), way.A)):
            chosen[place, first] = ((1.0 - share) * values[i] + share * values[i + 1])[..., first]
        counts[0] += mine
        counts[1] += meets & ~mine
    return chosen, counts[0], counts[1]


def _newton(
    balance: Balance, q: NDArray[np.float64], unknown: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Solve the equations; return the variables and where Newton's method has converged."""
    rows, q = [balance.at[name] for name in unknown], q.copy()
    active, done = np.arange(q.shape[1]), np.zeros(q.shape[1], dtype=bool)
    for _ in range(_NEWTON):
        own = q[:, active]
        steps = balance.steps(*balance.residuals(own, balance.means(own)), unknown)
        sizes = _sizes(balance, own, unknown)
        with np.errstate(invalid="ignore"):
            largest = np.max(np.abs(steps) / sizes, axis=0)
        damping = np.minimum(1.0, 0.3 / np.maximum(largest, 1e-300))
        own[rows] += steps * damping
        q[:, active] = own
        done[active] = largest < _CONVERGED
        active = active[np.isfinite(largest) & ~(largest < _CONVERGED)]
        if not len(active):
            break
    return q, done


def _sizes(balance: Balance, q: NDArray[np.float64], unknown: Sequence[str]) -> NDArray[np.float64]:
    """Sizes to which steps of the unknowns are compared, shape (unknown, pixel)."""
    at, sizes = balance.at, []
    whole = q[[at[name] for name in balance.amplitudes]].sum(0)
    for name in unknown:
        of, mode = mode_of(name)
        if of == "lag_deg":
            sizes.append(np.full(q.shape[1], 90.0))
        elif of == "shift_Hz":
            sizes.append(np.full(q.shape[1], 1e3 * balance.f0[mode]))
        elif name in ("mean_gap_nm", "Zc_nm"):
            sizes.append(whole)
        else:
            sizes.append(np.abs(q[at[name]]))
    return np.array(sizes)


def resolved(balance: Balance, q: NDArray[np.float64], unknown: Sequence[str]) -> NDArray[np.bool_]:
    """Whether finer nodes move a solution by less than the tolerance."""
    steps = balance.steps(*balance.residuals(q, balance.means(q, FINE)), unknown)
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(steps) < _RESOLVED * _sizes(balance, q, unknown)).all(0))


def _made(
    balance: Balance,
    q: NDArray[np.float64],
    unknown: Sequence[str],
    reasons: Reasons,
    counts: NDArray[np.int64],
    shape: tuple[int, ...],
) -> BimodalMap:
    """The result, with derivatives along all that was given."""
    columns = {name: q[i].reshape(shape) for i, name in enumerate(balance.names)}
    known = [name for name in balance.names if name not in unknown]
    good = np.isfinite(q).all(0)
    further: dict[str, NDArray[np.float64]] = {}
    slopes = np.full((len(unknown), len(known), q.shape[1]), math.nan)
    means = balance.unknown_means(q.shape[1])
    means[..., good] = balance.means(q[:, good])
    further = {name: value.reshape(shape) for name, value in balance.told(q, means).items()}
    _, jacobian = balance.residuals(q[:, good], means[..., good])
    own, other = (jacobian[:, [balance.at[name] for name in some]].transpose(2, 0, 1) for some in (unknown, known))
    slopes[..., good] = -np.linalg.solve(own, other).transpose(1, 2, 0)
    pairs = {(of, along): slopes[i, j].reshape(shape) for i, of in enumerate(unknown) for j, along in enumerate(known)}
    chi2 = np.where(good, 0.0, math.nan).reshape(shape)
    return BimodalMap(
        columns | further,
        tuple(unknown),
        {},
        pairs,
        counts.reshape(shape),
        chi2,
        0,
        reasons.status.reshape(shape),
        tuple(reasons.texts),
    )
