"""Distance curves of random probes, laws and drives: why each ends, and whether motions settle on its stable sheets.

    python benchmarks/random_probes.py [--count 200] [--seed 1] [--limit 20]

A line for each: the law, modes, seconds, orbits, jumps, the end of both ways, and motions that settle elsewhere.
"""

from __future__ import annotations

import argparse
import signal
import time
from collections import Counter

import numpy as np

import saltus
from saltus import afm

LAWS = {
    "vdW": lambda r: afm.VanDerWaals(H_aJ=r(0.01, 0.5), a0_nm=r(0.15, 0.5)),
    "DMT": lambda r: afm.VanDerWaals(H_aJ=r(0.01, 0.5), a0_nm=r(0.15, 0.5)) + afm.DMT(E_GPa=r(1e-3, 200.0)),
    "Hertz": lambda r: afm.Hertz(E_GPa=r(1e-3, 200.0)),
    "dashpot": lambda r: (
        afm.VanDerWaals(H_aJ=r(0.01, 0.5), a0_nm=r(0.15, 0.5))
        + afm.DMT(E_GPa=r(1e-3, 200.0))
        + afm.Dashpot(c_uNs_m=r(0.01, 10.0))
    ),
    "Kelvin-Voigt": lambda r: (
        afm.VanDerWaals(H_aJ=r(0.01, 0.5), a0_nm=r(0.15, 0.5))
        + afm.DMT(E_GPa=r(1e-3, 200.0))
        + afm.KelvinVoigt(eta_Pa_s=r(0.1, 1e3))
    ),
    "JKR": lambda r: afm.JKR(E_GPa=r(1e-3, 10.0), w_N_m=r(1e-3, 0.2)),
    "SLS": lambda r: afm.SLS(k1_N_m=r(0.1, 10.0), k2_N_m=r(0.1, 10.0), c_uNs_m=r(0.01, 10.0)),
    "neck": lambda r: (
        afm.VanDerWaals(H_aJ=r(0.01, 0.5), a0_nm=r(0.15, 0.5))
        + afm.DMT(E_GPa=r(1e-3, 200.0))
        + afm.Neck(gamma_N_m=r(0.01, 0.07), h_nm=r(0.3, 1.0), on_nm=0.6, off_nm=1.5)
    ),
    "Lennard-Jones": lambda r: afm.LennardJones(H_aJ=r(0.01, 0.5), sigma_nm=r(0.2, 0.5)),
    "hydration": lambda r: afm.Hydration(F_nN=r(0.1, 10.0), l_nm=r(0.2, 1.0)),
}


class TooLongError(Exception):
    """A curve took longer than the limit."""


def too_long(*_: object) -> None:
    """Raise from the alarm."""
    raise TooLongError


def told(reason: str) -> str:
    """Return a reason without its numbers."""
    return reason.split(": ", 1)[-1].split(";")[0][:70]


def main() -> None:
    """Run and print a table of ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=int, default=20)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)

    def between(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.random())

    ends: Counter[str] = Counter()
    signal.signal(signal.SIGALRM, too_long)
    for number in range(options.count):
        name = [*LAWS][number % len(LAWS)]
        modes = 2 if number // len(LAWS) % 4 == 3 else 1
        k, f0, Q, R = between(0.1, 100.0), between(5.0, 2000.0), between(1.5, 1000.0), between(1.0, 200.0)
        A0 = between(1.0, 100.0)
        ratios = (1.0, 6.267)[:modes]
        system = None
        try:
            probe = afm.Probe(
                k_N_m=[k * x**2 for x in ratios], f0_kHz=[f0 * x for x in ratios], Q=[Q * x for x in ratios], R_nm=R
            )
            law = LAWS[name](between)
            system = afm.model(probe, law, afm.Drive(A0_nm=A0), Zc_nm=A0)
            afm.distance_curve(system, (1.9 * A0, 2.0 * A0))  # compiled before the clock starts
            begun = time.perf_counter()
            signal.alarm(options.limit)
            curve = afm.distance_curve(system, (0.2 * A0, 1.5 * A0))
            ways = curve.ways
            signal.alarm(0)
            seconds = time.perf_counter() - begun
        except (TooLongError, SystemError):  # the alarm may come inside compiled code
            print(f"{number} {name} {modes}: longer than {options.limit} s", flush=True)
            ends["too long"] += 1
            continue
        except saltus.SaltusError as error:
            signal.alarm(0)
            print(f"{number} {name} {modes}: {type(error).__name__}: {error}", flush=True)
            ends[type(error).__name__] += 1
            continue
        elsewhere = []
        for share in rng.uniform(0.25, 1.4, 2):
            Zc = float(share * A0)
            try:
                sheets = [orbit for orbit in curve.at(Zc_nm=Zc) if orbit.stable]
                start = (sheets or [curve.branches[0].orbit(0)])[0].x0 * (1.0 + 0.05 * rng.standard_normal())
                settled = saltus.find_orbit(system, {"Zc_nm": Zc}, start)
            except saltus.SaltusError as error:
                elsewhere.append(told(str(error)))
                continue
            size = float(np.abs(settled.highs[0] - settled.lows[0])) or 1.0
            ends_of = [np.array([o.lows[0], o.highs[0]]) for o in (settled, *sheets)]
            if not any(np.abs(ends_of[0] - other).sum() < 1e-4 * size for other in ends_of[1:]):
                elsewhere.append(f"period {settled.form.turns} at {Zc:.4g}")
        for way in ways:
            ends[told(way.stopped)] += 1
        print(
            f"{number} {name} {modes}: {seconds:.2f} s, {len(curve)} orbits, {len(curve.jumps)} jumps; "
            f"{' | '.join(told(way.stopped) for way in ways)}; elsewhere: {elsewhere}",
            flush=True,
        )
    for reason, count in ends.most_common():
        print(f"{count:4d}  {reason}")


if __name__ == "__main__":
    main()
