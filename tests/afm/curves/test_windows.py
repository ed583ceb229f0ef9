"""Ways past windows of motions that are not followed, against motions that are followed on their own."""

import json

import numpy as np
import pytest

import saltus
from saltus import afm


@pytest.mark.campaign
def test_an_approach_to_an_adhesive_contact_goes_on_behind_its_first_touches():
    """Between the first touch and the tapping motion of period 1 there are long periods alone."""
    probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    system = afm.model(probe, afm.JKR(E_GPa=1.0, w_N_m=0.05), afm.Drive(A0_nm=20.0), Zc_nm=30.0)
    curve = afm.distance_curve(system, (14.0, 24.0))
    (window,) = curve.ways[0].windows
    assert window.begin == pytest.approx(20.0, abs=1e-6)  # it touches where the free amplitude is the distance
    assert window.end == pytest.approx(19.8425, abs=1e-4)
    assert window.words.startswith("the motion settles on a motion of period")
    assert [way.stopped for way in curve.ways] == [
        "Zc_nm = 14: the end of the range",
        "Zc_nm = 24: the end of the range",
    ]
    assert curve.jumps == ()
    path = curve.path("approach")
    assert json.loads(path.attrs["windows"]) == [list(window)]
    settled = saltus.find_orbit(system, {"Zc_nm": 15.0}, [0.0, 0.0])
    on_way = np.interp(-15.0, -path["Zc_nm"].values, path["amplitude_nm"].values)
    assert on_way == pytest.approx(afm.observables(settled)["amplitude_nm"], rel=1e-4)
    panel = curve.plot()[0]
    assert "window of other motions" in [text.get_text() for text in panel.get_legend().get_texts()]
