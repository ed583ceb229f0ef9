"""What a model was made of comes back from it: in this process, from a pickle, from a file, from an older file."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

import pytest

import saltus
from saltus import HybridSystem, InputError, afm
from saltus.afm.models.parts import UnknownLaw, driven_mode, parts_of, values_of
from saltus.afm.models.readings import drives_of, formulas, turns_of
from saltus.afm.probe.drive import Drives
from saltus.system.compiled import FLOW
from saltus.system.generated import source_file
from selection import guarding

TWO = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 450.0), R_nm=10.0, optical_weights=(1.0, 3.0))
ONE = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
VAN_DER_WAALS = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)

PARTS = {
    "one mode": (ONE, VAN_DER_WAALS, afm.Drive(A0_nm=12.0)),
    "one law": (ONE, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=12.0, at="peak")),
    "two modes": (TWO, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=20.0) + afm.Drive(A0_nm=1.0, mode=2, ratio="19/3")),
    "second mode": (TWO, afm.JKR(E_GPa=1.0, w_N_m=0.05), afm.Drive(A0_nm=1.0, mode=2, at=430.0)),
    "force": (TWO, afm.Hertz(E_GPa=1.0), afm.Drive.force(0.1, phase_deg=30.0)),
    "base": (TWO, VAN_DER_WAALS + afm.KelvinVoigt(eta_Pa_s=10.0, form="impulse"), afm.Drive.base(0.1)),
    "any ratio": (TWO, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=9.0) + afm.Drive(A0_nm=1.0, mode=2).at_any_ratio(6.267)),
}


@dataclass(frozen=True, kw_only=True)
class Yukawa(afm.Law):
    """A law of a user's own."""

    F_nN: float
    l_nm: float

    @property
    def regions(self):
        return {"everywhere": afm.Region("-F_nN*exp(-D_nm/l_nm)*l_nm/D_nm", domain="D_nm")}


@pytest.mark.parametrize("name", guarding(PARTS, "one mode", "any ratio"))
@pytest.mark.parametrize("way", [lambda s: s, lambda s: pickle.loads(pickle.dumps(s))], ids=["kept", "pickled"])
def test_probe_law_and_drives_come_back(name, way):
    probe, law, drive = PARTS[name]
    system = afm.model(probe, law, drive, Zc_nm=30.0)
    again = way(system)
    assert again == system
    assert parts_of(again) == (probe, law, Drives(drive.parts))


def test_parts_do_not_change_the_generated_code():
    system = afm.model(*PARTS["one mode"], Zc_nm=30.0)
    plain = {key: value for key, value in system.definition().items() if key != "made_of"}
    other = HybridSystem.from_definition(plain)
    assert other != system
    assert source_file(FLOW, other) == source_file(FLOW, system)


def test_a_law_of_ones_own_is_known_where_it_is_and_told_where_it_is_not():
    law = Yukawa(F_nN=1.0, l_nm=2.0)
    system = afm.model(ONE, law, afm.Drive(A0_nm=5.0), Zc_nm=10.0)
    assert parts_of(system).law is law
    found = parts_of(pickle.loads(pickle.dumps(system))).law
    assert found == UnknownLaw(name="Yukawa", values={"F_nN": 1.0, "l_nm": 2.0})
    assert found.parameters == law.parameters
    with pytest.raises(InputError, match="make the model again from the law where it is defined"):
        afm.model(ONE, found, afm.Drive(A0_nm=5.0), Zc_nm=10.0)


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["one mode", "one law", "two modes", "second mode", "force", "base"])
def test_a_model_of_an_older_file_has_the_same_readings(name):
    system = afm.model(*PARTS[name], Zc_nm=30.0)
    older = HybridSystem.from_definition({key: v for key, v in system.definition().items() if key != "made_of"})
    assert formulas(older) == formulas(system)
    assert driven_mode(older) == driven_mode(system)
    assert (drives_of(older), turns_of(older)) == (drives_of(system), turns_of(system))
    told, wanted = values_of(older, older.parameters), values_of(system, system.parameters)
    assert told == wanted
    assert [part.at for part in parts_of(older).drives.parts] == [part.at for part in parts_of(system).drives.parts]


def test_what_is_made_of_a_model_has_its_parts():
    system = afm.model(*PARTS["one mode"], Zc_nm=30.0)
    for other in (afm.feedback(system, 8.0, Ki_1_ms=1.0, tau_us=100.0), afm.self_excited(system, 10.0)):
        assert parts_of(other) == parts_of(system)


@pytest.mark.campaign
def test_parts_come_back_from_a_file(tmp_path):
    system = afm.model(*PARTS["one mode"], Zc_nm=14.5)
    orbit = afm.distance_curve(system, (14.0, 15.0)).at(14.5)[0]
    again = saltus.load(orbit.save(tmp_path / "orbit.nc"))
    assert parts_of(again.system) == parts_of(system)
    assert afm.observables(again) == afm.observables(orbit)


@pytest.mark.parametrize(
    "made_of",
    [
        {"saltus.afm": 3},
        {"saltus.afm": {"probe": {}}},
        {"saltus.afm": {"probe": {"Q": "x"}, "law": [{}], "drives": []}},
    ],
)
def test_damaged_parts_are_told(made_of):
    system = afm.model(*PARTS["one mode"], Zc_nm=30.0)
    damaged = HybridSystem.from_definition(system.definition() | {"made_of": made_of})
    with pytest.raises(InputError, match=r"made_of\['saltus.afm'\]"):
        parts_of(damaged)


def test_data_that_no_file_holds_are_refused():
    with pytest.raises(saltus.errors.DefinitionError, match="plain data"):
        HybridSystem.smooth({"x": "-x"}).from_definition(
            HybridSystem.smooth({"x": "-x"}).definition() | {"made_of": {"a": object()}}
        )
