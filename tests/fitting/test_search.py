"""The search that goes on from other starts, on closed forms with several valleys."""

import math

import numpy as np
import pytest

from closed_forms import ClosedForm, X, decaying, noise
from saltus.fitting.optimum import FOUND, INTERRUPTED, minimised
from saltus.fitting.search import largest_chi2, searched

BOUNDS = np.array([[0.1, 0.5], [10.0, 12.0]])
FAR = np.array([1.0, 9.0])  # from here the rate ends in a valley beside the best one
PER_PARAMETER = 6  # starts that are looked at


def wave(x, a, w):
    return a * np.sin(w * x)


def waving(spread=0.05, extra=0.0, **how):
    """Data of a wave; the loss over its frequency has many valleys."""

    def slopes(x, a, w):
        return [np.sin(w * x), a * x * np.cos(w * x)]

    y = wave(X, 2.0, 3.0) + spread * noise(4) + extra
    return ClosedForm(wave, slopes, y, spread, ("a", "w"), **how)


def test_the_largest_chi2_of_data_that_fit_is_five_standard_deviations_above_one():
    assert largest_chi2(50) == pytest.approx(1.0 + 5.0 * math.sqrt(2.0 / 50.0), rel=1e-14)
    assert largest_chi2(0) == largest_chi2(1)
    assert largest_chi2(10**12) == pytest.approx(1.0, abs=1e-5)


def test_a_search_alone_ends_in_the_valley_it_starts_in_and_further_starts_leave_it():
    alone = minimised(waving(), FAR, BOUNDS, most=60)
    assert abs(alone.values[1] - 3.0) > 1.0
    found = searched(waving(), FAR, BOUNDS, 60)
    assert found.values == pytest.approx([2.0, 3.0], abs=0.1)
    assert found.stopped == FOUND
    assert found.loss < 0.01 * alone.loss


def test_the_same_search_twice_gives_the_same():
    one, two = (searched(waving(), FAR, BOUNDS, 60) for _ in range(2))
    assert one.values.tolist() == two.values.tolist()
    assert one.loss == two.loss


def test_where_the_data_fit_no_further_start_is_looked_at():
    objective = decaying()
    found = searched(objective, np.array([1.0, 1.5]), np.array([[0.01, 0.01], [20.0, 20.0]]), 60)
    alone = decaying()
    minimised(alone, np.array([1.0, 1.5]), np.array([[0.01, 0.01], [20.0, 20.0]]), most=60)
    assert len(objective.places) == len(alone.places)
    assert found.stopped == FOUND


@pytest.mark.parametrize(("wild", "more"), [(1, False), (2, True)])
def test_one_wild_datum_asks_for_no_further_start_and_two_of_few_do(wild, more):
    objective = decaying()
    objective.y = objective.y + 5.0 * (np.arange(len(X)) < wild)
    found = searched(objective, np.array([2.0, 0.7]), np.array([[0.01, 0.01], [20.0, 20.0]]), 60)
    assert (found.stopped != FOUND) == more


def test_data_that_nothing_fits_are_told_with_the_number_of_starts():
    found = searched(waving(extra=5.0 * np.cos(X) ** 2), FAR, BOUNDS, 60)
    assert found.stopped.startswith("no better fit is found from ")
    assert 3 <= int(found.stopped.split()[-2]) <= 6


def test_further_starts_lie_within_the_bounds_and_half_of_them_about_the_start_or_the_best():
    objective = waving(extra=5.0 * np.cos(X) ** 2)
    rough = []
    objective.rough_loss = lambda place: rough.append(place.copy()) or np.inf
    searched(objective, FAR, BOUNDS, 60)
    best = objective.best[1]
    assert len(rough) == PER_PARAMETER * 2
    assert all(np.all((BOUNDS[0] <= place) & (place <= BOUNDS[1])) for place in rough)
    for k, place in enumerate(rough[::2]):
        about = (FAR, best)[k % 2]
        assert np.all((about / 3.0 * (1.0 - 1e-12) <= place) & (place <= 3.0 * about * (1.0 + 1e-12)))
    assert len({tuple(place) for place in rough}) == len(rough)


def test_starts_of_negative_and_vanishing_values_are_within_bounds_of_any_sign():
    bounds = np.array([[-9.0, -4.0], [-0.5, 4.0]])
    objective = waving(extra=5.0 * np.cos(X) ** 2)
    rough = []
    objective.rough_loss = lambda place: rough.append(place.copy()) or np.inf
    searched(objective, np.array([-1.0, 0.0]), bounds, 60)
    table = np.array(rough)
    assert np.all((table >= bounds[0]) & (table <= bounds[1]))
    assert np.ptp(table[:, 1]) > 4.0  # of a start at 0 anything within the bounds
    near = table[0::4, 0]
    assert np.all((near >= -3.0) & (near <= -1.0 / 3.0))


def test_places_without_a_model_are_no_starts():
    objective = waving(wall=lambda a, w: "no orbit" if w < 2.0 or a > 8.0 else "")
    found = searched(objective, FAR, BOUNDS, 60)
    assert found.values == pytest.approx([2.0, 3.0], abs=0.1)


@pytest.mark.parametrize("more", [1, 20])
def test_an_interrupt_after_the_first_search_keeps_its_end_or_better(more):
    alone = waving()
    first = minimised(alone, FAR, BOUNDS, most=60)
    found = searched(waving(stop_at=alone.evaluations + more), FAR, BOUNDS, 60)
    assert found.stopped == INTERRUPTED
    assert found.is_interrupted
    assert found.loss <= first.loss


class Hidden:
    """A trace that can begin anew, as of a curve whose sheets are found from its beginning."""

    branches, whole = (), True


def test_sheets_that_appear_when_traced_anew_are_searched_on():
    """The known branches give a response 1 off; traced anew the model has the one that the data show."""
    objective = decaying(seed=None)
    tried = objective._tried

    def with_sheets(values, *, anew):
        found = tried(values, anew=anew)
        if not anew and abs(values[0] - 2.0) > 1e-3:  # far from the right place the better sheet is lost
            found.residuals = found.rough = np.append(found.residuals[:-1], 20.0 + 100.0 * (values[0] - 1.9))
            found.jacobian[-1] = [100.0, 0.0]
        return found

    objective._tried = with_sheets
    objective.trace = Hidden()
    found = searched(objective, np.array([1.0, 1.5]), np.array([[0.01, 0.01], [20.0, 20.0]]), 60)
    assert found.values == pytest.approx([2.0, 0.7], rel=1e-6)
    assert found.loss < 1e-9
