"""Opening the explorer: who may use it, and from where."""

import sys
from multiprocessing import active_children
from types import SimpleNamespace

import pytest

import saltus
from saltus.errors import InputError, SaltusError
from saltus.explorer.opening import open_explorer
from saltus.explorer.session import Session, new_folder
from saltus.progress import in_notebook
from screen import asked


def test_a_host_that_others_reach_needs_a_token(toys):
    with pytest.raises(InputError, match="--token"):
        open_explorer(toys, None, host="0.0.0.0", browser=False)
    with pytest.raises(InputError, match="at least 12 characters"):
        open_explorer(toys, None, host="0.0.0.0", token="short", browser=False)


@pytest.mark.parametrize("port", [0, 65536, 1.5])
def test_a_port_is_a_number_of_one(toys, port):
    with pytest.raises(InputError, match="port"):
        open_explorer(toys, None, port=port, browser=False)


def test_what_is_not_installed_is_named(toys, monkeypatch):
    monkeypatch.setitem(sys.modules, "panel", None)  # so Python takes it for absent
    with pytest.raises(SaltusError, match=r"the explorer needs panel: pip install 'saltus\[app\]'"):
        open_explorer(toys, None, browser=False)


def test_a_page_is_served_with_what_was_left_unfinished(toys, session, tmp_path, monkeypatch):
    served = {}

    def serve(office, address, **given):
        served.update(given, office=office, address=address)

    monkeypatch.setattr("saltus.explorer.server.serve", serve)
    monkeypatch.setattr("saltus.explorer.office.home_folder", lambda: session.folder.parent)
    for entry in session.entries[:1]:
        session.write(entry)
    left = new_folder(session.folder.parent)  # by a server that was killed
    Session(session.subject, left).keep()
    open_explorer(toys, session.subject, token="a-token-of-tests", browser=False)
    assert served["session"] == session.folder.name
    assert not left.exists()
    assert served["office"].application is toys
    assert served["address"].token == "a-token-of-tests"
    assert not served["browser"]


def test_a_script_is_no_notebook(monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert not in_notebook()
    for config, found in (({}, False), ({"IPKernelApp": {}}, True)):
        shell = SimpleNamespace(config=config)
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda shell=shell: shell))
        assert in_notebook() is found
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    assert not in_notebook()


@pytest.mark.campaign
def test_in_a_notebook_a_process_beside_the_kernel_serves_the_page(monkeypatch, tmp_path, ball_on_table):
    kernel = SimpleNamespace(config={"IPKernelApp": {}})
    shown = SimpleNamespace(IFrame=lambda address, **size: address)
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: kernel))
    monkeypatch.setitem(sys.modules, "IPython.display", shown)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    before = set(active_children())
    place, _, token = saltus.explore(ball_on_table).rpartition("/")
    (serving,) = set(active_children()) - before
    try:
        assert asked(place)[0] == 403
        assert asked(place, "/" + token)[0] == 200
        taken = int(place.rpartition(":")[2])
        with pytest.raises(InputError, match="address = '127.0.0.1:"):
            saltus.explore(ball_on_table, port=taken)
    finally:
        for process in set(active_children()) - before:
            process.terminate()
    serving.join(30)
