"""Labels against what maps are known to do, rotation numbers against closed forms, thresholds by their text."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

import numpy as np
import pytest

from saltus.errors import InputError
from saltus.flow.motion_kind import classify
from saltus.flow.recurring.closed_curves import rotation_number
from saltus.flow.recurring.criteria import Criteria
from saltus.system.angles import TURN
from selection import guarding

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
KEPT = 100


def returns(image, start, count=KEPT, dropped=600):
    x = np.array(start, dtype=float)
    points = []
    for i in range(dropped + count):
        x = np.array(image(x))
        if i >= dropped:
            points.append(x)
    return np.array(points)


def logistic(r, **options):
    return returns(lambda x: r * x * (1.0 - x), [0.3], **options)


def delayed_logistic(c, beyond):
    """Points a little beyond the Neimark-Sacker bifurcation at a = 2 + c, of angle arccos((1 - c) / 2)."""
    a = 2.0 + c + beyond
    return returns(lambda x: (x[1], a * x[1] * (1.0 - x[0]) - c * (x[1] - x[0])), [0.55, 0.5], dropped=6000)


def on_circle(turns):
    return np.column_stack([np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)])


@pytest.mark.parametrize(
    ("r", "period"),
    # doublings at 3, 1 + sqrt 6, 3.5440903596, 3.5644072661; the window of period 3 begins at 1 + sqrt 8
    [(2.9, 1), (3.2, 2), (3.5, 4), (3.55, 8), (3.566, 16), (1.0 + math.sqrt(8.0) + 1e-3, 3)],
)
def test_logistic_map_has_its_period(r, period):
    points = logistic(r)
    multiplier = np.prod(r * (1.0 - 2.0 * points[-period:]))
    kind = classify(points, math.log(abs(multiplier)) / period, 1e-6)
    assert (kind.label, kind.period) == (f"period-{period}", period)


@pytest.mark.parametrize(("r", "dropped"), [(3.0 - 0.04, 100), (3.0 - 2e-3, 600), (3.0 + 2e-3, 400)])
def test_a_motion_still_settling_beside_a_doubling_has_the_period_it_settles_to(r, dropped):
    points = logistic(r, dropped=dropped)
    period, multiplier = (1, 2.0 - r) if r < 3.0 else (2, 4.0 + 2.0 * r - r**2)
    assert np.max(np.abs(points[period:] - points[:-period])) > 1e-5 * points.max()  # it has not settled
    exponent = math.log(abs(multiplier)) / period
    assert classify(points, exponent, 1e-5).period == period
    # nearer to the start differences shrink like a power of time, and where they end cannot be told
    assert classify(logistic(r, dropped=30), exponent, 1e-5).label in (f"period-{period}", "unresolved")


def test_a_motion_that_settles_slowly_to_a_point_has_the_period_one():
    """Beside a period doubling at a multiplier of -0.9995, two returns later it is as good as where it was."""
    points = 1.0 + 1e-3 * (-0.9995) ** np.arange(KEPT)[:, None]
    assert np.max(np.abs(points[2:] - points[:-2])) < 1e-5
    assert classify(points, math.log(0.9995), 1e-6).label == "period-1"


def test_a_doubled_motion_whose_halves_still_draw_together_has_the_period_two():
    n = np.arange(KEPT)[:, None]
    points = 1.0 + 0.1 * (-1.0) ** n * (1.0 + 0.3 * np.exp(-0.01 * n))
    assert np.all(np.diff(np.abs(np.diff(points, axis=0)), axis=0) < 0.0)
    assert classify(points, -0.01, 1e-6).label == "period-2"


def test_differences_within_rounding_are_none():
    points = 1e-12 * np.random.default_rng(2).standard_normal((KEPT, 2))
    assert classify(points, -0.1, 0.01, rounding=[1e-9, 1e-9]).label == "period-1"
    assert classify(points, -0.1, 0.01, rounding=[1e-9, 1e-14]).period == 0


def test_logistic_map_at_four_is_chaotic():
    assert classify(logistic(4.0 - 1e-12), math.log(2.0), 0.1).label == "chaotic"


def test_henon_map_is_chaotic():
    points = returns(lambda x: (1.4 - x[0] ** 2 + 0.3 * x[1], x[0]), [0.1, 0.1])
    assert classify(points, 0.4192, 0.1).label == "chaotic"


@pytest.mark.parametrize("c", [0.5, 0.2, -0.5, 0.8])
def test_rotation_beyond_a_torus_bifurcation_is_the_angle_of_its_multipliers(c):
    """It departs from it in proportion to the distance: half of that is left where the distance is halved."""
    angle = math.acos((1.0 - c) / 2.0) / (2.0 * math.pi)
    far, near = (classify(delayed_logistic(c, beyond), 0.0, 1e-4) for beyond in (8e-3, 4e-3))
    assert far.label == near.label == "quasi-periodic"
    assert near.rotation == pytest.approx(angle, abs=2e-3)
    assert abs(near.rotation - angle) < 0.7 * abs(far.rotation - angle)


def test_rotation_by_the_golden_mean_is_found_to_ten_digits():
    kind = classify(on_circle(GOLDEN * np.arange(KEPT)), 0.0, 1e-3)
    assert kind.rotation == pytest.approx(1.0 - GOLDEN, abs=1e-10)


@pytest.mark.parametrize("K", [0.3, 0.8])
def test_rotation_of_the_circle_map_is_the_mean_of_its_lift(K):
    """Over 100 points, against the mean over 200000 steps; weights make the error smaller than 1 / 100."""
    turn, lifted, points = 0.1, 0.0, []
    for i in range(200_000):
        step = GOLDEN - K / (2.0 * math.pi) * math.sin(2.0 * math.pi * turn)
        lifted += step
        turn = (turn + step) % 1.0
        if i < KEPT:
            points.append(turn)
    mean = lifted / 200_000
    rotation, curves = rotation_number(on_circle(np.array(points)), Criteria())
    assert rotation == pytest.approx(min(mean, 1.0 - mean), abs=1e-4)
    assert curves == 1


def test_two_curves_visited_in_turn_are_two():
    n = np.arange(2 * KEPT)
    points = 0.2 * on_circle(GOLDEN * (n // 2)) + np.column_stack([(-1.0) ** n, 0.0 * n])
    kind = classify(points, 0.0, 1e-3)
    assert (kind.label, kind.curves) == ("quasi-periodic", 2)
    assert kind.rotation == pytest.approx(1.0 - GOLDEN, abs=1e-9)


def test_a_long_period_on_a_closed_curve_is_locked_at_a_fraction():
    kind = classify(on_circle(3.0 / 17.0 * np.arange(KEPT)), -0.05, 0.01)
    assert (kind.label, kind.period, kind.rotation) == ("locked-17", 17, 3.0 / 17.0)
    longer = Criteria(longest=17)
    assert classify(on_circle(3.0 / 17.0 * np.arange(KEPT)), -0.05, 0.01, longer).label == "period-17"


def test_a_long_period_that_is_on_no_curve_is_a_period():
    rng = np.random.default_rng(3)
    points = np.tile(rng.standard_normal((11, 2)) + 10.0, (10, 1))
    points[:, 1] *= 1e-6
    assert classify(points[:, :1], -0.05, 0.01).label == "period-11"


def test_without_a_clear_exponent_points_on_no_curve_are_unresolved():
    rng = np.random.default_rng(1)
    assert classify(rng.standard_normal((KEPT, 3)), 0.0, 0.1).label == "unresolved"
    assert classify(rng.standard_normal((KEPT, 3)), -0.2, 0.1).label == "unresolved"
    assert classify(rng.standard_normal((KEPT, 3)), 0.15, 0.1).label == "unresolved"
    assert classify(rng.standard_normal((KEPT, 3)), 0.25, 0.1).label == "chaotic"
    assert classify(on_circle(GOLDEN * np.arange(KEPT)), 0.0, 0.1).label == "quasi-periodic"


def test_units_of_the_states_do_not_matter():
    points = delayed_logistic(0.5, 0.01)
    scaled = points * [1e-9, 1e3]
    assert classify(scaled, 0.0, 1e-3).label == "quasi-periodic"


def test_a_period_is_seen_four_times_or_not_at_all():
    rng = np.random.default_rng(5)
    orbit = rng.standard_normal((25, 3))
    assert classify(np.tile(orbit, (4, 1)), 0.0, 0.1).period == 25
    assert classify(np.tile(orbit, (4, 1))[:-1], 0.0, 0.1).period == 0


def test_the_label_of_one_point_is_period_one_only_if_it_rests():
    assert classify([[1.0, 2.0]] * 2, -0.1, 0.01).label == "period-1"


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"recurrence": 0.0}, r"^Criteria\.recurrence = 0\.0: must be a number between 0 and 1$"),
        ({"exponent": -0.1}, r"^Criteria\.exponent = -0\.1: must be a number between 0 and 1$"),
        ({"longest": 0}, r"^Criteria\.longest = 0: must be an integer >= 1$"),
        ({"patience": 1.5}, r"^Criteria\.patience = 1\.5: must be an integer >= 1$"),
        ({"fewest": 8}, r"^Criteria\.fewest = 8: must be an integer >= 16$"),
        ({"push": 1.0}, r"^Criteria\.push = 1\.0: must be a number between 0 and 1$"),
        ({"noise": 0.0}, r"^Criteria\.noise = 0\.0: must be a finite number > 0$"),
        ({"absence": math.inf}, r"^Criteria\.absence = inf: must be a finite number > 0$"),
    ],
)
def test_a_threshold_that_cannot_be_used_is_told(option, message):
    with pytest.raises(InputError, match=message):
        Criteria(**option)


def test_thresholds_of_numpy_are_plain_numbers():
    criteria = Criteria(longest=np.int64(8), settling=np.float32(0.25))
    assert json.loads(json.dumps(asdict(criteria))) == asdict(Criteria(settling=0.25))


@pytest.mark.parametrize(("keep", "longest", "looked_at"), [(1, 8, 100), (300, 8, 300), (100, 50, 200)])
def test_a_label_is_founded_on_enough_returns(keep, longest, looked_at):
    assert Criteria(longest=longest).looked_at(keep) == looked_at


@pytest.mark.parametrize("count", range(1, 9))
def test_every_closed_curve_is_counted(count):
    returns = np.arange(400)
    middles = np.exp(2j * math.pi * returns * ROUND[count] / count) if count > 1 else 0.0
    points = middles + 0.05 * np.exp(2j * math.pi * 0.381966 * (returns // count))
    rotation, curves = rotation_number(np.column_stack([points.real, points.imag]), Criteria())
    assert curves == count
    assert rotation == pytest.approx(0.381966, abs=1e-6)


ROUND = {1: 1, 2: 1, 3: 1, 4: 1, 5: 2, 6: 1, 7: 3, 8: 3}
"""How many places round the ring of curves a return goes on."""


@pytest.mark.parametrize("turns", [0.40001, 0.250001, 0.1234567])
def test_one_closed_curve_near_a_fraction_is_one(turns):
    points = np.exp(2j * math.pi * turns * np.arange(400))
    rotation, curves = rotation_number(np.column_stack([points.real, points.imag]), Criteria())
    assert (curves, rotation) == (1, pytest.approx(turns, abs=1e-6))


@pytest.mark.parametrize("period", [9, 12, 16, 24])
def test_a_long_period_off_a_closed_curve_is_mostly_seen_as_a_period(period):
    rng = np.random.default_rng(period)
    clouds = [np.tile(rng.normal(size=(period, 2)), (200 // period + 1, 1)) for _ in range(100)]
    assert sum(classify(points, -0.3, 0.01).label == f"period-{period}" for points in clouds) >= 70


@pytest.mark.parametrize(("period", "places"), [(9, 2), (10, 1), (13, 5), (20, 3)])
def test_a_long_period_on_a_closed_curve_is_locked_whatever_the_count_of_returns(period, places):
    for count in (100, 137, 200, 1000):
        angle = 2.0 * math.pi * places * np.arange(count) / period
        radius = 1.0 + 0.1 * np.cos(angle)
        kind = classify(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), -0.01, 0.001)
        assert (kind.label, kind.rotation) == (f"locked-{period}", min(places, period - places) / period)


@pytest.mark.parametrize("rotation", [0.13681, 0.381966, 0.0731])
def test_a_circle_that_a_reset_has_cut_is_quasi_periodic(rotation):
    """Where its exponent leaves chaos open; the circle x is seen through an increasing function."""
    turns = (rotation * np.arange(400) + 0.3) % 1.0
    kind = classify(np.column_stack([turns**3 + turns]), 0.01, 0.03)
    assert (kind.label, kind.curves) == ("quasi-periodic", 1)
    assert kind.rotation == pytest.approx(rotation, abs=1e-3)


@pytest.mark.parametrize("height", [3.6, 3.8, 4.0])
def test_points_of_a_map_that_folds_are_no_torus_where_the_exponent_leaves_it_open(height):
    x = [0.3]
    for _ in range(400):
        x.append(height * x[-1] * (1.0 - x[-1]))
    assert classify(np.array(x)[1:, None], 0.01, 0.03).label == "unresolved"


def test_a_rotation_by_nearly_a_fraction_is_no_period():
    """Two turns in 89 and a millionth: it comes back to 1e-5, and creeps on."""
    turns = (2.0 + 1e-6) / 89.0
    kind = classify(on_circle(turns * np.arange(4000)), 0.0, 0.0)
    assert (kind.label, kind.period) == ("quasi-periodic", 0)
    assert classify(on_circle(2.0 / 89.0 * np.arange(4000)), 0.0, 0.0, rounding=1e-14).label == "locked-89"


@pytest.mark.parametrize(("modulus", "angle"), [(0.9985, 0.31), (0.9995, 1.0472), (0.9999, 2.0), (0.99, 0.05)])
def test_a_slow_spiral_to_a_point_is_no_torus(modulus, angle):
    for count in (100, 400, 1600):
        z = 0.3 * (modulus * np.exp(1j * angle)) ** np.arange(count)
        kind = classify(np.column_stack([2.0 + z.real, 1.0 + z.imag]), math.log(modulus), 1e-9)
        assert kind.label in ("period-1", "unresolved")
    assert kind.label == "period-1" or modulus == 0.9999


def test_growth_like_time_is_no_chaos():
    """On the tori of a shear perturbations grow like the count of returns: the exponent is the logarithm over it."""
    turns = GOLDEN * np.arange(1000)
    assert classify(on_circle(turns), 0.9 * math.log(1000) / 1000, 1e-4).label == "quasi-periodic"


def test_chaos_in_narrow_bands_is_no_period():
    """A tent map of slope 1.02 visits bands of a millionth of its extent."""
    x, points = 0.1, []
    for i in range(3000):
        x = 1.02 * min(x, 1.0 - x)
        if i >= 2600:
            points.append([x])
    assert np.ptp(points[::32]) < 1e-5
    assert classify(points, math.log(1.02), 0.0).label == "chaotic"


def test_the_map_of_grebogi_and_others_is_strange_and_not_chaotic():
    """C. Grebogi, E. Ott, S. Pelikan, J. A. Yorke, Physica D 13 (1984) 261: for s > 1 by proof; else x = 0."""
    for s, label in ((1.5, "strange nonchaotic"), (0.5, "quasi-periodic")):
        x, points = 0.5, []
        for turn in GOLDEN * np.arange(9000):
            points.append([x, math.cos(2.0 * math.pi * turn), math.sin(2.0 * math.pi * turn)])
            x = 2.0 * s * math.tanh(x) * points[-1][1]
        assert classify(points[1000:], 0.0, 1e-3).label == label


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_an_angle_that_was_not_said_to_be_one_is_no_strange_set(size):
    """Two drives without a common period: the phase of the second goes on, and shifts where the points go round."""
    turns = GOLDEN * np.arange(100)
    circle = np.exp(2j * np.pi * turns)
    wobble = 0.02 * np.exp(-0.1 * turns) * np.cos(2.0 * np.pi * 7.3 * turns)
    points = np.column_stack([circle.real, 2.0 * circle.imag + wobble, size * turns])
    for order in ([0, 1, 2], [2, 0, 1]):
        assert classify(points[:, order], 0.0, 0.04).label != "strange nonchaotic"


def test_the_work_on_a_label_is_in_proportion_to_the_returns():
    from time import process_time

    spent = []
    for count in (4000, 40_000):
        points = logistic(3.99, count=count)
        began = process_time()
        classify(points, 0.6, 0.01)
        spent.append(process_time() - began)
    assert spent[1] < 40.0 * max(spent[0], 1e-3)


def on_a_circle(turns, count):
    angle = TURN * turns * np.arange(count)
    return np.column_stack([np.cos(angle) + 0.3 * np.cos(2.0 * angle + 1.0), 1e-9 * np.sin(angle)])


def on_two_circles(turns, count):
    k = np.arange(count)
    angle = TURN * turns * (k // 2)
    return np.column_stack([3.0 * (-1.0) ** k + 0.5 * np.cos(angle), np.sin(angle)])


def on_a_torus(turns, count):
    one, other = TURN * turns * np.arange(count), TURN * math.sqrt(7.0) * np.arange(count)
    return np.column_stack([np.cos(one) + 0.3 * np.cos(other), np.sin(one) + 0.3 * np.sin(other), np.cos(other)])


ROTATIONS = [GOLDEN, math.sqrt(2.0) - 1.0, math.pi - 3.0]
ROTATIONS += np.random.default_rng(5).uniform(0.05, 0.95, 12).tolist()


@pytest.mark.parametrize("points", [on_a_circle, on_two_circles, on_a_torus])
@pytest.mark.parametrize(
    ("turns", "count"),
    guarding(
        [(turns, count) for turns in ROTATIONS for count in (1600, 5000, 20_000, 80_000)],
        *((turns, count) for turns in ROTATIONS[:2] for count in (1600, 20_000)),
        (ROTATIONS[0], 80_000),
    ),
)
def test_the_label_of_a_rotation_is_the_same_for_every_count_of_points(points, turns, count):
    assert classify(points(turns, count), 0.0, 1e-3).label == "quasi-periodic"
