"""Distance curves and the region of bistability of one lever, warm: minimum and median."""

from __future__ import annotations

from measure import interleaved, machine, show

from saltus import afm

REPEATS = 7


def main() -> None:
    """Print the table of benchmarks/README.md."""
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    systems = {}
    for modes in (1, 2):
        probe = afm.Probe(
            k_N_m=(26.0, 1021.1)[:modes], f0_kHz=(300.0, 1880.1)[:modes], Q=(400.0, 1200.0)[:modes], R_nm=12.0
        )
        systems[modes] = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0)
    works = {
        "distance curve, one mode, all columns": lambda: afm.distance_curve(systems[1], (0.5, 14.0)).to_xarray(),
        "distance curve, two modes, all columns": lambda: afm.distance_curve(systems[2], (0.5, 14.0)).to_xarray(),
        "bistability": lambda: afm.bistability(systems[1], A0_nm=(1, 30), Zc_nm=(0.5, 30)),
    }
    print(machine())
    notes = dict(zip(works, ("target 0.3 s", "target 1.5 s", "target 3 s"), strict=True))
    show("A probe over a sample", interleaved(works, REPEATS), {}, notes)


if __name__ == "__main__":
    main()
