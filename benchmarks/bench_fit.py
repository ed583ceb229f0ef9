"""Fits of four parameters to noisy tuning curves: the same optimum from all starts, coverage of errors, times; lmfit's.

`python benchmarks/bench_fit.py [--seeds 0 1 ...] [--peer 0 ...] [--coverage 100] [--first 0] [--eighty 0 ...]`. Without
options: seeds 0 to 9 from three starts each, lmfit on seeds 0 and 1, 100 data sets for the coverage, and 80 data.
Processor time stands beside wall time, since machines are shared.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from measure import machine

from saltus import afm
from saltus.options import FitOptions

TRUE = {"H_aJ": 0.12, "E_GPa": 1.5, "c_uNs_m": 2.0, "Zc_nm": 8.5}
FACTORS = ((1.35, 0.65, 1.4, 1.3), (0.65, 1.4, 0.6, 0.7), (1.4, 1.4, 1.4, 1.4))  # of the true values: 30 to 40 % off
VARY = {"H_aJ": (0.01, 1.0), "E_GPa": (0.05, 20.0), "c_uNs_m": (0.0, 20.0), "Zc_nm": (3.0, 14.0)}
SIGMA = {"amplitude_nm": 0.03, "lag_deg": 0.3}
POINTS = 81  # data on each way


def model(values):
    """Lever S over a sample with viscous losses."""
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=values["H_aJ"], a0_nm=0.3) + afm.DMT(E_GPa=values["E_GPa"])
    law = law + afm.Dashpot(c_uNs_m=values["c_uNs_m"])
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=values["Zc_nm"])


@cache
def exact():
    """Frequencies, ways and readings of the true model on the ways up and down."""
    curve = afm.frequency_curve(model(TRUE), (297.5, 302.5))
    jumps = {jump.direction: jump.value for jump in curve.jumps}
    rows = []
    for direction in ("up", "down"):
        for f in np.linspace(298.0, 302.0, POINTS):
            found = [afm.observables(orbit) for orbit in curve.at(f_kHz=f) if orbit.stable]
            found.sort(key=lambda one: one["lag_deg"])
            jumped = f > jumps["up"] if direction == "up" else f > jumps["down"]
            seen = found[-1] if jumped else found[0]
            rows.append((f, direction, {name: seen[name] for name in SIGMA}))
    return rows


def measured(seed):
    """Readings with noise."""
    rng = np.random.default_rng(seed)
    table = {"f_kHz": [], "amplitude_nm": [], "lag_deg": [], "direction": []}
    for f, direction, seen in exact():
        table["f_kHz"].append(f)
        table["direction"].append(direction)
        for name, sigma in SIGMA.items():
            table[name].append(seen[name] + sigma * rng.normal())
    return table


def starts():
    """Starting values, 30 to 40 % off."""
    for factors in FACTORS:
        yield {name: value * factor for (name, value), factor in zip(TRUE.items(), factors, strict=True)}


def by_lmfit(data, start):
    """lmfit with numerical derivatives on the same data: each datum to the nearest stable point of the traced curve."""
    import lmfit

    parameters = lmfit.Parameters()
    for name, (low, high) in VARY.items():
        parameters.add(name, start[name], min=low, max=high)
    system, f = model(start), np.array(data["f_kHz"])

    def residual(current):
        curve = afm.frequency_curve(system, (297.9, 302.1), parameters=current.valuesdict())
        found = []
        for branch in curve.branches:
            parts = np.split(np.arange(len(branch)), np.flatnonzero(np.diff(branch.stable.astype(int))) + 1)
            for part in (part for part in parts if branch.stable[part[0]] and len(part) > 1):
                order = part[np.argsort(branch.values[part])]
                columns = [branch.column(curve.formula(name))[order] for name in SIGMA]
                seen = [np.interp(f, branch.values[order], column) for column in columns]
                away = [(s - data[n]) / SIGMA[n] for s, n in zip(seen, SIGMA, strict=True)]
                away[1] = (away[1] + 180.0 / SIGMA["lag_deg"]) % (360.0 / SIGMA["lag_deg"]) - 180.0 / SIGMA["lag_deg"]
                found.append(np.array(away))
        table = np.array(found)
        best = np.argmin((table**2).sum(axis=1), axis=0)
        return table[best, :, np.arange(len(f))].ravel()

    return lmfit.minimize(residual, parameters, method="least_squares", loss="soft_l1", max_nfev=200)


def timed(work: Callable[[], Any]) -> tuple[Any, str]:
    """Return a result, and the processor and wall time that it took."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found, f"{time.process_time() - cpu:5.1f} s processor, {time.perf_counter() - wall:5.1f} s wall"


def away(found) -> np.ndarray:
    """Distances from the true values, in standard errors."""
    return np.array([(found[name] - true) / found.errors[name] for name, true in TRUE.items()])


def yardstick(seeds: list[int]) -> None:
    """Fit the data of some seeds from three starts each, profiles included."""
    for seed in seeds:
        data, first = measured(seed), None
        for k, start in enumerate(starts()):
            found, took = timed(lambda data=data, start=start: afm.fit(data, model(start), VARY, SIGMA))
            first = first or found
            moved = np.abs(found.values / first.values - 1.0).max()
            print(
                f"seed {seed} start {k}: {took}, {found.evaluations:2d} curves, chi2/n {found.chi2_per_datum:.3f}, "
                f"largest error {np.abs(away(found)).max():.2f} sigma, off start 0 by {moved:.1e}, "
                f"{len(found.profiles)} profiles, {found.message}  {np.round(found.values, 5)}",
                flush=True,
            )


