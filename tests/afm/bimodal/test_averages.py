"""Means over two phases: against brute sums, closed forms, and differences of themselves."""

import math

import numpy as np
import pytest

from saltus import afm
from saltus.afm.bimodal.averages import FINE, STANDARD, Motion, averages
from saltus.afm.bimodal.layers import layers_of
from saltus.errors import InputError

R = 10.0
LAWS = {
    "sphere": afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.0) + afm.KelvinVoigt(eta_Pa_s=10.0),
    "dashpot": afm.Hertz(E_GPa=1.0) + afm.Dashpot(c_uNs_m=2.0),
    "two levels": afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.Hertz(E_GPa=1.0),
    "everywhere": afm.Morse(U_aJ=0.4, l_nm=0.4, D0_nm=0.3),
}
MOTIONS = [(9.2, 10.0, 0.5), (10.2, 10.0, 0.5), (9.0, 2.0, 10.0), (10.9, 10.0, 0.5), (-1.0, 0.3, 0.2)]
# the depth of 1.1 nm lies between twice the second amplitude and twice the sum of both; last, no touch
THREE = [(9.7, 10.0, 0.5, 0.3), (10.0, 10.0, 0.5, 0.3), (9.0, 0.4, 1.0, 10.0), (11.2, 10.0, 0.5, 0.3)]


def means(law, c, *A, nodes=FINE, **changes):
    """Means and derivatives, row by row: those of the force, then those of the damping with a mode."""
    layers = layers_of(law, R)
    values = {"R_nm": R, **law.parameters, **changes}
    parameters = {name: np.array([values[name]]) for name in layers.names}
    force, damping = averages(layers, Motion(np.array([c]), np.array(A)[:, None]), parameters, nodes)[..., 0]
    return np.concatenate([force, damping[1:]])


def brute(law, c, *A, n=1200):
    """Sums over half of each turn; the rate's part is the difference of forces with and without a rate."""
    cosines = np.meshgrid(*[np.cos((np.arange(n) + 0.5) * math.pi / n)] * len(A), indexing="ij", sparse=True)
    D = c + sum(one * cosine for one, cosine in zip(A, cosines, strict=True))
    gaps = np.linspace(D.min(), D.max(), 2_001)
    still, moving = (np.interp(D, gaps, law.force_nN(gaps, R_nm=R, V_nm_us=V)) for V in (0.0, 1.0))
    damping = still - moving
    found = [still, *(still * one for one in cosines), *(damping * (1 - one**2) for one in cosines)]
    return np.array([one.mean() for one in found])


@pytest.mark.campaign
@pytest.mark.parametrize("law", LAWS)
def test_means_are_those_of_a_brute_sum(law):
    for motion in MOTIONS[:3:2]:
        told, plain = means(LAWS[law], *motion)[:, 0], brute(LAWS[law], *motion)
        # forces are interpolated between 2001 gaps; a jump is missed by the width of a cell
        assert np.abs(told - plain).max() < (1e-2 if law == "dashpot" else 1e-3) * np.abs(plain).max()
    told, plain = means(LAWS[law], *THREE[0])[:, 0], brute(LAWS[law], *THREE[0], n=160)
    assert np.abs(told - plain).max() < (1e-2 if law == "dashpot" else 1e-3) * np.abs(plain).max()


@pytest.mark.parametrize("law", LAWS)
def test_derivatives_are_differences_of_the_means(law):
    for motion in MOTIONS + THREE[::3]:
        told, step, modes = means(LAWS[law], *motion), 1e-4, len(motion) - 1
        for i in range(1 + modes):
            ends = [means(LAWS[law], *(x + sign * step * (i == j) for j, x in enumerate(motion))) for sign in (1, -1)]
            slope = (ends[0] - ends[1])[:, 0] / (2 * step)
            assert np.abs(slope - told[:, 1 + i]).max() <= 2e-5 * np.abs(told[:, 1 + i]).max() + 1e-10
        for i, name in enumerate(layers_of(LAWS[law], R).names):
            value = {"R_nm": R, **LAWS[law].parameters}[name]
            ends = [means(LAWS[law], *motion, **{name: value * (1 + sign * step)}) for sign in (1, -1)]
            slope = (ends[0] - ends[1])[:, 0] / (2 * step * value)
            assert np.abs(slope - told[:, 2 + modes + i]).max() <= 2e-5 * np.abs(told[:, 2 + modes + i]).max() + 1e-10


@pytest.mark.parametrize("law", LAWS)
def test_standard_nodes_resolve_the_means(law):
    # a bond pressed in by 3 nm repels by 1e7 nN
    for motion in (MOTIONS[3:4] if law == "everywhere" else MOTIONS) + THREE:
        rough, fine = (means(LAWS[law], *motion, nodes=nodes) for nodes in (STANDARD, FINE))
        # the change by finer nodes up to which `bimodal` tells a solution
        assert np.abs(rough - fine).max() < 1e-6 * np.abs(fine).max() + 1e-15


@pytest.mark.parametrize("law", ["sphere", "everywhere"])
def test_a_third_mode_that_stands_still_leaves_the_means_of_two(law):
    two, three = means(LAWS[law], 9.2, 10.0, 0.5)[:, 0], means(LAWS[law], 9.2, 10.0, 0.5, 1e-6)[:, 0]
    assert np.abs(np.delete(three, [3, 6]) - two).max() < 1e-9 * np.abs(two).max()


def test_hertzian_means_are_the_closed_forms_of_shallow_contact():
    # Kawai 2009 and Labuda 2016: mean stiffness E sqrt(R/(2 A1)) d, <F cos> = -E sqrt(R/(8 A1)) d**2 to order d/A1
    E, A1, A2, d = 2.0, 200.0, 1e-4, 0.1
    told = means(afm.Hertz(E_GPa=E), A1 + A2 - d, A1, A2)[:, 0]
    mean_depth = d - A2
    assert told[2] / A2 == pytest.approx(-0.5 * E * math.sqrt(R / (2 * A1)) * mean_depth, rel=2e-3)
    assert told[1] == pytest.approx(-E * math.sqrt(R / (8 * A1)) * mean_depth**2, rel=2e-3)


def test_the_loss_of_one_mode_is_that_of_the_prescribed_motion():
    law, A, Zc, f = LAWS["sphere"], 20.0, 19.0, 70.0
    damping = means(law, Zc, A, 1e-6)[3, 0]
    lost = 4e-3 * math.pi**2 * f * A**2 * damping * 6.241509074460763
    assert lost == pytest.approx(law.energy_per_cycle_eV(Zc_nm=Zc, A_nm=A, f_kHz=f, R_nm=R), rel=1e-6)


def test_a_force_with_states_of_its_own_is_refused():
    with pytest.raises(InputError, match="depends on the past"):
        layers_of(afm.SLS(k1_N_m=2.0, k2_N_m=4.0, c_uNs_m=1.0), R)
