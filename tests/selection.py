"""Which cases of a test guard each change, and which wait for the campaign."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def guarding(cases: Iterable[Any], *kept: Any) -> list[Any]:
    """Return the parameters of a test: `make test` runs those kept, `make campaign` the others.

    A case that is a tuple is a row of several arguments.

    Raises
    ------
    ValueError
        One to be kept is none of the cases.
    """
    cases = list(cases)
    if unknown := [case for case in kept if case not in cases]:
        raise ValueError(f"{unknown} are none of the cases {cases}")
    rows = [case if isinstance(case, tuple) else (case,) for case in cases]
    return [
        pytest.param(*row, marks=() if case in kept else pytest.mark.campaign)
        for case, row in zip(cases, rows, strict=True)
    ]
