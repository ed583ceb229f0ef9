"""Residuals of readings with errors: distances to a circle, and fits to parabolas that come out right in the mean."""

import numpy as np
from scipy.optimize import least_squares

from saltus.afm.reconstruction.nearest_readings import NearestReadings


def test_residuals_are_distances_to_a_circle_and_leave_out_half_of_its_curvature():
    """With one error for all readings the nearest point of a circle is that of geometry."""
    radius, angles, off = 5.0, np.linspace(-0.6, 0.6, 7), np.linspace(-0.8, 0.8, 7)

    def shifts(x, centre, amplitude):
        return -np.sqrt(x[0] ** 2 - centre**2)

    reach = radius + off
    changed = np.array([[np.ones(7), np.zeros(7), np.zeros(7)], [np.zeros(7), np.zeros(7), np.ones(7)]])
    read = reach * np.sin(angles), np.ones(7), -reach * np.cos(angles)
    seen = NearestReadings(shifts, *read, changed, np.array([radius]))
    x = np.array([radius])
    np.testing.assert_allclose(seen.residuals(x), off, atol=1e-6)
    np.testing.assert_allclose(seen.jacobian(x)[:, 0], -1.0, atol=1e-5)
    seen.expect(x)
    np.testing.assert_allclose(seen.residuals(x), off - 0.5 / radius, atol=2e-3)


def test_a_fit_beside_errors_of_the_gap_is_right_in_the_mean():
    """A parabola from data whose gap and shift have an error of 1: its height was off by half an error."""
    random, gaps, true = np.random.default_rng(4), np.linspace(-5.0, 5.0, 60), np.array([0.5])

    def shifts(x, centre, amplitude):
        return x[0] + 0.1 * centre**2

    changed = np.array([[np.ones(60), np.zeros(60), np.zeros(60)], [np.zeros(60), np.zeros(60), np.ones(60)]])
    pulls = []
    for _ in range(100):
        read = gaps + random.normal(size=60), np.ones(60), shifts(true, gaps, None) + random.normal(size=60)
        seen = NearestReadings(shifts, *read, changed, np.ones(1))
        best = least_squares(seen.residuals, true, seen.jacobian)
        seen.expect(best.x)
        after = least_squares(seen.residuals, best.x, seen.jacobian)
        pulls.append([(one.x - true)[0] * np.linalg.norm(one.jac) for one in (best, after)])
    before, after = np.array(pulls).T
    assert abs(before.mean()) > 0.4
    assert abs(after.mean()) < 0.25
    assert 0.6 < np.mean(np.abs(after) < 1.0) < 0.76
