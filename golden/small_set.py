"""A result of each kind, small enough to be computed in every run of the tests.

PYTHONPATH=src:tests python golden/small_set.py ARCHIVE

writes the files of this version. `tests/test_golden.py` holds those of older versions against what is computed now.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import mutated
from saltus import (
    HybridSystem,
    Map,
    afm,
    continue_locus,
    continue_orbit,
    diagram,
    find_orbit,
    follow_cascade,
    optimise,
    solve_orbit,
)
from saltus.result import Result


@cache
def computed() -> dict[str, Result]:
    """Return the results by name."""
    return {**mutated.samples(), **_of_henon_s_map(), **_of_smooth_systems()}


def _of_henon_s_map() -> dict[str, Result]:
    henon = Map(("x", "y"), {"a": 0.2, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"}, name="Henon map")
    orbit = solve_orbit(henon, x0=[0.8, 0.2])
    branch = continue_orbit(orbit, "a", (0.1, 0.5))
    return {
        "map orbit": orbit,
        "map branch": branch,
        "map locus": continue_locus(branch["PD1"], ("a", "b"), {"a": (0.2, 0.5), "b": (0.2, 0.4)}),
        "map cascade": follow_cascade(branch["PD1"], (0.1, 1.1), doublings=2),
    }


def _of_smooth_systems() -> dict[str, Result]:
    pitchfork = HybridSystem.smooth({"x": "r*x - x**3"}, {"r": -0.5}, name="pitchfork")
    spring = HybridSystem.smooth(
        {"x": "v", "v": "-c*v - k*x + cos(s)"}, {"k": 1.2, "c": 0.3, "w": 1.0}, phase=("s", "w"), name="spring"
    )
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    model = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
    return {
        "diagram": diagram(pitchfork, "r", (-1.0, 1.0), x0=[0.0]),
        "optimum": optimise(find_orbit(spring, {}, [0.0, 0.0]), maximise="max(x)", vary={"w": (0.5, 1.5)}),
        "frequency shift": afm.frequency_shift(model, (13.0, 14.0), 10.0, points=3),
    }


def main() -> None:
    """Write the archive."""
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as archive:
        for name, result in computed().items():
            archive.write(result.save(Path(folder) / "a.nc"), f"{name}.nc")


if __name__ == "__main__":
    main()
