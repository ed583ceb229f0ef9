"""Where branches of cycles begin and end: at boundary equilibria, at infinity, on canards; starts that are refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    InputError,
    Mode,
    StepControl,
    Transition,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    find_equilibrium,
    solve_orbit,
    switch_branch,
)
from saltus.results import Branch, Equilibrium, PeriodicOrbit

PERIOD = 6.355799581032402
MULTIPLIER = 0.625775114255821
"""Of the cycle round a focus that is stable left of x = 0 and unstable right of it: Simpson, Meiss 2007."""


@pytest.fixture(scope="module")
def foci() -> Callable[..., PeriodicOrbit]:
    """Return what solves a cycle round an equilibrium right of a surface, in coordinates X = place + unit x.

    Its size is that of m. The field is linear on both sides but for the coefficient `bent`.
    """
    x, y = "((X - place)/unit)", "((Y - 2*place)/unit)"
    fields = {
        side: {"X": f"rate*unit*({growth}*{x} - {y} + bent*{x}**2)", "Y": f"rate*unit*({x} - m + bent*{x}*{y})"}
        for side, growth in (("left", "a"), ("right", "b"))
    }
    system = HybridSystem(
        ("X", "Y"),
        {"m": 0.05, "a": -0.5, "b": 0.2, "bent": 0.0, "place": 0.0, "unit": 1.0, "rate": 1.0},
        {side: Mode(field) for side, field in fields.items()},
        [
            Transition("left", "right", "X - place", 1, name="rightwards"),
            Transition("right", "left", "X - place", -1, name="leftwards"),
        ],
    )

    def solved(place: float = 0.0, unit: float = 1.0, time: float = 1.0, bent: float = 0.0) -> PeriodicOrbit:
        starts = [[place, 2.0 * place - 0.104850338 * unit], [place, 2.0 * place + 0.175468863 * unit]]
        ends, durations = (("right", "leftwards"), ("left", "rightwards")), (3.87019 * time, 2.48561 * time)
        guess = [(*end, start, duration) for end, start, duration in zip(ends, starts, durations, strict=True)]
        return solve_orbit(system, {"place": place, "unit": unit, "rate": 1.0 / time, "bent": bent}, guess)

    return solved


@pytest.mark.parametrize("time", [1e-6, 1.0, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("bent", [0.0, 0.1])
def test_a_cycle_with_events_is_solved_in_any_unit_of_time(
    foci: Callable[..., PeriodicOrbit], time: float, bent: float
) -> None:
    orbit, known = foci(time=time, bent=bent), foci(bent=bent)
    assert orbit.period == pytest.approx(known.period * time, rel=1e-11)
    assert orbit.multipliers == pytest.approx(known.multipliers, rel=1e-9)
    if bent == 0.0:
        assert orbit.period == pytest.approx(PERIOD * time, rel=1e-11)
        assert orbit.multipliers[0] == pytest.approx(MULTIPLIER, rel=1e-9)


@pytest.mark.parametrize(
    ("place", "unit", "time", "bent"),
    [(0.0, 1.0, 1.0, 0.0), (0.7, 1.0, 1.0, 0.3), (7e-10, 1e-9, 1e-6, 0.3), (7e3, 1e5, 1e6, 0.1), (50.0, 1.0, 1.0, 0.1)],
)
def test_a_cycle_shrinks_to_a_boundary_equilibrium(
    foci: Callable[..., PeriodicOrbit], place: float, unit: float, time: float, bent: float
) -> None:
    branch = continue_orbit(foci(place, unit, time, bent), "m", (-0.5, 0.1))
    (end,) = branch.special_points
    side = 0 if branch.values[0] < branch.values[-1] else -1
    assert branch.stopped[side].endswith("the cycle shrinks to a boundary equilibrium")
    assert branch.stopped[1 + side].endswith("bound reached")
    assert end.type == "BE"
    assert end.parameters["m"] == pytest.approx(0.0, abs=1e-12)
    assert end.orbit.x0 == pytest.approx([place, 2.0 * place], rel=1e-9, abs=1e-12 * unit)
    assert end.orbit.period == pytest.approx(PERIOD * time, rel=1e-6)
    assert end.orbit.multipliers[0] == pytest.approx(MULTIPLIER, rel=1e-3)  # of a last cycle that is hardly any
    assert branch.stable.all()


def test_a_boundary_equilibrium_of_cycles_has_the_equilibrium_and_its_locus(foci: Callable[..., PeriodicOrbit]) -> None:
    end = continue_orbit(foci(), "m", (-0.5, 0.1))["BE1"]
    assert end.kind == "persistence"
    rest = switch_branch(end, to=Equilibrium)
    np.testing.assert_allclose([*rest.state, rest.parameters["m"]], 0.0, atol=1e-12)
    locus = continue_locus(end, ("m", "a"), {"m": (-1.0, 1.0), "a": (-1.0, 1.0)})
    assert locus.type == "BE"
    np.testing.assert_allclose(locus.values[:, 0], 0.0, atol=1e-12)
    assert np.ptp(locus.values[:, 1]) == pytest.approx(2.0)


def test_a_cycle_that_grows_to_infinity_says_so(foci: Callable[..., PeriodicOrbit]) -> None:
    branch = continue_orbit(foci(bent=0.3), "m", (0.01, 0.5), directions="up")
    assert "the orbit grows without bound (Y ranges over " in branch.stopped[1]
    assert np.ptp([branch.lows[-1, 1], branch.highs[-1, 1]]) > 1e6


@pytest.fixture(scope="module")
def bursting() -> HybridSystem:
    """Return the neuron of Hindmarsh and Rose, Proc. R. Soc. B 221 (1984) 87: rates from 0.005 to 14."""
    field = {"x": "y - x**3 + 3*x**2 - z + J", "y": "1 - 5*x**2 - y", "z": "r*(s*(x + 1.6) - z)"}
    return HybridSystem.smooth(field, {"J": 0.0, "r": 0.005, "s": 4.0})


@pytest.fixture(scope="module")
def births(bursting: HybridSystem) -> dict[str, Branch]:
    """Return the branches of cycles from each Hopf point but the second."""
    rests = continue_equilibrium(find_equilibrium(bursting, {"J": 0.5}, [-1.5, -10.0, 0.5]), "J", (0.0, 30.0))
    return {
        label: continue_orbit(switch_branch(rests[label]), "J", (0.0, 30.0), steps=StepControl(max_points=40))
        for label in ("HB1", "HB3", "HB4")
    }


@pytest.mark.campaign
@pytest.mark.parametrize(("label", "J"), [("HB1", 1.34107296509), ("HB3", 6.18401850275), ("HB4", 25.2641282731)])
def test_cycles_of_a_bursting_neuron_shrink_to_their_hopf_points(
    births: dict[str, Branch], label: str, J: float
) -> None:
    branch = births[label]
    assert branch["HB1"].parameters["J"] == pytest.approx(J, rel=1e-10)
    assert branch.stopped[1].endswith("the cycle shrinks to an equilibrium")
    assert len(branch) >= 15


@pytest.mark.campaign
def test_a_canard_is_no_homoclinic_orbit(births: dict[str, Branch]) -> None:
    branch = births["HB1"]
    assert branch.stopped[0].endswith("40 points")  # it goes on along the canard
    assert not any(point.type in ("HOM", "SNIC") for point in branch.special_points)
    assert branch.period[0] < 2.0 * branch.period[-1]


def test_a_start_at_a_branch_point_is_refused_with_the_cure() -> None:
    field = {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}
    lorenz = HybridSystem.smooth(field, {"r": 1.0})
    with pytest.raises(InputError, match=r"equilibrium at r = 1.0: .* at a branch point start beside it, at another r"):
        continue_equilibrium(find_equilibrium(lorenz), "r", (0.0, 2.0))
    wells = HybridSystem.smooth({"x": "v", "v": "x - x**3 - 0.2*v + A*cos(s)"}, {"A": 3.0, "w": 1.0}, phase=("s", "w"))
    branch = continue_orbit(solve_orbit(wells, x0=[2.0, 0.0]), "A", (1.0, 4.0))
    with pytest.raises(InputError, match="at another A; switch_branch goes to the other branch"):
        continue_orbit(branch["BP1"].orbit, "A", (1.0, 4.0))


@pytest.mark.campaign
def test_small_cycles_with_a_fast_decay_shrink_to_their_hopf_point() -> None:
    """Oxidation of CO on platinum, Bykov, Yablonskii, Kim, Dokl. Akad. Nauk SSSR 242 (1978) 637."""
    free = "(1 - x - y - s)"
    field = {
        "x": f"5*{free}**2 - 2*x**2 - 10*x*y",
        "y": f"q2*{free} - y/10 - 10*x*y",
        "s": f"27/400*{free} - 27/1000*s",
    }
    surface = HybridSystem.smooth(field, {"q2": 1.0})
    rests = continue_equilibrium(find_equilibrium(surface, x0=[0.107, 0.176, 0.513]), "q2", (0.5, 2.0))
    assert [point.parameters["q2"] for point in rests.special_points.of_type("SN")] == pytest.approx(
        [1.05220028787, 1.04204850538], rel=1e-10
    )
    cycles = continue_orbit(switch_branch(rests["HB2"]), "q2", (0.5, 2.0), steps=StepControl(max_points=30))
    (end,) = cycles.special_points
    assert (end.type, end.parameters["q2"]) == ("HB", pytest.approx(1.05155746246, rel=1e-10))
    assert max(np.abs(cycles.multipliers[:, 0]).real) > 1.5  # it is subcritical


@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_a_hopf_point_that_is_a_saddle_node_as_well_is_told_to_be_a_zero_hopf_point(unit: float) -> None:
    field = {"x": "-y - z", "y": "x + y/5", "z": "u/5 + z*(x - c*u)/u"}  # both of Roessler's equilibria meet at c = 0.4
    roessler = HybridSystem.smooth(field, {"c": 5.7, "u": unit})
    branch = continue_equilibrium(find_equilibrium(roessler, x0=unit * np.array([5.7, -28.0, 28.0])), "c", (0.3, 6.0))
    assert sorted(point.type for point in branch.special_points) == ["HB", "SN"]
    assert [point.parameters["c"] for point in branch.special_points] == pytest.approx([0.4, 0.4], abs=1e-9)
    assert "it is a zero-Hopf point" in branch["HB1"].normal_form.reason
    with pytest.raises(InputError, match="it is a zero-Hopf point"):
        switch_branch(branch["HB1"])


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.03, 0.1, 0.2, 0.3])
def test_cycles_whose_period_alone_grows_do_not_turn_round(largest):
    field = {
        "x": "3.12*x + 0.7*y + 0.92*z - 0.78*m - 0.01*m*x + 1.3*x*y - 0.25*x*z - 0.32*x**3",
        "y": "-0.88*x + 0.12*y - 0.95*z - 0.13*m + 1.47*m*y - 0.12*z**2 - y**3",
        "z": "-0.36*x + 0.08*y - 0.12*z + 0.39*m - 1.33*m*z - x*z - 0.33*z**3",
    }
    system = HybridSystem.smooth(field, {"m": 0.1})
    rests = continue_equilibrium(find_equilibrium(system, {}, [-1.21, -1.13, 1.88]), "m", (-2.0, 2.0))
    steps = StepControl(initial=0.01, largest=largest)
    branch = continue_orbit(switch_branch(rests["HB1"]), "m", (-2.0, 2.0), steps=steps)
    assert [point.type for point in branch.special_points] == ["HB", "SN"]
    assert sum("the period grows without bound" in reason for reason in branch.stopped) == 1
    assert np.all(np.diff(branch.period[: np.argmax(branch.period) + 1]) > 0.0)
