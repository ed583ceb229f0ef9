"""Tapping mode in the explorer: models by key, what their instrument shows, films."""

import pytest

from saltus.afm import observables, parts_of
from saltus.afm.explorer_models import TAPPING
from saltus.afm.files.configuration import named_experiment
from saltus.afm.files.sets import names
from saltus.errors import InputError
from saltus.orbits import find_orbit
from selection import guarding


def test_models_are_the_papers_and_the_parameter_sets():
    assert set(TAPPING.titles) == {"tapping-mode-1", "tapping-mode-2", *names()}
    assert all(TAPPING.titles.values())
    with pytest.raises(InputError, match="did you mean 'lever-s'"):
        TAPPING.subject("lever_s")


@pytest.mark.parametrize(
    "key", guarding(["tapping-mode-1", "tapping-mode-2", "lever-s", "adhesive-jkr"], "tapping-mode-1", "lever-s")
)
def test_the_python_of_a_model_makes_it_again(key):
    subject, told = TAPPING.subject(key), {}
    exec("\n".join(subject.lines), told)
    assert told["system"].definition() == subject.system.definition()
    assert len(subject.x0) in (0, len(subject.system.states))
    assert set(subject.ranges) <= set(subject.system.parameter_names)


def test_a_set_is_explored_along_its_curve():
    subject, experiment = TAPPING.subject("lever-s"), named_experiment("lever-s")
    assert subject.ranges == {experiment.curve["along"]: tuple(experiment.curve["range"])}
    assert parts_of(subject.system) == parts_of(experiment.model())


@pytest.mark.campaign
def test_what_taps_can_be_filmed(ball_on_table):
    for key in TAPPING.titles:
        assert TAPPING.films(TAPPING.subject(key).system)
    assert not TAPPING.films(ball_on_table)


def test_a_model_in_nm_has_an_instrument_and_the_papers_has_none(tmp_path):
    paper = TAPPING.subject("tapping-mode-1")
    orbit = find_orbit(paper.system, {"Omega": 1.05}, list(paper.x0))
    assert TAPPING.readings(orbit) == {}
    lever = TAPPING.subject("lever-s").system
    swinging = find_orbit(lever, {"Zc_nm": 14.0}, [0.0] * len(lever.states))
    assert TAPPING.readings(swinging) == observables(swinging)
