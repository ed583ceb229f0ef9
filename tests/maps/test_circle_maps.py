"""Maps of the circle: tongues, rotation numbers and labels, against closed forms and SciPy."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from saltus import (
    Average,
    ConvergenceError,
    Map,
    continue_locus,
    continue_orbit,
    find_orbit,
    iterate,
    lyapunov_spectrum,
    run_sweep,
    solve_orbit,
)
from saltus.errors import DefinitionError

TURN = 2.0 * math.pi
CIRCLE = Map(("x",), {"w": 0.1, "K": 0.5}, {"x": "x + w + K*sin(x)"}, angles=("x",), name="circle map")
STANDARD = Map(
    ("x", "y"), {"K": 0.8}, {"x": "x + y + K*sin(x)", "y": "y + K*sin(x)"}, angles=("x",), name="standard map"
)


def drift(x, w, K, period):
    """How far a point goes in some iterations, by NumPy."""
    y = x
    for _ in range(period):
        y = y + w + K * np.sin(y)
    return y - x


def tongue(K, period, turns, low, high):
    """Both edges of a tongue: the w for which the least or greatest drift is a number of turns, by SciPy."""
    grid = np.linspace(-math.pi, math.pi, 400)

    def extreme(w, sign):
        at = grid[np.argmin(sign * drift(grid, w, K, period))]
        found = minimize_scalar(lambda x: sign * drift(x, w, K, period), bounds=(at - 0.1, at + 0.1), method="bounded",
                                options={"xatol": 1e-12})  # fmt: skip
        return sign * found.fun - TURN * turns

    return tuple(sorted(brentq(extreme, low, high, args=(sign,), xtol=1e-13) for sign in (1.0, -1.0)))


@pytest.mark.parametrize("turns", [0, 1, -3])
def test_fixed_points_and_their_tongue_are_the_closed_form(turns):
    w = TURN * turns + 0.1
    orbit = find_orbit(CIRCLE, {"w": w}, x0=[0.3])
    assert orbit.period == 1
    assert orbit.winding == {"x": turns}
    assert orbit.x0[0] == pytest.approx(math.asin(0.2) - math.pi, abs=1e-12)
    branch = continue_orbit(orbit, "w", (w - 1.0, w + 1.0))
    found = sorted(point.parameters["w"] for point in branch.special_points)
    assert found == pytest.approx([TURN * turns - 0.5, TURN * turns + 0.5], abs=1e-9)
    assert branch.stopped == ("the branch is closed", "the branch is closed")


@pytest.mark.parametrize(
    ("K", "period", "turns", "low", "high"), [(0.9, 2, 1, 2.7, 3.6), (0.9, 3, 1, 2.0, 2.35), (0.8, 5, 2, 2.4, 2.75)]
)
def test_tongues_of_longer_orbits_have_the_edges_of_scipy(K, period, turns, low, high):
    w = brentq(lambda w: drift(0.4, w, K, period) - TURN * turns, low, high)
    orbit = solve_orbit(CIRCLE, {"w": w, "K": K}, x0=[0.4], period=period)
    assert orbit.period == period
    assert orbit.winding == {"x": turns}
    branch = continue_orbit(orbit, "w", (low, high))
    assert [point.type for point in branch.special_points] == ["SN", "SN"]
    found = sorted(point.parameters["w"] for point in branch.special_points)
    assert found == pytest.approx(tongue(K, period, turns, low, high), abs=1e-8)


def test_edge_of_the_first_tongue_is_a_straight_line():
    branch = continue_orbit(find_orbit(CIRCLE, x0=[0.3]), "w", (-1.0, 1.0))
    locus = continue_locus(branch.special_points[1], ("w", "K"), {"w": (-2.0, 2.0), "K": (0.2, 1.8)})
    values = np.column_stack([locus.column(name) for name in ("w", "K")])
    assert np.abs(values[:, 0]) == pytest.approx(values[:, 1], abs=1e-9)


@pytest.mark.campaign
def test_between_tongues_the_motion_is_quasi_periodic():
    with pytest.raises(ConvergenceError, match="quasi-periodic"):
        find_orbit(CIRCLE, {"w": 1.0}, x0=[0.3], settle=20_000)
    found = lyapunov_spectrum(CIRCLE, {"w": 1.0}, x0=[0.3], average=Average(periods=20_000))
    assert abs(found.exponents[0]) < 1e-3
    values = [0.1, 0.3, 0.49, 0.55, 1.0, 2.0, 3.1]
    sweep = run_sweep(CIRCLE, "w", values, x0=[0.3])
    assert sweep.labels[0].tolist() == ["period-1"] * 3 + ["quasi-periodic"] * 3 + ["period-2"]
    shown = sweep.points[0, :, :, 0]
    assert np.all((shown >= -math.pi) & (shown < math.pi))


def test_accelerating_motion_of_the_standard_map_is_no_orbit_of_the_plane():
    """With y on a circle as well, kicks of whole turns close: y grows by 2 pi in each iteration."""
    torus = Map(("x", "y"), {"K": 6.5}, {"x": "x + y + K*sin(x)", "y": "y + K*sin(x)"}, angles=("x", "y"), name="torus")
    orbit = solve_orbit(torus, x0=[1.3, 0.0])
    assert orbit.winding == {"x": 1, "y": 1}
    assert orbit.x0 == pytest.approx([math.asin(TURN / 6.5), 0.0], abs=1e-12)
    rest = solve_orbit(STANDARD, x0=[math.pi, 0.05])
    assert abs(rest.x0[0]) == pytest.approx(math.pi)
    assert rest.winding == {"x": 0}
    turning = solve_orbit(STANDARD, x0=[3.0, TURN])
    assert turning.winding == {"x": 1}
    assert turning.x0[1] == pytest.approx(TURN)


LONG = 1_000_000
EXPANDING = Map(("x",), {"k": 0.5}, {"x": "2*x + k*sin(x)"}, angles=("x",), name="expanding map of the circle")
CAT = Map(("x", "y"), {}, {"x": "2*x + y", "y": "x + y"}, angles=("x", "y"), name="Arnold's cat map")


def missed(angles, images):
    """How far angles are from images, on the circle."""
    return float(np.abs(np.exp(1j * angles) - np.exp(1j * images)).max())


def test_an_expanding_map_of_the_circle_keeps_its_digits():
    x = iterate(EXPANDING, x0=[0.1], n=LONG).states[:, 0]
    assert np.all((x >= -math.pi) & (x < math.pi))
    assert missed(x[1:], 2.0 * x[:-1] + 0.5 * np.sin(x[:-1])) < 4e-15
    mean = float(np.mean(np.log(2.0 + 0.5 * np.cos(x[1000:]))))
    found = lyapunov_spectrum(EXPANDING, {}, [0.1], average=Average(periods=LONG // 4))
    assert abs(found.exponents[0] - mean) < 3.0 * found.errors[0]
    assert run_sweep(EXPANDING, "k", [0.0, 0.5], x0=[0.1]).labels[0].tolist() == ["chaotic"] * 2


def test_arnold_s_cat_map_keeps_its_digits_and_has_the_exponents_of_its_matrix():
    x, y = iterate(CAT, x0=[0.1, 0.2], n=LONG).states.T
    assert missed(x[1:], 2.0 * x[:-1] + y[:-1]) < 4e-15
    assert missed(y[1:], x[:-1] + y[:-1]) < 4e-15
    found = lyapunov_spectrum(CAT, {}, [0.1, 0.2], average=Average(periods=1000))
    assert found.exponents == pytest.approx(np.log([(3.0 + math.sqrt(5.0)) / 2.0, (3.0 - math.sqrt(5.0)) / 2.0]))
    assert np.all(np.abs(found.x_end) <= math.pi)


@pytest.mark.parametrize("discard", [0, 1000])
def test_turns_of_a_rotation_are_counted_and_rounding_does_not_grow_with_them(discard):
    """A rotation by a fifth of a turn and two more is where it was after five iterations, however long it goes on."""
    turning = Map(("x",), {}, {"x": "x + 2*pi*11/5"}, angles=("x",))
    x = iterate(turning, x0=[0.3], n=10_000, discard=discard).states[:, 0]
    expected = 0.3 + TURN * 2.2 * np.arange(discard, discard + x.size)
    assert x == pytest.approx(expected, rel=1e-13)
    far = iterate(turning, x0=[0.3], discard=LONG, n=0).states[0, 0]
    assert far - TURN * 2.2 * LONG == pytest.approx(0.3, abs=1e-8)


def test_a_start_whole_turns_away_has_the_same_motion():
    here = iterate(CIRCLE, {"w": 1.0}, x0=[0.3], n=1000).states[:, 0]
    away = iterate(CIRCLE, {"w": 1.0}, x0=[0.3 + 5.0 * TURN], n=1000).states[:, 0]
    assert away - here == pytest.approx(np.full(1001, 5.0 * TURN), abs=1e-11)


def test_circle_maps_are_kept_as_plain_data(tmp_path):
    again = Map.from_definition(json.loads(json.dumps(CIRCLE.definition())))
    assert again == CIRCLE
    assert again.angles == ("x",)
    from saltus import load

    find_orbit(CIRCLE, x0=[0.3]).save(tmp_path / "orbit.nc")
    assert load(tmp_path / "orbit.nc").winding == {"x": 0}


def test_images_that_are_no_maps_of_the_circle_are_refused():
    with pytest.raises(DefinitionError, match="of period 2 pi in the angle 'x', but for whole turns"):
        Map(("x",), {}, {"x": "x/2"}, angles=("x",))
    with pytest.raises(DefinitionError, match="piece 'map' = 'y/2 \\+ x'"):
        Map(("x", "y"), {}, {"x": "x", "y": "y/2 + x"}, angles=("x",))
    assert Map(("x",), {}, {"x": "2*x"}, angles=("x",)).angles == ("x",)
