"""Means of motions by weights that fade at both ends, against closed forms; rough graphs over a circle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus.flow.recurring.smoothness import course_of, is_rough, weighted_mean

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@pytest.mark.parametrize("harmonic", [1, 2, 5])
def test_a_weighted_mean_over_a_rotation_has_the_digits_that_a_plain_one_lacks(harmonic):
    angles = 2.0 * np.pi * GOLDEN * harmonic * np.arange(4000)
    values = np.exp(np.cos(angles))  # its mean is the Bessel function I0(1)
    exact = 1.2660658777520083
    assert abs(float(weighted_mean(values)) - exact) < 1e-12
    assert abs(values.mean() - exact) > 1e-7


def test_a_rotation_goes_on_smoothly_and_a_chaotic_map_does_not():
    turns = 2.0 * np.pi * GOLDEN * np.arange(3000)
    assert course_of(np.column_stack([np.cos(turns), np.sin(turns)])).smooth
    points = np.empty(3000)
    points[0] = 0.3
    for i in range(1, 3000):
        points[i] = 4.0 * points[i - 1] * (1.0 - points[i - 1])
    assert not course_of(points[:, None]).smooth


@pytest.mark.parametrize(("strength", "rough"), [(1.5, True), (0.4, False)])
def test_the_attractor_of_grebogi_and_others_is_rough_where_it_is_strange(strength, rough):
    """C. Grebogi, E. Ott, S. Pelikan, J. A. Yorke, Physica D 13 (1984) 261: strange and nonchaotic for s > 1."""
    turns, x, rows = 0.1, 0.5, []
    for i in range(9000):
        x, turns = 2.0 * strength * math.tanh(x) * math.cos(2.0 * math.pi * turns), (turns + GOLDEN) % 1.0
        if i >= 1000:
            rows.append((math.cos(2.0 * math.pi * turns), math.sin(2.0 * math.pi * turns), x))
    assert is_rough(np.array(rows)) is rough
