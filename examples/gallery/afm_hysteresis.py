"""Contacts with hysteresis take the same energy in every cycle: necks of water, and adhesion after JKR.

A neck forms at a gap of 1 nm and breaks at 3 nm (Zitzler, Herminghaus and Mugele, Phys. Rev. B 66 (2002) 155436). JKR
contact begins at the touch and ends farther out (Johnson, Kendall and Roberts, Proc. R. Soc. A 324 (1971) 301). Known
answers, whatever the distance: a neck takes 4 pi gamma R h (1/(1 + on/h) - 1/(1 + off/h)), a JKR contact 7.092196 (w^5
R^4/E^2)^(1/3). In each cycle the drive gives what medium and sample take.

Field: Atomic force microscopy.

    python afm_hysteresis.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus
from saltus import afm

R, gamma, h, forms, breaks, E, w = 20.0, 0.072, 1.0, 1.0, 3.0, 0.05, 0.05
EV = 0.1602176634  # eV in nN nm
probe = afm.Probe(k_N_m=40.0, f0_kHz=70.0, Q=400.0, R_nm=R)
neck = afm.Neck(gamma_N_m=gamma, h_nm=h, on_nm=forms, off_nm=breaks)
laws = {
    "neck": neck + afm.VanDerWaals(H_aJ=0.05, a0_nm=0.2) + afm.DMT(E_GPa=1.0),
    "JKR": afm.JKR(E_GPa=E, w_N_m=w),
}
taken = {
    "neck": 4.0 * np.pi * gamma * R * h * (1.0 / (1.0 + forms / h) - 1.0 / (1.0 + breaks / h)) / EV,
    "JKR": 7.092196 * (w**5 * R**4 / E**2) ** (1.0 / 3.0) / EV,
}

figure, axes = plt.subplots(1, 3, figsize=(12.0, 4.2), layout="constrained")
for ax, (name, law), colour in zip(axes[1:], laws.items(), ("#0072b2", "#d55e00"), strict=True):
    model = afm.model(probe, law, afm.Drive(A0_nm=30.0), Zc_nm=20.0)
    branch = saltus.continue_orbit(saltus.find_orbit(model, x0=[0.0, 0.0]), "Zc_nm", bounds=(5.0, 30.0))
    print(branch)
    for Zc in (8.0, 15.0, 22.0):
        for one in branch.at(Zc):
            seen = afm.observables(one)
            rest = seen["E_ext_eV"] - seen["E_med_eV"] - seen["E_ts_eV"]
            print(
                f"{name} at {Zc:g} nm: {seen['E_ts_eV']:.6f} eV a cycle, closed form {taken[name]:.6f}, rest {rest:.0e}"
            )
            assert abs(seen["E_ts_eV"] / taken[name] - 1.0) < 1e-6
            assert abs(rest) < 1e-6
    branch.plot("Zc_nm", "max_z1_nm", ax=axes[0], legend=name == "neck")
    at = branch.at(12.0)[0]
    axes[0].plot(12.0, at.max["z1_nm"], "o", color=colour, label=f"{name}, drawn beside")
    sample = at.sample()
    ax.plot(sample["D_nm"], sample["force_nN"], color=colour)
    ax.set(xlabel="gap in nm", ylabel="force in nN", title=f"{name}: {taken[name]:.2f} eV a cycle")
axes[1].set(xlim=(-3.0, 6.0))
axes[2].set(xlim=(-3.0, 6.0))
named = {label: line for line, label in zip(*axes[0].get_legend_handles_labels(), strict=True)}
axes[0].legend(named.values(), named, loc="upper left", fontsize="small")
axes[0].set(xlabel="distance $Z_c$ in nm", ylabel="greatest deflection in nm", ylim=(5.0, 48.0))
axes[0].set_title("where tapping folds or ends")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "afm_hysteresis.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
