"""What the page offers for each kind of system, and the motions that it follows."""

import pytest

import known_maps
import saltus
from saltus.explorer.kinds import kind_of, motion_instead, motion_step
from saltus.explorer.steps import FindEquilibrium, FindOrbit, Iterate, Move

STILL = saltus.HybridSystem.smooth({"x": "v", "v": "-x"})
DRIVEN = saltus.HybridSystem.smooth({"x": "cos(s) - x"}, phase=("s", "1"))


@pytest.mark.parametrize(
    ("system", "first", "nearby", "unit"),
    [
        (STILL, FindEquilibrium, "equilibrium", "time"),
        (DRIVEN, FindOrbit, "", "periods"),
        (known_maps.henon(), FindOrbit, "orbit", "iterations"),
    ],
)
def test_a_kind_says_what_is_looked_for_and_how_time_is_counted(system, first, nearby, unit):
    kind = kind_of(system)
    assert (kind.first, kind.nearby, kind.unit) == (first, nearby, unit)


def test_a_map_has_no_phase_plane_no_section_and_no_mode():
    kind = kind_of(known_maps.tent())
    assert (kind.layers, kind.section, kind.chosen_modes) == ((), False, False)
    assert {"section", "tolerance"}.isdisjoint(kind.numerics)


def test_a_motion_is_followed_in_the_unit_of_its_kind():
    assert motion_step(STILL, {}, (1.0, 0.0), None, 2.5) == Move(x0=(1.0, 0.0), t_end=2.5)
    assert motion_step(DRIVEN, {}, (1.0,), "smooth", 2.6) == Move(x0=(1.0,), mode="smooth", periods=3)
    assert motion_step(known_maps.logistic(), {"r": 3.0}, (0.1,), None, 40.0) == Iterate(
        parameters={"r": 3.0}, x0=(0.1,), n=40
    )


def test_the_motion_from_a_cell_lasts_periods_of_the_solution_where_time_has_no_unit():
    class Cycle:
        period = 4.0

    assert kind_of(STILL).span_of_cell(Cycle()) == 4.0 * kind_of(STILL).cell
    assert kind_of(DRIVEN).span_of_cell(Cycle()) == kind_of(DRIVEN).cell
    assert kind_of(known_maps.henon()).span_of_cell(Cycle()) == kind_of(known_maps.henon()).cell


def test_where_a_map_has_no_stable_orbit_its_motion_is_shown():
    search = FindOrbit(parameters={"r": 3.9}, x0=(0.3,))
    with pytest.raises(saltus.ConvergenceError) as told:
        search.run(known_maps.logistic(), {}, False)
    motion = motion_instead(search, str(told.value), known_maps.logistic())
    assert motion == Iterate(parameters={"r": 3.9}, x0=(0.3,), n=2000)
    assert motion_instead(motion, str(told.value), known_maps.logistic()) is None
