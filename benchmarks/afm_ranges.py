"""Curves of random probes over ranges and parts of them: the same motions at the places that they have in common.

Two parts of each range are drawn. A motion is missed where one curve has a stable motion at a place and another, which
covers the place, has not; it is told where the other curve's `failures` are next to the place.
"""

from __future__ import annotations

import argparse
import random
import time
import warnings

import numpy as np
from measure import machine

from saltus import HybridSystem, afm
from saltus.errors import SaltusError

SAME = 1e-4  # difference of amplitudes, relative, up to which two motions are one
PLACES = 5  # at which curves are compared, in each part of a range


def main() -> None:
    """Print a table: probes, places compared, motions missed and told."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=np.inf, help="no probe begins after this time")
    given = parser.parse_args()
    print(machine(), f"seed {given.seed}", sep="\n")
    begin, draw = time.perf_counter(), random.Random(given.seed)
    probes = places = missed = told = 0
    for number in range(given.count):
        if time.perf_counter() - begin > given.seconds:
            break
        system = drawn(draw)
        along = draw.choice(("Zc_nm", "f_kHz"))
        ranges = drawn_ranges(system, along, draw)
        trace = afm.distance_curve if along == "Zc_nm" else afm.frequency_curve
        try:
            curves = [trace(system, bounds) for bounds in ranges]
        except SaltusError as error:
            print(f"{number}: {along} over {ranges}: {error}")
            continue
        probes += 1
        for place in np.concatenate([np.linspace(*part, PLACES + 2)[1:-1] for part in ranges[1:]]):
            compared, lost, words = compare(curves, float(place))
            places, missed, told = places + compared, missed + lost, told + words
            if lost:
                print(
                    f"{number}: {along} = {place:.6g}: {shown(curves, float(place))}; {system.parameters}", flush=True
                )
    seconds = time.perf_counter() - begin
    print(f"{probes} probes, {places} comparisons: {missed} motions missed, {told} of them told; {seconds:.0f} s")


def drawn(draw: random.Random) -> HybridSystem:
    """Return a model of a random probe over a random sample, one of four laws."""

    def between(low: float, high: float) -> float:
        return float(low * (high / low) ** draw.random())

    k = between(0.3, 60.0)
    probe = afm.Probe(k_N_m=k, f0_kHz=between(15.0, 400.0), Q=between(2.0, 600.0), R_nm=between(2.0, 40.0))
    attraction = afm.VanDerWaals(H_aJ=between(0.02, 0.3), a0_nm=draw.uniform(0.16, 0.4))
    contact = afm.DMT(E_GPa=between(0.1, 30.0))
    laws = (
        attraction + contact,
        attraction + contact + afm.Dashpot(c_uNs_m=between(0.1, 3.0)),
        attraction + contact + afm.KelvinVoigt(eta_Pa_s=between(1.0, 100.0)),
        afm.Hertz(E_GPa=between(0.1, 30.0)),
    )
    A0 = between(2.0, 40.0)
    return afm.model(probe, draw.choice(laws), afm.Drive(A0_nm=A0), Zc_nm=A0 * draw.uniform(0.3, 1.1))


def drawn_ranges(system: HybridSystem, along: str, draw: random.Random) -> list[tuple[float, float]]:
    """Return a range, and two parts of it."""
    p = system.parameters
    if along == "Zc_nm":
        low, high = draw.uniform(-0.5, 0.2) * p["A0_nm"], draw.uniform(1.2, 2.0) * p["A0_nm"]
    else:
        width = p["f0_kHz"] / p["Q"]
        low = max(p["f0_kHz"] - draw.uniform(1.0, 6.0) * width, 0.1 * p["f0_kHz"])
        high = p["f0_kHz"] + draw.uniform(1.0, 6.0) * width
    parts = [sorted(draw.uniform(low, high) for _ in range(2)) for _ in range(2)]
    return [(low, high), *((first, max(last, first + 0.1 * (high - low))) for first, last in parts)]


def amplitudes(curve: afm.Curve, place: float) -> list[float]:
    """Return the amplitudes of the stable motions at a place; orbits that repeat are one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [orbit for orbit in curve.at(place) if orbit.stable and orbit.admissible]
    return [afm.observables(orbit)["amplitude_nm"] for orbit in found]


def compare(curves: list[afm.Curve], place: float) -> tuple[int, int, int]:
    """Return how many curves are compared at a place, and how many motions they miss and tell."""
    inside = [curve for curve in curves if curve.bounds[0] <= place <= curve.bounds[1]]
    seen = []
    for curve in inside:
        try:
            seen.append(amplitudes(curve, place))
        except SaltusError:
            seen.append([])
    union = [value for values in seen for value in values]
    missed = told = 0
    for curve, values in zip(inside, seen, strict=True):
        lost = [one for one in union if not any(abs(one - value) <= SAME * abs(one) for value in values)]
        distinct = {round(np.log(one) / SAME / 4.0) for one in lost}
        missed += len(distinct)
        span = curve.bounds[1] - curve.bounds[0]
        told += len(distinct) * any(abs(where - place) <= span / 8.0 for where, _ in curve.failures)
    return len(inside) * (len(inside) > 1), missed, told


def shown(curves: list[afm.Curve], place: float) -> str:
    """Return what the curves that cover a place have there, in words."""
    parts = []
    for curve in curves:
        if curve.bounds[0] <= place <= curve.bounds[1]:
            try:
                values = ", ".join(f"{value:.5g}" for value in sorted(amplitudes(curve, place)))
            except SaltusError as error:
                values = str(error)
            parts.append(f"{curve.bounds[0]:.6g} to {curve.bounds[1]:.6g} has {values} nm")
    return "; ".join(parts)


if __name__ == "__main__":
    main()
