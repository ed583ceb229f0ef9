"""An application hands models to the explorer; what they are, only it knows."""

import pickle

import pytest

from saltus.errors import InputError


def test_a_model_is_made_by_its_key(toys, ball_on_table):
    assert toys.subject("bench").key == "bench"
    assert toys.subject("table").system.definition() == ball_on_table.definition()


def test_a_key_that_is_nearly_one_is_told(toys):
    with pytest.raises(InputError, match="must be one of table, bench, or FILE.py:NAME; did you mean 'table'"):
        toys.subject("tabel")


def test_an_argument_names_a_model_a_file_or_a_module(toys, tmp_path, monkeypatch):
    (tmp_path / "springs.py").write_text('import saltus\nspring = saltus.HybridSystem.smooth({"x": "v", "v": "-x"})\n')
    monkeypatch.chdir(tmp_path)
    assert toys.named("bench").key == "bench"
    assert toys.named("springs.py:spring").system.states == ("x", "v")
    assert toys.named("springs:spring").key == "springs:spring"
    with pytest.raises(InputError, match="FILE.py:NAME or MODULE:NAME"):
        toys.named("springs.py")


def test_an_application_is_handed_to_other_processes():
    from saltus.afm.explorer_models import TAPPING

    assert pickle.loads(pickle.dumps(TAPPING)) == TAPPING
