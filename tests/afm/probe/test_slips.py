"""Values in nm, um, aJ or GPa that are given where SI units are taken."""

from __future__ import annotations

import warnings

import pytest

from saltus import afm

SAMPLE = {"R": 20e-9, "H": 2.96e-19, "E_star": 10.4e9, "a0": 2e-10}
BEAM = {"length": 240e-6, "width": 64e-6, "thickness": 2.1e-6, "density": 2300.0, "young": 176e9}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"R": 20.0}, r"^saltus: R = 20 m; in nm\? then it is 2e-08 m$"),
        ({"a0": 0.2}, r"^saltus: a0 = 0.2 m; in nm\? then it is 2e-10 m$"),
        ({"H": 0.296}, r"^saltus: H = 0.296 J; in aJ\? then it is 2.96e-19 J$"),
        ({"E_star": 10.4}, r"^saltus: E_star = 10.4 Pa; in GPa\? then it is 1.04e\+10 Pa$"),
    ],
)
def test_a_sample_in_customary_units_is_warned_of(change, told):
    with pytest.warns(RuntimeWarning, match=told):
        afm.DMTSample(**SAMPLE | change)


@pytest.mark.parametrize(("name", "value"), [("length", 240.0), ("width", 64.0), ("thickness", 2.1), ("young", 176.0)])
def test_a_beam_in_customary_units_is_warned_of(name, value):
    with pytest.warns(RuntimeWarning, match=rf"^saltus: {name} = {value:g} \w+; in (um|GPa)\? then it is"):
        afm.Cantilever(**BEAM | {name: value})


def test_metres_given_for_um_are_warned_of():
    beam = {"length_um": 240.0, "width_um": 64.0, "thickness_um": 2.1, "density_kg_m3": 2300.0, "young_GPa": 176.0}
    with pytest.warns(RuntimeWarning, match=r"^saltus: length_um = 0.00024 um; in m\? then it is 240 um$"):
        afm.Cantilever.from_geometry(**beam | {"length_um": 240e-6})


def test_a_gap_in_nm_is_warned_of():
    lever = afm.Cantilever.from_measured(k_N_m=2.0, f0_kHz=70.0, Q=200.0)
    with pytest.warns(RuntimeWarning, match=r"^saltus: eta = 60 m; in nm\? then it is 6e-08 m$"):
        afm.Setup(lever, afm.DMTSample(**SAMPLE), eta=60.0)


def test_values_in_si_units_are_taken_without_a_word():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        afm.Setup(afm.Cantilever(**BEAM), afm.DMTSample(**SAMPLE | {"H": 0.0, "E_star": 0.0}), eta=60e-9)
