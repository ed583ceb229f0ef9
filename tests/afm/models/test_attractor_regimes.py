"""Basins of a probe over a sample: both regimes of lever S are found, named by their virial, and labelled."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import afm
from saltus.basins import AttractorOptions
from saltus.errors import InputError

REGION = {"z1_nm": (-7.0, -4.0), "v1_nm_us": (14.0, 17.0)}  # about the attractive orbit, whose basin is small


@pytest.fixture(scope="module")
def system():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0)


@pytest.fixture(scope="module")
def attractors(system):
    found = saltus.find_attractors(system, {}, REGION, options=AttractorOptions(starts=16, motions=100, samples=200))
    return afm.name_by_regime(found)


@pytest.mark.campaign
def test_both_regimes_are_found_and_named_though_both_touch_the_sample(attractors):
    assert attractors.names == ("attractive", "repulsive")
    seen = {name: afm.observables(orbit) for name, orbit in attractors.orbits.items()}
    assert seen["attractive"]["amplitude_nm"] == pytest.approx(9.895278868, rel=1e-9)
    assert seen["repulsive"]["amplitude_nm"] == pytest.approx(10.71569893, rel=1e-9)
    assert all(one["contact_fraction"] > 0.0 for one in seen.values())
    assert (attractors.labels["attractive"], attractors.labels["repulsive"]) == (0, 1)
    assert set(attractors.kinds) == set(attractors.points) == set(attractors.notes) == set(attractors.names)


@pytest.mark.campaign
def test_names_are_kept_by_a_file(attractors, tmp_path):
    attractors.save(tmp_path / "attractors.nc")
    assert saltus.load(tmp_path / "attractors.nc") == attractors


@pytest.mark.campaign
def test_labels_are_where_motions_end_and_axes_have_units(system, attractors):
    grid = {"z1_nm": (*REGION["z1_nm"], 8), "v1_nm_us": (*REGION["v1_nm_us"], 8)}
    basins = saltus.map_basins(system, {}, grid, attractors)
    assert set(np.unique(basins.labels)) == {0, 1}
    for i, j in ((0, 0), (3, 3), (4, 4), (7, 7)):
        start = [basins.grid.axes[0][i], basins.grid.axes[1][j]]
        motion = saltus.simulate(system, {}, start, periods=3000)
        end = motion(motion.t_end)[:2]
        reached = min(attractors.names, key=lambda name: np.abs(end - attractors.points[name][0]).max())
        assert basins.names[int(basins.labels[i, j])] == reached
    ax = basins.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$z_{1}$ (nm)", "$v_{1}$ (nm/us)")


@pytest.mark.campaign
def test_letters_tell_several_attractors_of_one_regime_apart(attractors):
    assert attractors.renamed(["attractive", "attractive"]).names == ("attractive A", "attractive B")
    for names in (["one"], ["one", "diverged"]):
        with pytest.raises(InputError, match="must be 2 names, none of them diverged or undecided"):
            attractors.renamed(names)


@pytest.mark.campaign
def test_names_that_are_no_texts_are_refused(attractors):
    with pytest.raises(InputError, match="names = 1: must be text"):
        attractors.renamed([1, 2])


def test_what_is_no_attractors_is_refused():
    with pytest.raises(InputError, match="attractors = 3: must be an? Attractors"):
        afm.name_by_regime(3)
