"""Pictures of curves: each reading, words of the instrument, the end of a way."""

from dataclasses import replace

import matplotlib.pyplot as plt
import pytest

from saltus import InputError, afm


@pytest.fixture(scope="module")
def curve():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=20.0), (5.0, 14.0))


def words(panel):
    return [text.get_text() for text in panel.get_legend().get_texts()]


@pytest.mark.campaign
def test_special_points_have_an_instruments_words_with_those_of_dynamics_beside(curve):
    panel = curve.plot()[0]
    assert {"jump (SN)", "onset of contact (GR)"} <= set(words(panel))
    plt.close("all")


@pytest.mark.campaign
def test_every_reading_and_formulas_are_drawn(curve):
    for name in curve.readings:
        (panel,) = curve.plot(name, legend=False, special=False)
        assert panel.get_ylabel()
        plt.close("all")
    panels = curve.plot(("amplitude_nm", "contact_fraction", "amplitude(deflection_nm, 6)"))
    assert [panel.get_ylabel() for panel in panels] == [
        "amplitude (nm)", "share of the time in contact", "amplitude(deflection_nm, 6)",
    ]  # fmt: skip
    plt.close("all")
    with pytest.raises(InputError, match="kind = 'indentation': must be one of apd, .*; did you mean 'indentation_nm'"):
        curve.plot("indentation")
    with pytest.raises(InputError, match="reading = 'lag_dg': must be .*; did you mean 'lag_deg'"):
        curve.plot(("amplitude_nm", "lag_dg"))
    with pytest.raises(InputError, match="kind = .*: must be at least one reading"):
        curve.plot(())
    with pytest.raises(InputError, match="ax = .*: must be 3 Axes, from the upper to the lower one"):
        curve.plot(("amplitude_nm", "lag_deg", "virial_eV"), ax=panels[:1])


@pytest.mark.campaign
def test_the_end_of_a_way_within_the_range_is_marked(curve):
    cut = replace(curve, bounds=(2.0, 14.0))
    assert "approach ends here" in words(cut.plot()[0])
    assert "approach ends here" not in words(curve.plot()[0])
    plt.close("all")