def peer(seeds: list[int]) -> None:
    """The same by lmfit, without profiles."""
    for seed in seeds:
        data = measured(seed)
        for k, start in enumerate(starts()):
            found, took = timed(lambda data=data, start=start: attempted(data, start))
            print(f"lmfit: seed {seed} start {k}: {took}, {found}", flush=True)


def attempted(data, start) -> str:
    """Where lmfit ends, or the error that ends it."""
    try:
        found = by_lmfit(data, start)
    except Exception as error:  # what a peer stumbles over is a result
        return f"{type(error).__name__}: {error}"
    told = [round(found.params[name].value, 5) for name in TRUE]
    return f"{found.nfev} evaluations, chi2/n {found.chisqr / found.ndata:.3f}  {told}"


def coverage(count: int, first: int) -> None:
    """Count the data sets whose true values lie within one standard error, and within the profile of the modulus."""
    inside, of_profile, chi2 = np.zeros(len(TRUE)), 0, []
    start = model({name: 1.1 * value for name, value in TRUE.items()})
    for n in range(count):
        options = FitOptions(profile=("E_GPa",))
        found = afm.fit(measured(first + n), start, VARY, SIGMA, options=options)
        inside += np.abs(away(found)) < 1.0
        low, high = found.profiles.get("E_GPa", (np.nan, np.nan))
        of_profile += low < TRUE["E_GPa"] < high
        chi2.append(found.chi2_per_datum)
        shares = ", ".join(f"{name} {share:.0f}" for name, share in zip(TRUE, inside, strict=True))
        print(
            f"coverage, {n + 1} data sets: {shares}, profile of E_GPa {of_profile}, chi2/n {chi2[-1]:.3f}"
            f" ({min(chi2):.3f} to {max(chi2):.3f})  {np.round(away(found), 2)}",
            flush=True,
        )


def on_ways(along: str, bounds: tuple[float, float], places: np.ndarray) -> dict[str, list]:
    """Readings of the elastic model on both ways of a curve."""
    curve = (afm.distance_curve if along == "Zc_nm" else afm.frequency_curve)(elastic(TRUE), bounds)
    table: dict[str, list] = {along: [], "amplitude_nm": [], "lag_deg": [], "direction": []}
    for way in curve.directions:
        path = curve.path(way).sortby(along)
        for place in places:
            swept = np.interp(place, path[along], path.amplitude_nm)
            stable = [afm.observables(orbit) for orbit in curve.at(place) if orbit.stable]
            seen = min(stable, key=lambda one, swept=swept: abs(one["amplitude_nm"] - swept))
            row = {along: place, "direction": way} | {name: seen[name] for name in SIGMA}
            for name, column in table.items():
                column.append(row[name])
    return table


def elastic(values):
    """Lever S over a sample without losses."""
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=values["H_aJ"], a0_nm=0.3) + afm.DMT(E_GPa=values["E_GPa"])
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=TRUE["Zc_nm"])


def eighty(seeds: list[int]) -> None:
    """Fit two unknowns to 80 data of a distance curve and of a frequency curve, jumps included."""
    sigma, vary = {"amplitude_nm": 0.05, "lag_deg": 0.5}, {name: VARY[name] for name in ("H_aJ", "E_GPa")}
    start = elastic({"H_aJ": 0.7 * TRUE["H_aJ"], "E_GPa": 1.35 * TRUE["E_GPa"]})
    for along, bounds, low, high in (("Zc_nm", (5.0, 14.0), 6.0, 13.0), ("f_kHz", (297.5, 302.5), 298.0, 302.0)):
        clean = on_ways(along, bounds, np.linspace(low, high, 20))
        for seed in seeds:
            noise = np.random.default_rng(seed)
            data = clean | {name: np.array(clean[name]) + noise.normal(0.0, own, 40) for name, own in sigma.items()}
            found, took = timed(lambda data=data: afm.fit(data, start, vary, sigma))
            told = ", ".join(f"{name} {found[name]:.4f} +- {found.errors[name]:.4f}" for name in vary)
            curves, chi2 = found.evaluations, found.chi2_per_datum
            print(f"eighty, {along}, seed {seed}: {took}, {curves} curves, chi2/n {chi2:.3f}, {told}", flush=True)


def main() -> None:
    """Print the tables of benchmarks/README.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", help="data sets that are fitted from three starts")
    parser.add_argument("--peer", type=int, nargs="*", help="data sets that lmfit fits, too")
    parser.add_argument("--coverage", type=int, help="data sets for the coverage")
    parser.add_argument("--eighty", type=int, nargs="*", help="seeds of 80 data on a distance and a frequency curve")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first of them")
    given = parser.parse_args()
    warnings.simplefilter("always")
    print(machine())
    if all(one is None for one in (given.seeds, given.peer, given.coverage, given.eighty)):
        given.seeds, given.peer, given.coverage, given.eighty = list(range(10)), [0, 1], 100, [0, 1, 2]
    yardstick(given.seeds or [])
    peer(given.peer or [])
    coverage(given.coverage or 0, given.first)
    eighty(given.eighty or [])


if __name__ == "__main__":
    main()
