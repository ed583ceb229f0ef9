"""Fields for numbers: what is allowed is taken, what is not is put back."""

from math import inf

import pytest

from saltus.explorer.numerics import Numerics
from saltus.explorer.views.numerics_view import NumericsView

pytestmark = pytest.mark.usefixtures("heard")


def test_a_number_is_taken_and_one_that_is_not_allowed_is_put_back(empty):
    changes, lines = [], []
    view = NumericsView(empty, lambda: changes.append(empty.settings.numerics), lines.append)
    view._fields["largest"].value = 0.02
    view._fields["max_points"].value = 40.2
    view._fields["largest"].value = -1.0
    assert view._fields["largest"].value == 0.02
    assert lines.pop().endswith(" = -1.0: must be greater than 0")
    view._fields["keep"].value = inf
    assert view._fields["keep"].value is None
    assert lines.pop().startswith("sweep keeps (100) = inf: must be a ")
    view._section.value = "z = 0.5"
    assert empty.settings.numerics == Numerics(largest=0.02, max_points=40, section="z = 0.5") == changes[-1]
    assert len(changes) == 3
