"""Judgements of equality: yes, no, cannot tell."""

from __future__ import annotations

import numpy as np
import pytest

from saltus.scales import Scales, Verdict, near, same, zero


def test_within_the_error_is_the_same_far_beyond_is_not_between_cannot_be_told() -> None:
    verdicts = [same(1.0, 1.0 + d, 1e-6) for d in (5e-7, 5e-6, 5e-5)]
    assert verdicts == [Verdict.YES, Verdict.UNCLEAR, Verdict.NO]
    assert [bool(v) for v in verdicts] == [True, False, False]


def test_one_state_that_differs_clearly_outweighs_the_others() -> None:
    assert same([1.0, 0.0], [1.0, 1.0], [1.0, 1e-9]) is Verdict.NO


def test_what_is_no_number_cannot_be_told() -> None:
    assert zero(np.nan, 1.0) is Verdict.UNCLEAR


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_change_of_units_changes_no_verdict(unit: float) -> None:
    for difference in (1e-7, 1e-5, 1e-3):
        one = Scales(1e-6, np.array([1e-9]), np.array([1.0]), residual=2.0)
        other = Scales(1e-6, np.array([1e-9 * unit]), np.array([unit]), residual=2.0)
        assert same(1.0, 1.0 + difference, one.errors) is same(unit, unit * (1.0 + difference), other.errors)


def test_near_allows_the_rounding_of_both() -> None:
    assert near(np.nextafter(1e9, 2e9), 1e9, 0.0)
    assert near(1.0 + 1e-12, 1.0, 0.0) is Verdict.NO
