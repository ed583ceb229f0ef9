"""Distance curves of random probes, laws and drives: why each ends, and whether sweeps settle on its stable sheets.

    python benchmarks/random_probes.py [--count 200] [--seed 1] [--limit 20] [--first 0]

A line for each: the law, modes, seconds, orbits, jumps, the end of both ways, and what the two sweeps found: settled
motions of period 1, those of them on no stable sheet, motions of another kind. A summary follows, one row an outcome.
"""

from __future__ import annotations

import argparse
import signal
import time
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import saltus
from saltus import afm
from saltus.afm.curves.curve import Curve
from saltus.afm.curves.routes import stays_in_contact

VALUES = 12  # distances of each sweep
SETTLES = 4.0  # periods that a sweep drops, over the largest quality factor
FEWEST = 200  # periods that a sweep drops, at the least
SAME = 1e-4  # distance of extremes, over the motion's size, up to which two motions are one

Draw = Callable[[float, float], float]


def hamaker(r: Draw) -> float:
    """Return a Hamaker constant in aJ: 0 in one of ten, negative in another."""
    share, size = r(1.0, 10.0), r(0.01, 0.5)
    return 0.0 if share < 1.26 else -size if share < 1.58 else size


def dmt(r: Draw) -> afm.Law:
    """Return van der Waals force and an elastic contact."""
    return afm.VanDerWaals(H_aJ=hamaker(r), a0_nm=r(0.15, 0.5)) + afm.DMT(E_GPa=r(1e-3, 200.0))


LAWS: dict[str, Callable[[Draw], afm.Law]] = {
    "van der Waals": lambda r: afm.VanDerWaals(H_aJ=hamaker(r), a0_nm=r(0.15, 0.5)),
    "DMT": dmt,
    "Hertz": lambda r: afm.Hertz(E_GPa=r(1e-3, 200.0)),
    "dashpot": lambda r: dmt(r) + afm.Dashpot(c_uNs_m=r(0.01, 10.0)),
    "Kelvin-Voigt": lambda r: dmt(r) + afm.KelvinVoigt(eta_Pa_s=r(0.1, 1e3)),
    "Kelvin-Voigt, raw": lambda r: dmt(r) + afm.KelvinVoigt(eta_Pa_s=r(0.1, 1e3), form="raw"),
    "SLS": lambda r: afm.SLS(k1_N_m=r(0.1, 10.0), k2_N_m=r(0.1, 10.0), c_uNs_m=r(0.01, 10.0)),
    "JKR": lambda r: afm.JKR(E_GPa=r(1e-3, 10.0), w_N_m=r(1e-3, 0.2)),
    "Schwarz": lambda r: afm.Schwarz(E_GPa=r(1e-3, 10.0), w1_N_m=r(1e-3, 0.1), w2_N_m=r(1e-3, 0.1), a0_nm=0.3),
    "neck": lambda r: dmt(r) + afm.Neck(gamma_N_m=r(0.01, 0.07), h_nm=r(0.3, 1.0), on_nm=0.6, off_nm=1.5),
    "Lennard-Jones": lambda r: afm.LennardJones(H_aJ=r(0.01, 0.5), sigma_nm=r(0.2, 0.5)),
    "hydration": lambda r: afm.Hydration(F_nN=r(0.1, 10.0), l_nm=r(0.2, 1.0)),
    "DLVO": lambda r: (
        afm.DLVO(tip_mC_m2=-r(5.0, 50.0), sample_mC_m2=-r(5.0, 50.0), debye_nm=r(0.5, 10.0), H_aJ=hamaker(r))
        + afm.DMT(E_GPa=r(1e-3, 200.0), a0_nm=r(0.15, 0.5))
    ),
    "Morse": lambda r: afm.Morse(U_aJ=r(0.1, 5.0), l_nm=r(0.05, 0.5), D0_nm=r(0.2, 0.5)),
}


class TooLongError(Exception):
    """A curve took longer than the limit."""


class Probe(NamedTuple):
    """A drawn model: its law, its modes, the free amplitude, the largest quality factor, and the system."""

    law: str
    modes: int
    A0: float
    Q: float
    drive: str
    system: saltus.HybridSystem


def too_long(*_: object) -> None:
    """Raise from the alarm."""
    raise TooLongError


def told(reason: str) -> str:
    """Return a reason without its numbers."""
    return reason.split(": ", 1)[-1].split(";")[0][:90]


