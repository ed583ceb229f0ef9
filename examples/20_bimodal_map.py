"""A bimodal map: modulus, viscosity and distance from noisy readings of two modes.

Field: Atomic force microscopy.

    python 20_bimodal_map.py [picture]
"""

import sys
from pathlib import Path

import numpy as np

from saltus import afm

probe = afm.Probe(k_N_m=(2.0, 80.0), f0_kHz=(70.0, 440.0), Q=(150.0, 450.0), R_nm=10.0)
law = afm.Hertz(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0)
modes = (afm.AM(A0_nm=30.0, setpoint_nm=25.0), afm.FM(A_nm=0.5))
E, eta = np.linspace(0.5, 3.0, 12)[:, None], np.linspace(5.0, 30.0, 12)
seen = afm.bimodal(probe, law, modes, parameters={"E_GPa": E, "eta_Pa_s": eta})

errors = {"amplitude_nm": 0.02, "lag_deg": 0.1, "shift_Hz_2": 2.0, "excitation_nm_2": 0.002}
random = np.random.default_rng(1)
noisy = {name: seen[name] + error * random.standard_normal(seen.shape) for name, error in errors.items()}
found = afm.bimodal_map(noisy, probe, law, modes, sigma=errors)
print(found)
picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "20_bimodal_map.png")
picture.parent.mkdir(parents=True, exist_ok=True)
found.plot(("E_GPa", "eta_Pa_s", "Zc_nm"))[0].figure.savefig(picture, dpi=90)
print("written", picture)
