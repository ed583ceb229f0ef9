"""Fits of four parameters to noisy tuning curves: the same optimum from all starts, errors, times; and lmfit's.

`python benchmarks/bench_fit.py [SEEDS [STARTS]]`; by default 10 seeds and 3 starts.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from measure import machine

from saltus import FitOptions, afm

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


def measured(seed):
    """Readings on the ways up and down, with noise."""
    system, rng = model(TRUE), np.random.default_rng(seed)
    curve = afm.frequency_curve(system, (297.5, 302.5))
    jumps = {jump.direction: jump.value for jump in curve.jumps}
    table = {"f_kHz": [], "amplitude_nm": [], "lag_deg": [], "direction": []}
    for direction in ("up", "down"):
        for f in np.linspace(298.0, 302.0, POINTS):
            found = [afm.observables(orbit) for orbit in curve.at(f_kHz=f) if orbit.stable]
            found.sort(key=lambda one: one["lag_deg"])
            jumped = f > jumps["up"] if direction == "up" else f > jumps["down"]
            seen = found[-1] if jumped else found[0]
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


def main() -> None:
    """Print the table of benchmarks/README.md."""
    seeds, count = (int(text) for text in (sys.argv[1:] + ["10", "3"][len(sys.argv) - 1 :])[:2])
    print(machine())
    for seed in range(seeds):
        data = measured(seed)
        first = None
        for k, start in enumerate(list(starts())[:count]):
            begun = time.perf_counter()
            found = afm.fit(data, model(start), VARY, SIGMA, options=FitOptions(profile=()))
            took = time.perf_counter() - begun
            first = found if first is None else first
            errors = np.array([found.errors[name] for name in TRUE])
            true = np.array([TRUE[name] for name in TRUE])
            away = np.abs(found.values - true) / errors
            moved = np.abs(found.values / first.values - 1.0).max()
            chi2 = found.chi2_per_datum
            print(
                f"seed {seed} start {k}: {took:5.1f} s, {found.evaluations:2d} curves, chi2/n {chi2:.3f}, "
                f"largest error {away.max():.2f} sigma, other starts {moved:.1e}  {np.round(found.values, 5)}",
                flush=True,
            )
            if seed == 0:
                begun = time.perf_counter()
                peer = by_lmfit(data, start)
                told = [round(peer.params[name].value, 5) for name in TRUE]
                print(
                    f"    lmfit: {time.perf_counter() - begun:5.1f} s, {peer.nfev} evaluations, chi2/n "
                    f"{peer.chisqr / peer.ndata:.3f}  {told}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
