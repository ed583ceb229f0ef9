"""Loci of accumulations of hits, against motions of exact flights and against what units alone decide."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import saltus
from preloaded_mass import PRELOADED, Mass, above
from selection import guarding

CLOSE = 1e-11  # of a force
UNITS = [(1.0, 1.0), (1e-9, 1.0), (1e9, 1e3), (1e-9, 1e9)]  # preload, frequency of the drive


def stops_resting(force: float, e: float) -> bool:
    """Return whether exact flights come to rest a little below a force, over the preload, and not a little above it."""
    mass = Mass(e, 1.0, 1.0)
    return mass.rests(force * (1.0 - CLOSE)) and not mass.rests(force * (1.0 + CLOSE))


@cache
def located(mass: Mass, rests: bool = True) -> saltus.Branch:
    """Return a branch that ends at the accumulation."""
    bounds = 1.2 * mass.p, 3.5 * mass.p
    return saltus.continue_orbit(above(mass, rests, 1.4), "F", bounds, stop_at="CH" if rests else ())


@pytest.mark.parametrize(("p", "w"), guarding(UNITS, UNITS[0]))
@pytest.mark.parametrize("rests", guarding([True, False], True))
def test_along_the_locus_motions_of_exact_flights_stop_resting(rests: bool, p: float, w: float) -> None:
    branch = located(Mass(0.2, p, w), rests)
    locus = saltus.continue_locus(branch["CH1"], ("F", "e"), {"F": (1.2 * p, 3.5 * p), "e": (0.19, 0.22)})
    assert locus.type == "CH"
    assert all("bound reached" in reason for reason in locus.stopped)
    assert locus.column("e")[[0, -1]] == pytest.approx([0.19, 0.22])
    assert locus.admissible.all()
    assert not locus.audit.breaches, locus.audit
    for i in (0, -1):
        assert stops_resting(*(locus.values[i] / [p, 1.0]))


@pytest.mark.campaign
def test_the_locus_is_right_from_hard_to_soft_impacts() -> None:
    locus = saltus.continue_locus(located(Mass(0.2, 1.0, 1.0))["CH1"], ("F", "e"), {"F": (1.2, 3.5), "e": (0.05, 0.45)})
    assert all("bound reached" in reason for reason in locus.stopped)
    assert not locus.special_points
    for force, e in locus.values[:: len(locus) // 12]:
        assert stops_resting(force, e)
    assert np.all(np.diff(locus.column("e")) > 0.0)


@pytest.mark.parametrize("name", ["p", "w"])
def test_the_force_goes_with_the_preload_and_not_with_the_frequency(name: str) -> None:
    start = located(Mass(0.2, 1.0, 1.0))["CH1"]
    locus = saltus.continue_locus(start, ("F", name), {"F": (1.2, 3.5), name: (0.8, 1.4)})
    assert locus.column(name)[[0, -1]] == pytest.approx([0.8, 1.4], rel=1e-15)
    expected = PRELOADED * (locus.column("p") if name == "p" else 1.0)
    assert locus.column("F") == pytest.approx(expected, rel=1e-11)


def test_a_locus_starts_at_a_point_of_a_locus_and_at_an_orbit_with_the_type() -> None:
    start, plane = located(Mass(0.2, 1.0, 1.0))["CH1"], ({"F": (1.2, 3.5), "e": (0.19, 0.21)})
    locus = saltus.continue_locus(start, ("F", "e"), plane)
    again = saltus.continue_locus(locus.point(0), ("F", "e"), plane)
    named = saltus.continue_locus(start.orbit, ("F", "e"), plane, type="CH")
    for other in (again, named):
        assert other.values[[0, -1]] == pytest.approx(locus.values[[0, -1]], rel=1e-11)


@pytest.mark.campaign
def test_a_locus_of_accumulations_is_saved_verified_and_drawn(tmp_path) -> None:
    start = located(Mass(0.2, 1.0, 1.0))["CH1"]
    locus = saltus.continue_locus(start, ("F", "e"), {"F": (1.2, 3.5), "e": (0.19, 0.21)})
    locus.save(tmp_path / "locus.nc")
    read = saltus.load(tmp_path / "locus.nc")
    np.testing.assert_array_equal(read.values, locus.values)
    checked = saltus.verify(read, points=3)
    assert checked.passed, checked
    labels = [line.get_label() for line in read.plot().lines]
    assert labels[0] == "CH, accumulation of hits"
    assert not any("unstable" in label for label in labels)  # which side an orbit is on is not told there
    assert "CH locus" in repr(read)


def test_an_orbit_whose_hits_do_not_accumulate_starts_no_locus() -> None:
    orbit = above(Mass(0.2, 1.0, 1.0), True, 1.4)
    with pytest.raises(saltus.InputError, match="hits accumulate"):
        saltus.continue_locus(orbit, ("F", "e"), {"F": (1.2, 3.5), "e": (0.19, 0.21)}, type="CH")
