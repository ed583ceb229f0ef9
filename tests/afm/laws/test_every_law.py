"""Every law of force on an orbit that feels it: the balance of energies, and Liouville's theorem.

The multipliers of an orbit multiply to the exponential of the field's divergence along it, times the determinants of
the saltation matrices. Those are 1 here: a law changes its force at a gap, and the gap's rate does not jump.
"""

import math

import numpy as np
import pytest

import saltus
from saltus import afm
from selection import guarding

PROBE = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
SPHERE = afm.VanDerWaals(H_aJ=0.1, a0_nm=0.3) + afm.DMT(E_GPa=1.0)
TOLERANCE = 1e-13  # of the steps; sensitivities through the root at JKR's pull-off lose four digits more
SOFTER = "k2_N_m*(contact + (1 - contact)*k1_N_m/(k1_N_m + k2_N_m))/c_uNs_m"
SPRINGS = "(k1_N_m + k2_N_m + k2_N_m_2)"
ARMS = " + ".join(
    f"k2_N_m{end}/c_uNs_m{end}*(contact + (1 - contact)*(k1_N_m + {other})/{SPRINGS})"
    for end, other in (("", "k2_N_m_2"), ("_2", "k2_N_m"))
)

# Law, gap at rest, damping of the force in uN s/m, contraction of the law's own state in 1/us, whether energy is lost.
LAWS = {
    "VanDerWaals": (afm.VanDerWaals(H_aJ=0.02, a0_nm=0.3), 19.5, "0", "0", False),
    "DMT": (SPHERE, 15.0, "0", "0", False),
    "Hertz": (afm.Hertz(E_GPa=1.0), 15.0, "0", "0", False),
    "Dashpot": (SPHERE + afm.Dashpot(c_uNs_m=2.0), 15.0, "c_uNs_m*contact", "0", True),
    "KelvinVoigt": (
        SPHERE + afm.KelvinVoigt(eta_Pa_s=10.0), 15.0, "0.001*eta_Pa_s*sqrt(R_nm*indentation_nm)", "0", True,
    ),
    "KelvinVoigt, raw": (
        SPHERE + afm.KelvinVoigt(eta_Pa_s=10.0, form="raw"), 15.0, "0.001*eta_Pa_s*sqrt(R_nm*indentation_nm)", "0",
        True,
    ),
    "SLS": (afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=5.0), 15.0, "0", SOFTER, True),
    "JKR": (afm.JKR(E_GPa=1.0, w_N_m=0.03), 15.0, "0", "0", True),
    "Schwarz": (afm.Schwarz(E_GPa=1.0, w1_N_m=0.03, w2_N_m=0.02, a0_nm=0.3), 15.0, "0", "0", True),
    "Neck": (SPHERE + afm.Neck(gamma_N_m=0.02, h_nm=0.5, on_nm=0.6, off_nm=1.5), 15.0, "0", "0", True),
    "LennardJones": (afm.LennardJones(H_aJ=0.1, sigma_nm=0.34), 15.0, "0", "0", False),
    "Hydration": (afm.Hydration(F_nN=5.0, l_nm=0.5), 15.0, "0", "0", False),
    "DLVO": (afm.DLVO(tip_mC_m2=-100.0, sample_mC_m2=-100.0, debye_nm=3.0, H_aJ=0.001), 18.0, "0", "0", False),
    "Cone": (afm.Cone(E_GPa=1.0, half_angle_deg=20.0), 15.0, "0", "0", False),
    "SphereCone": (afm.SphereCone(E_GPa=1.0, half_angle_deg=60.0), 15.0, "0", "0", False),
    "FlatPunch": (afm.FlatPunch(E_GPa=1.0, punch_nm=5.0), 15.0, "0", "0", False),
    "ThinSphere": (afm.ThinSphere(E_GPa=1.0, thickness_nm=40.0), 15.0, "0", "0", False),
    "ThinCone": (afm.ThinCone(E_GPa=1.0, half_angle_deg=20.0, thickness_nm=20.0), 15.0, "0", "0", False),
    "ThinPunch": (afm.ThinPunch(E_GPa=1.0, punch_nm=5.0, thickness_nm=20.0), 15.0, "0", "0", False),
    "GeneralisedMaxwell": (
        afm.GeneralisedMaxwell(k1_N_m=2.0, k2_N_m=(4.0, 2.0), c_uNs_m=(5.0, 0.5)), 15.0, "0", ARMS, True,
    ),
    "Meniscus": (SPHERE + afm.Meniscus(gamma_N_m=0.02, V_nm3=5.0, on_nm=0.6), 15.0, "0", "0", True),
    "Electrostatic": (SPHERE + afm.Electrostatic(bias_V=1.0, cpd_V=0.3), 15.0, "0", "0", False),
    "ElectrostaticTip": (
        SPHERE + afm.ElectrostaticTip(bias_V=1.0, cpd_V=0.3, half_angle_deg=20.0, cone_height_nm=5e3),
        15.0, "0", "0", False,
    ),
    "MagneticDipoles": (
        afm.MagneticDipoles(tip_A_nm2=100.0, sample_A_nm2=-100.0, centres_nm=40.0), 15.0, "0", "0", False,
    ),
    "Morse": (afm.Morse(U_aJ=1.0, l_nm=0.2, D0_nm=0.4), 15.0, "0", "0", False),
}  # fmt: skip


@pytest.fixture(scope="module", params=guarding(LAWS, "DMT", "KelvinVoigt", "SLS"))
def tapped(request):
    law, Zc_nm, drag, forgotten, lost = LAWS[request.param]
    system = afm.model(PROBE, law, afm.Drive(A0_nm=20.0), Zc_nm=Zc_nm)
    orbit = saltus.find_orbit(system, x0=[0.0] * len(system.states), tolerance=TOLERANCE)
    return orbit, drag, forgotten, lost


def test_the_laws_are_all_there():
    kinds = {name: getattr(afm, name) for name in afm.__all__}
    laws = {name for name, kind in kinds.items() if isinstance(kind, type) and issubclass(kind, afm.Law)}
    assert {name.partition(",")[0] for name in LAWS} == laws - {"Law"}


def test_energies_balance(tapped):
    orbit, _, _, lost = tapped
    seen = afm.observables(orbit)
    assert seen["E_ext_eV"] - seen["E_med_eV"] == pytest.approx(seen["E_ts_eV"], abs=1e-9 * seen["E_ext_eV"])
    assert lost == (seen["E_ts_eV"] > 1e-6 * seen["E_ext_eV"])
    assert not seen["contact_fraction"] <= 0.0  # in contact where the law has contact
    assert 0.1 < seen["amplitude_nm"] < 19.995  # the sample is felt


def test_areas_contract_by_liouvilles_theorem(tapped):
    orbit, drag, forgotten, _ = tapped
    p = orbit.parameters
    own = 2e-3 * math.pi * p["f0_kHz"]
    told = f"mean({drag})*{own}**2/k_N_m + mean({forgotten})"
    rate = own / p["Q"] + orbit.observe(told)[told]
    assert float(np.prod(orbit.multipliers).real) == pytest.approx(math.exp(-rate * orbit.period), rel=1e-9)
