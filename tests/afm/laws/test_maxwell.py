"""A generalised Maxwell solid: one arm is the standard linear solid, and losses by its loss modulus."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import afm
from saltus.errors import InputError

EV = 1.0 / 0.1602176634  # eV in 1 aJ


def test_one_arm_is_the_standard_linear_solid_formula_by_formula():
    one, solid = (
        afm.GeneralisedMaxwell(k1_N_m=2.0, k2_N_m=[4.0], c_uNs_m=[1.0]),
        afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0),
    )
    assert (one.regions, one.crossings, one.parameters) == (solid.regions, solid.crossings, solid.parameters)
    assert (one.positive, one.contact) == (solid.positive, solid.contact)


def test_arms_that_hold_contact_lose_by_the_loss_modulus():
    springs, dashpots, omega = (4.0, 1.0, 0.5), (1.0, 5.0, 0.1), 2e-3 * math.pi * 70.0
    law = afm.GeneralisedMaxwell(k1_N_m=2.0, k2_N_m=springs, c_uNs_m=dashpots)
    turns = [omega * c / k for k, c in zip(springs, dashpots, strict=True)]
    wanted = math.pi * 4.0 * sum(k * x / (1.0 + x**2) for k, x in zip(springs, turns, strict=True))
    assert law.energy_per_cycle_eV(Zc_nm=-20.0, A_nm=2.0, f_kHz=70.0) == pytest.approx(wanted * EV, rel=1e-8)


@pytest.mark.campaign
def test_two_arms_that_are_tapped_lose_what_scipy_finds():
    k1, k, c = 2.0, np.array([4.0, 2.0]), np.array([1.0, 5.0])
    A, Zc, omega = 10.0, 9.0, 2e-3 * math.pi * 70.0

    def rates(t, s):
        h, rate = -Zc - A * math.cos(omega * t), A * omega * math.sin(omega * t)
        free = k @ s[:2] / (k1 + k.sum())
        pressed = h > free
        force = k1 * h + k @ (h - s[:2]) if pressed else 0.0
        return [*(k * ((h if pressed else free) - s[:2]) / c), force * rate]

    cycle, s = 2.0 * math.pi / omega, np.zeros(3)
    for _ in range(40):
        s[2] = 0.0
        s = solve_ivp(rates, (0.0, cycle), s, "DOP853", rtol=1e-10, atol=1e-12, max_step=cycle / 200).y[:, -1]
    law = afm.GeneralisedMaxwell(k1_N_m=k1, k2_N_m=tuple(k), c_uNs_m=tuple(c))
    assert law.energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=70.0) == pytest.approx(s[2] * EV, rel=1e-6)


def test_a_model_has_a_state_for_each_arm_and_keeps_its_law():
    law = afm.GeneralisedMaxwell(k1_N_m=2.0, k2_N_m=(4.0, 2.0), c_uNs_m=(1.0, 5.0))
    system = afm.model(afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0), law, afm.Drive(10.0), Zc_nm=9.0)
    assert system.states == ("z1_nm", "v1_nm_us", "y_nm", "y_nm_2")
    assert {"k2_N_m_2", "c_uNs_m_2"} <= set(system.parameters)
    assert afm.parts_of(system).law == law


def test_arms_that_are_none_are_refused():
    with pytest.raises(InputError, match="k2_N_m = 2.0: must be a sequence with one value for each arm"):
        afm.GeneralisedMaxwell(k1_N_m=1.0, k2_N_m=2.0, c_uNs_m=(1.0,))
    with pytest.raises(InputError, match="k2_N_m = {2.0, 3.0}: must be a sequence"):
        afm.GeneralisedMaxwell(k1_N_m=1.0, k2_N_m={2.0, 3.0}, c_uNs_m=(1.0, 2.0))
    with pytest.raises(InputError, match=r"k2_N_m = \(\): must be a sequence with one value for each arm"):
        afm.GeneralisedMaxwell(k1_N_m=1.0, k2_N_m=(), c_uNs_m=())
    with pytest.raises(InputError, match="one value for each of the 2 springs"):
        afm.GeneralisedMaxwell(k1_N_m=1.0, k2_N_m=(2.0, 3.0), c_uNs_m=(1.0,))
    with pytest.raises(InputError, match="c_uNs_m"):
        afm.GeneralisedMaxwell(k1_N_m=1.0, k2_N_m=(2.0,), c_uNs_m=(0.0,))
