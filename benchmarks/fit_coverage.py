"""Coverage of fits: in how many of noisy sets the true values lie within one standard error of those fitted.

A standard error is right where this happens in 68.3 % of the sets. With 100 sets, 59 to 78 % agree with that by two
standard deviations. The root mean square of errors over standard errors tells more. It is 1, with a standard deviation
of 0.07.

    python benchmarks/fit_coverage.py [SETS [ALONG]]

ALONG is ``Zc_nm`` or ``f_kHz``; by default both are run, one after the other.
"""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np

from saltus import afm
from saltus.options import FitOptions

SIGMA = {"amplitude_nm": 0.1, "lag_deg": 1.0}
OFFSET_NM, GAIN, DRIFT_HZ = -0.2, 1.1, 40.0
VARY = {
    "Zc_nm": {"E_GPa": (0.2, 30.0), "Zc_offset_nm": (-1.0, 1.0), "gain": (0.5, 2.0)},
    "f_kHz": {"E_GPa": (0.2, 30.0), "f0_drift_Hz": (-300.0, 300.0)},
}
_TOLD = 10  # sets after which the coverage so far is told
TRUE = {"E_GPa": 3.0, "Zc_offset_nm": OFFSET_NM, "gain": GAIN, "f0_drift_Hz": DRIFT_HZ}


def lever(E_GPa=3.0, Zc_nm=8.5):
    """Return a lever of 26 N/m over a sample."""
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=E_GPa)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=Zc_nm)


def on_way(curve, way, value):
    """Return amplitude and lag of the motion on a way."""
    path = curve.path(way).sortby(curve.along)
    swept = np.interp(value, path[curve.along], path.amplitude_nm)
    stable = [afm.observables(orbit) for orbit in curve.at(value) if orbit.stable]
    seen = min(stable, key=lambda one: abs(one["amplitude_nm"] - swept))
    return seen["amplitude_nm"], seen["lag_deg"]


def clean(along):
    """Return data without noise along distance or frequency.

    With all frequencies higher by a factor an elastic sample sees the same motion faster. So a drift of f0 is a factor
    on the frequency, whatever the fit makes of it.
    """
    if along == "Zc_nm":
        curve, places = afm.distance_curve(lever(), (4.5, 14.0)), np.linspace(6.0, 13.0, 12)
        rows = [(z, *on_way(curve, way, z + OFFSET_NM), way) for way in curve.directions for z in places]
        return [(z, GAIN * amplitude, lag, way) for z, amplitude, lag, way in rows]
    curve = afm.frequency_curve(lever(), (298.5, 301.5))
    order = [("up", f) for f in np.linspace(298.7, 301.3, 14)] + [("down", f) for f in np.linspace(301.3, 298.7, 14)]
    share = np.linspace(0.0, 1.0, len(order))
    return [
        (f, *on_way(curve, way, f / (1.0 + 1e-3 * DRIFT_HZ * passed / 300.0)), way)
        for passed, (way, f) in zip(share, order, strict=True)
    ]


def _told(name, errors):
    """Return coverage and root mean square of errors, over standard errors."""
    return f"{name} {100.0 * np.mean(np.abs(errors) <= 1.0):.0f} %, rms {np.sqrt(np.mean(errors**2)):.2f}"


def main(sets=100, *only):
    """Print the coverage of each unknown, and how long a fit takes."""
    for along in only or VARY:
        vary = VARY[along]
        x, amplitude, lag, ways = map(list, zip(*clean(along), strict=True))
        errors, flagged, begun = {name: np.full(sets, np.nan) for name in vary}, 0, time.process_time()
        for seed in range(sets):
            noise = np.random.default_rng(seed)
            data = {
                along: x,
                "amplitude_nm": amplitude + noise.normal(0.0, SIGMA["amplitude_nm"], len(x)),
                "lag_deg": lag + noise.normal(0.0, SIGMA["lag_deg"], len(x)),
                "direction": ways,
            }
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RuntimeWarning)
                found = afm.fit(data, lever(2.5), vary, SIGMA, options=FitOptions(profile=()))
            flagged += bool(found.misfit)
            for name in vary:
                errors[name][seed] = (found[name] - TRUE[name]) / found.errors[name]
            if (seed + 1) % _TOLD == 0 or seed + 1 == sets:
                took = (time.process_time() - begun) / (seed + 1)
                told = ", ".join(_told(name, values[: seed + 1]) for name, values in errors.items())
                print(
                    f"{along}, {seed + 1} sets: {told}; flagged {flagged}; {len(x)} data,"
                    f" {took:.2f} s of a processor a fit",
                    flush=True,
                )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *sys.argv[2:])
