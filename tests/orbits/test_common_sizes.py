"""Sizes that states share where they meet the surfaces of events together."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits.common_sizes import common_sizes, surface_rows

W, D = 40.0, 0.05  # frequency of the fast oscillator, damping of both


def two_oscillators(unit: float = 1.0, event: str = "1 - x - U*y") -> HybridSystem:
    """Two driven oscillators that move one tip, far from its surface; the fast one is measured in units of 1/`unit`."""
    field = {"x": "v", "v": "a*cos(s) - x - D*v", "y": "w", "w": "a*cos(s)/U - K*y - D*w"}
    return HybridSystem(
        ("x", "y", "v", "w"),
        {"Omega": 1.5, "a": 0.1, "D": D, "K": W * W, "U": unit},
        {"flight": Mode(field)},
        [Transition("flight", "flight", event, -1, {"v": "-v"}, name="impact")],
        phase=("s", "Omega"),
    )


@pytest.mark.parametrize("unit", [1.0, 1e-6, 1e9])
def test_a_share_of_the_tip_counts_as_much_as_the_largest_whatever_its_unit(unit: float) -> None:
    rows = np.array([[[1.0, unit, 0.0, 0.0]], [[0.0, 0.0, 1.0, unit]]])
    common = common_sizes(rows, np.array([1.0, 0.02 / unit, 0.8, 0.4 / unit, 6.0]))
    assert common == pytest.approx([1.0, 1.0 / unit, 0.8, 0.8 / unit, 6.0], rel=1e-14)


def test_no_state_is_raised_to_more_than_1000_of_its_sizes() -> None:
    rows = np.array([[[1.0, 1.0]], [[0.0, 0.0]]])
    assert common_sizes(rows, np.array([1.0, 1e-8])).tolist() == [1.0, 1e-5]


def test_states_that_no_surface_has_keep_their_sizes() -> None:
    rows = np.array([[[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]])
    assert common_sizes(rows, np.array([1.0, 0.5, 1e-6])).tolist() == [1.0, 0.5, 1e-6]


def test_an_event_function_that_is_not_affine_raises_nothing() -> None:
    blocks, p = np.array([[0.3, 0.01, 0.2, 0.1, 0.0, 4.0]]), np.array([1.5, 0.1, D, W * W, 1.0])
    for event, affine in (("1 - x - U*y", True), ("1 - x - U*y**2", False)):
        system = two_oscillators(event=event)
        rows = surface_rows(system, np.zeros(1, np.int64), blocks, system.compiled.extended(p), np.ones(5))
        assert bool(np.any(rows)) is affine
        if affine:
            assert rows[:, 0].tolist() == [[-1.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, -1.0]]


def test_a_fast_state_of_a_small_share_has_the_states_of_the_closed_form() -> None:
    """The fast pair of multipliers turns past -1 and 1 ten times each."""
    start = [0.0, 0.0, 0.0, 0.0, 0.0]
    orbit = solve_orbit(two_oscillators(), {}, [("flight", "s", start, 2.0 * np.pi / 1.5)])
    branch = continue_orbit(orbit, "Omega", (1.5, 2.5))
    w = branch.column("Omega")
    assert branch.stopped == ("Omega = 1.5: bound reached", "Omega = 2.5: bound reached")
    assert not branch.special_points
    assert max(len(branch.solution(i).form.modes) for i in range(len(branch))) == 1
    for k, stiffness in ((0, 1.0), (1, W * W)):
        response = 0.1 / (stiffness - w * w + 1j * D * w)
        assert branch.x0[:, k] == pytest.approx(response.real, abs=1e-11)
        assert branch.x0[:, 2 + k] == pytest.approx((1j * w * response).real, abs=1e-11)


@pytest.mark.campaign
def test_a_branch_of_three_modes_has_few_points_and_the_same_special_points() -> None:
    """Positions are those of 343 points, whose steps follow each mode by its own size."""
    system = tapping_mode(table1(), modes=3, parameters={"D_rep": 60.0, "Omega": 0.95})
    branch = continue_orbit(find_orbit(system, x0=np.zeros(6)), "Omega", (0.95, 1.25))
    known = [("SN", 1.1863719176567704), ("GR", 1.0807918228519908), ("TR", 1.0824584305754934),
             ("PD", 1.0836642912702226), ("TR", 1.0844394394348271)]  # fmt: skip
    found = [(point.type, point.parameters["Omega"]) for point in branch.special_points]
    assert [kind for kind, _ in found] == [kind for kind, _ in known]
    assert [at for _, at in found] == pytest.approx([at for _, at in known], abs=1e-9)
    assert len(branch) < 200


@pytest.mark.campaign
@pytest.mark.parametrize("modes", [5, 10])
def test_many_modes_settle_from_rest_and_obey_liouville(modes: int) -> None:
    orbit = find_orbit(tapping_mode(table1(), modes=modes), x0=np.zeros(2 * modes))
    lasts = {part.mode: part.duration for part in orbit.segments}
    decay = modes * (0.025 * lasts["flight"] + 4.0 * lasts["contact"])
    assert orbit.stable
    assert np.log(np.abs(orbit.multipliers)).sum() == pytest.approx(-decay, abs=1e-8)
