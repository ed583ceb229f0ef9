"""Orbits of the two regimes of tapping: found where they are, refused where they are not."""

from __future__ import annotations

import pytest

from saltus import afm
from saltus.afm.paper.regimes import settled_orbit, tapping_modes
from saltus.errors import InputError


@pytest.fixture(scope="module")
def model():
    return afm.tapping_mode(afm.table1(), modes=2)


def test_both_regimes_coexist_above_resonance(model):
    """At Omega = 1.15 both basins of the paper's Figs. 8-10 are there."""
    repulsive, attractive = (settled_orbit(model, {"Omega": 1.15}, name) for name in ("repulsive", "attractive"))
    assert repulsive.stable
    assert attractive.stable
    assert repulsive.signature == (("flight", "touch"), ("contact", "release"))
    assert attractive.signature == (("flight", "theta"),)
    assert repulsive.min["z"] < 0.0 < attractive.min["z"]


def test_a_grazing_free_orbit_is_found_beside_an_impacting_one_of_long_period(model):
    """At Omega = 0.916 the motion from rest settles on an orbit with contact; another start is taken."""
    assert settled_orbit(model, {"Omega": 0.916}, "attractive").min["z"] > 1.0 / 300.0


@pytest.mark.campaign
def test_a_regime_without_a_stable_orbit_is_refused_with_where_motions_end(model):
    wanted = (
        "orbit = 'attractive': must be a regime with a stable periodic orbit at these parameters; "
        "of 17 motions from different starts, 17 end on an orbit in the repulsive regime"
    )
    with pytest.raises(InputError, match=f"^{wanted}$"):
        settled_orbit(model, {"Omega": 1.0}, "attractive")


def test_an_unknown_regime_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="^orbit = 'attactive': must be one of repulsive, attractive; did you mean"):
        settled_orbit(afm.tapping_mode(afm.table1()), None, "attactive")


def test_another_system_is_refused(ball):
    with pytest.raises(InputError, match=r"must be tapping mode; afm\.tapping_mode returns it$"):
        tapping_modes(ball)
