"""Tapping mode by values alone: what changes is what was named."""

from __future__ import annotations

import pytest

from saltus.afm import Cantilever, Setup, table1, tapping_mode
from saltus.afm.paper.variations import VALUES, tapping_mode_with, varied
from saltus.errors import InputError


def test_without_values_it_is_the_paper_s_model():
    assert tapping_mode_with(modes=2) == tapping_mode(table1(), modes=2)


def test_each_value_reaches_its_part_and_no_other():
    paper = table1()
    found = varied(paper, eta=80e-9, H=1e-19, thickness=3e-6)
    assert found.eta == 80e-9
    assert (found.sample.H, found.sample.R) == (1e-19, paper.sample.R)
    assert (found.cantilever.thickness, found.cantilever.length) == (3e-6, paper.cantilever.length)
    assert found.cantilever.f0 == pytest.approx(paper.cantilever.f0 * 3e-6 / 2.1e-6)


def test_a_measured_cantilever_takes_the_place_of_the_geometry():
    found = varied(table1(), k=2.0, f0=70e3, Q=200.0)
    assert found == Setup(Cantilever.from_measured(k=2.0, f0=70e3, Q=200.0), table1().sample, table1().eta)


@pytest.mark.parametrize("values", [{"k": 2.0}, {"k": 2.0, "f0": 7e4, "Q": 200.0, "length": 1e-4}])
def test_a_half_measured_cantilever_is_told(values):
    with pytest.raises(InputError, match="must be all of k, f0, Q, and no geometry beside them"):
        varied(table1(), **values)


def test_a_value_of_another_name_is_told():
    with pytest.raises(InputError, match=f"value = 'etta': must be one of {', '.join(VALUES)}; did you mean 'eta'"):
        varied(table1(), etta=1.0)
    with pytest.raises(
        InputError, match="key = 'mods': must be one of modes, static_term, eta, .*; did you mean 'modes'"
    ):
        tapping_mode_with(mods=2)
