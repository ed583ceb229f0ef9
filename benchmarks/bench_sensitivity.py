"""Derivatives of an orbit of a probe over a sample by all parameters, warm: minimum and median."""

from __future__ import annotations

import numpy as np
from measure import interleaved, machine, show

import saltus
from saltus import afm

REPEATS = 50
NAMES = [
    "amplitude(z1_nm, 1)", "-degrees(phase(z1_nm, 1))", "min(D_nm)", "mean(force_nN)", "max(force_nN)", "min(force_nN)",
    "mean(deflection_nm)", "mean(sample_pW)", "mean(virial_aJ)", "fraction(contact)", "velocity(touch)",
    "amplitude(deflection_nm, 2)",
]  # fmt: skip


def main() -> None:
    """Print the table of benchmarks/README.md."""
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5) + afm.Dashpot(c_uNs_m=2.0)
    works, notes, peers = {}, {}, {}
    for modes, text, target in ((1, "one mode", "target 1 ms"), (2, "two modes", "target 4 ms")):
        probe = afm.Probe(
            k_N_m=(26.0, 1021.1)[:modes], f0_kHz=(300.0, 1880.1)[:modes], Q=(400.0, 1200.0)[:modes], R_nm=12.0
        )
        system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
        orbit = saltus.find_orbit(system, x0=np.zeros(2 * modes))
        count = len(system.parameter_names)
        name = f"12 readings by all {count} parameters, {text}"
        works[name] = lambda orbit=orbit: orbit.sensitivity(NAMES)
        notes[name] = target
        guess = [(one.mode, one.transition, one.state, one.duration) for one in orbit.segments]
        peer = f"the same readings of one orbit solved anew, {text}; differences take {4 * count}"
        works[peer] = lambda orbit=orbit, guess=guess: saltus.solve_orbit(
            orbit.system, {**orbit.parameters, "Zc_nm": 10.001}, guess
        ).observe(*NAMES)
    print(machine())
    show("Derivatives by parameters", interleaved(works, REPEATS), peers, notes)


if __name__ == "__main__":
    main()
