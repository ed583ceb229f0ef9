"""The amplitude loop of an atomic force microscope rings from a gain on.

A lock-in reads the amplitude, and an integrator moves the base, as in Kokavecz, Marti, Heszler and Mechler (Phys. Rev.
B 73 (2006) 155403). The loop holds the distance that the curve without a loop has at the set amplitude. Known answers:
in a period the drive's energy goes to the medium and the sample; and ringing, simulated from a small deviation, dies
away below the torus point and grows above it by the modulus of the multipliers.

Field: Atomic force microscopy.

    python afm_feedback.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus
from saltus import afm

probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
model = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)
loop = afm.feedback(model, 8.0, Ki_1_ms=0.5, tau_us=50.0)
held = saltus.find_orbit(loop, x0=[0.0, 0.0, 0.0, 0.0, 20.0])
gains = saltus.continue_orbit(held, "Ki_1_ms", (0.1, 12.0))
ringing = gains["TR1"]
locus = saltus.continue_locus(ringing, ("tau_us", "Ki_1_ms"), {"tau_us": (5.0, 200.0), "Ki_1_ms": (0.1, 20.0)})
print(gains, locus, sep="\n")

distance = held.observe("mean(Zc_nm)")["mean(Zc_nm)"]
free = saltus.find_orbit(model, {"Zc_nm": distance}, x0=held.x0[:2])
amplitude = afm.observables(free)["amplitude_nm"]
print(f"the loop holds {distance:.4f} nm; without it the amplitude is {amplitude:.5f} nm there, set to 8")
assert abs(amplitude - 8.0) < 1e-3
energy = held.observe("mean(drive_pW)", "mean(medium_pW)", "mean(sample_pW)")

drive, medium, sample = energy.values()
print(f"power in pW: drive {drive:.10f}, medium and sample {medium + sample:.10f}")
assert abs(drive - medium - sample) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
tau, border = (locus.column(name) for name in locus.names)
left.plot(tau, border, color="#1b1b1e", label="torus points")
left.fill_between(tau, border, 15.0, color="0.9", label="rings")
left.plot(ringing.parameters["tau_us"], ringing.parameters["Ki_1_ms"], "o", color="#d55e00", label="found at 50 us")
left.set(xlabel="time constant of the lock-in in us", ylabel="gain in 1/ms", xlim=(5.0, 200.0), ylim=(0.0, 15.0))
left.set_title("a slower lock-in allows more gain")
left.legend(loc="lower right")
for gain, colour in ((6.5, "#d55e00"), (5.0, "#0072b2")):
    (one,) = gains.at(gain)
    start = one.x0 + np.array([0.0, 0.0, 0.0, 0.0, 1e-5])
    motion = saltus.simulate(loop, {"Ki_1_ms": gain}, x0=start, periods=1200, tolerance=1e-12)
    strobes = motion(np.arange(1200) * one.period)[:, 4] - one.x0[4]
    late = strobes[400:]
    pairs = np.column_stack([late[30:-30], late[:-60]])
    grows = (-np.linalg.lstsq(pairs, late[60:], rcond=None)[0][1]) ** (1.0 / 60.0)
    expected = np.abs(one.multipliers).max()
    print(f"gain {gain} per ms: a period multiplies the ringing by {grows:.6f}, multiplier {expected:.6f}")
    assert abs(grows - expected) < 1e-5
    right.plot(np.arange(1200) * one.period / 1000.0, 1e6 * strobes, color=colour, label=f"gain {gain:g} per ms")
right.set(xlabel="time in ms", ylabel="deviation of the distance in fm", title="after a push of 10 fm")
right.legend(loc="upper left")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "afm_feedback.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
