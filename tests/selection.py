"""Which cases of a test guard each change, which wait for the campaign, and which for a release."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

CAMPAIGN = (pytest.mark.campaign,)
THOROUGH = (pytest.mark.campaign, pytest.mark.thorough)


def guarding(cases: Iterable[Any], *kept: Any, campaign: int | None = None, spread: bool = False) -> list[Any]:
    """Return the parameters of a test: `make test` runs those kept, `make campaign` the others.

    A case that is a tuple is a row of several arguments. Where `campaign` is given, the campaign runs so many of the
    others, the first ones, and `make thorough` the rest. With `spread` they are spread evenly over the others.

    Raises
    ------
    ValueError
        One to be kept is none of the cases.
    """
    cases = list(cases)
    if unknown := [case for case in kept if case not in cases]:
        raise ValueError(f"{unknown} are none of the cases {cases}")
    parameters, others, left = [], 0, sum(case not in kept for case in cases)
    for case in cases:
        row = case if isinstance(case, tuple) else (case,)
        marks: tuple[pytest.MarkDecorator, ...] = ()
        if case not in kept:
            most = left if campaign is None else campaign
            runs = (others + 1) * most // left > others * most // left if spread else others < most
            marks = CAMPAIGN if runs else THOROUGH
            others += 1
        parameters.append(pytest.param(*row, marks=marks))
    return parameters
