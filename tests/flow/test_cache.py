"""Where compiled code is kept."""

import os

from saltus.system.codegen import let_numba_cache


def test_numba_gets_a_folder_where_no_other_can_be_written(monkeypatch, tmp_path):
    monkeypatch.setenv("SALTUS_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    let_numba_cache()
    assert "NUMBA_CACHE_DIR" not in os.environ
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda path, how: str(path).startswith(str(tmp_path)) and allowed(path, how))
    let_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == str(tmp_path / "numba")
    monkeypatch.delenv("NUMBA_CACHE_DIR")


def test_a_chosen_folder_of_numba_is_kept(monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", "/chosen")
    let_numba_cache()
    assert os.environ["NUMBA_CACHE_DIR"] == "/chosen"
