"""Wrong objects at the doors of the AFM models are told in one line."""

import numpy as np
import pytest

from saltus import InputError, afm


@pytest.mark.parametrize("wrong", [None, 3, "a", [1, 2], {}, np.zeros(2), object()])
def test_a_system_that_is_none_is_told_at_every_door(wrong):
    doors = (
        lambda: afm.distance_curve(wrong, (1.0, 10.0)),
        lambda: afm.frequency_curve(wrong, (290.0, 310.0)),
        lambda: afm.bistability(wrong),
        lambda: afm.feedback(wrong, 8.0, Ki_1_ms=1.0, tau_us=50.0),
        lambda: afm.self_excited(wrong, 10.0),
        lambda: afm.frequency_shift(wrong, (1.0, 10.0), 5.0),
        lambda: afm.tip_radius(wrong, 10.0),
    )
    for door in doors:
        with pytest.raises(InputError, match="must be a HybridSystem"):
            door()


def test_a_list_of_drives_is_taken_and_another_list_is_told():
    probe, law = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=450.0, R_nm=9.0), afm.Hertz(E_GPa=50.0)
    drives = [afm.Drive(A0_nm=10.0), afm.Drive(A0_nm=1.0, ratio=6)]
    listed, added = (afm.model(probe, law, drive, Zc_nm=9.0) for drive in (drives, drives[0] + drives[1]))
    assert listed.definition() == added.definition()
    for wrong in ([], [3], [afm.Drive(A0_nm=10.0), None], None, 3, afm.Drive):
        with pytest.raises(InputError, match="drive = .*: must be a Drive, a sum of them, or a sequence of them"):
            afm.model(probe, law, wrong, Zc_nm=9.0)