def drawn(number: int, seed: int) -> Probe:
    """Return the model of a number; it does not depend on those before."""
    rng = np.random.default_rng([seed, number])

    def between(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.random())

    name = [*LAWS][number % len(LAWS)]
    modes = 2 if number // len(LAWS) % 4 == 3 else 1
    k, f0, Q, R = between(0.1, 100.0), between(5.0, 2000.0), between(1.5, 1000.0), between(1.0, 200.0)
    A0, ratios = between(1.0, 100.0), (1.0, 6.267)[:modes]
    probe = afm.Probe(
        k_N_m=[k * x**2 for x in ratios], f0_kHz=[f0 * x for x in ratios], Q=[Q * x for x in ratios], R_nm=R
    )
    kind, drive = rng.random(), afm.Drive(A0_nm=A0)
    if kind < 0.15:
        drive = afm.Drive.base(A0 / (1.566 * Q))
    elif kind < 0.3:
        drive = afm.Drive(A0_nm=A0, at="peak")
    words = "base" if kind < 0.15 else "peak" if kind < 0.3 else "force"
    return Probe(
        name, modes, A0, max(Q * x for x in ratios), words, afm.model(probe, LAWS[name](between), drive, Zc_nm=A0)
    )


def swept(one: Probe, curve: Curve) -> Counter[str]:
    """Return what a sweep up and a sweep down find, and how many of its motions are on no stable sheet."""
    options = saltus.options.SweepOptions(
        follow="both",
        discard=int(max(FEWEST, SETTLES * one.Q)),
        keep=4,
        observables=["min(z1_nm)", "max(z1_nm)"],
        workers=1,
    )
    found: Counter[str] = Counter()
    values = np.linspace(0.25, 1.4, VALUES) * one.A0
    sweep = saltus.run_sweep(one.system, "Zc_nm", values, options=options)
    for direction in sweep.directions:
        for value in values.tolist():
            motion = sweep.at(value, direction)
            if motion.label != "period-1":
                found[motion.label if motion.label != "diverged" else f"diverged ({motion.reason[:30]})"] += 1
                continue
            found["period-1"] += 1
            why = _missed(curve, value, motion)
            if why:
                found[why] += 1
    return found


def _missed(curve: Curve, value: float, motion: object) -> str:
    """Return why a settled motion of period 1 is on no stable sheet, or nothing."""
    try:
        sheets = [orbit for orbit in curve.at(value) if orbit.stable]
    except saltus.InputError:
        sheets = []
    except saltus.ConvergenceError:
        return "no orbit of the curve found"
    ends = np.array([[orbit.lows[0], orbit.highs[0]] for orbit in sheets]).reshape(-1, 2)
    wanted = np.array([*motion.observed.values()])
    if np.any(np.abs(ends - wanted).max(axis=1) <= SAME * np.abs(wanted).max()):
        return ""
    try:  # a sweep's motion may still be on its way
        settled = saltus.find_orbit(curve.system, motion.parameters, motion.state, mode=motion.mode)
    except saltus.SaltusError:
        return "settles on no orbit"
    if stays_in_contact(settled):
        return "stays in contact"
    wanted = np.array([settled.lows[0], settled.highs[0]])
    if np.any(np.abs(ends - wanted).max(axis=1) <= SAME * np.abs(wanted).max()):
        return ""
    print(f"    missed: period {settled.form.turns} at {value:.5g} nm, {wanted}, sheets {ends.tolist()}")
    return "MISSED"


def main() -> None:
    """Run and print a table of ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    outcomes: Counter[str] = Counter()
    motions: Counter[str] = Counter()
    curves_that_miss, slowest = 0, 0.0
    signal.signal(signal.SIGALRM, too_long)
    for number in range(options.first, options.first + options.count):
        one = drawn(number, options.seed)
        head = f"{number} {one.law}, {one.modes} modes, {one.drive}"
        begun = time.perf_counter()
        try:
            afm.distance_curve(one.system, (1.9 * one.A0, 2.0 * one.A0))  # compiled before the clock starts
            begun = time.perf_counter()
            signal.alarm(options.limit)
            curve = afm.distance_curve(one.system, (0.2 * one.A0, 1.5 * one.A0))
            ways = curve.ways
            signal.alarm(0)
        except (TooLongError, SystemError):  # the alarm may come inside compiled code
            print(f"{head}: longer than {options.limit} s", flush=True)
            outcomes[f"longer than {options.limit} s"] += 1
            continue
        except saltus.SaltusError as error:
            signal.alarm(0)
            print(f"{head}: {type(error).__name__}: {error}", flush=True)
            outcomes[type(error).__name__] += 1
            continue
        seconds = time.perf_counter() - begun
        slowest = max(slowest, seconds)
        found = swept(one, curve)
        motions.update(found)
        curves_that_miss += bool(found["MISSED"])
        for way in ways:
            outcomes[told(way.stopped)] += 1
        print(
            f"{head}: {seconds:.2f} s, {len(curve.branches)} sheets, {len(curve)} orbits, {len(curve.jumps)} jumps; "
            f"{' | '.join(told(way.stopped) for way in ways)}; sweeps {dict(found)}",
            flush=True,
        )
    print(f"\nslowest curve: {slowest:.1f} s\n\n| end of a way, or of a curve | count |\n|---|---|")
    for reason, count in outcomes.most_common():
        print(f"| {reason} | {count} |")
    print("\n| motions of the sweeps | count |\n|---|---|")
    for label, count in motions.most_common():
        print(f"| {label} | {count} |")
    print(f"| curves that miss a motion | {curves_that_miss} |")


if __name__ == "__main__":
    main()
