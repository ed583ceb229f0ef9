"""The server lets in only who names it and knows its token; sessions stay in their folder."""

import http.client
import json
import socket
import subprocess
import sys
from multiprocessing import active_children
from types import SimpleNamespace

import pytest

import saltus
from saltus.afm.explorer_models import TAPPING
from saltus.errors import InputError, SaltusError
from saltus.explorer.opening import open_explorer
from saltus.explorer.server import Address, Office, free_port
from saltus.explorer.subjects import of_system
from screen import TOKEN, served


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with served(tmp_path_factory.mktemp("home"), "tapping-mode-1") as (found, _):
        yield found


def _asked(address: str, path: str = "/", **headers: str) -> tuple[int, str]:
    """Return the status of an answer and the cookie that it sets."""
    place = address.removeprefix("http://").rstrip("/")
    connection = http.client.HTTPConnection(place, timeout=120)
    try:
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.getheader("Set-Cookie") or ""
    finally:
        connection.close()


def test_a_page_needs_the_token(address):
    assert _asked(address)[0] == 403
    assert _asked(address, "/?token=guessed")[0] == 403
    status, cookie = _asked(address, f"/?token={TOKEN}")
    assert status == 200
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert _asked(address, Cookie=cookie.partition(";")[0])[0] == 200


@pytest.mark.parametrize("name", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "0.0.0.0"])
def test_a_server_that_is_called_otherwise_refuses(address, name):
    assert _asked(address, f"/?token={TOKEN}", Host=name)[0] == 403


@pytest.mark.parametrize(
    ("origin", "status"), [("http://evil.example", 403), ("null", 403), ("https://127.0.0.1", 403), ("", 101)]
)
def test_a_connection_from_another_origin_is_refused(address, origin, status):
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Protocol": "bokeh, token",
        "Origin": origin or address.rstrip("/"),
        "Cookie": f"saltus_token={TOKEN}",
    }
    answer = _asked(address, "/ws", **upgrade)[0]
    assert (answer == 403) == (status == 403)


def test_a_host_that_others_reach_needs_a_token():
    with pytest.raises(InputError, match="--token"):
        open_explorer(TAPPING, None, host="0.0.0.0", browser=False)
    with pytest.raises(InputError, match="at least 12 characters"):
        open_explorer(TAPPING, None, host="0.0.0.0", token="short", browser=False)
    assert "localhost:1" in Address(port=1).names
    assert "localhost:1" not in Address(host="192.0.2.1", port=1).names
    assert Address(port=1).token != Address(port=1).token


def test_a_port_that_is_taken_is_told_and_another_found():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        with pytest.raises(InputError, match="must be free"):
            free_port("127.0.0.1", taken)
    assert free_port("127.0.0.1", None) > 0


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
        assert _asked(place)[0] == 403
        assert _asked(place, "/" + token)[0] == 200
        taken = int(place.rpartition(":")[2])
        with pytest.raises(InputError, match="address = '127.0.0.1:"):
            saltus.explore(ball_on_table, port=taken)
    finally:
        for process in set(active_children()) - before:
            process.terminate()
    serving.join(30)


def test_a_session_without_results_leaves_nothing_behind(tmp_path, ball_on_table):
    office = Office(TAPPING, of_system(ball_on_table), tmp_path)
    office.desk("../../etc", None)
    office.desk("0123456789ab", None)
    assert len([*tmp_path.iterdir()]) == 2
    office.close()
    assert not [*tmp_path.iterdir()]


def test_an_upload_that_is_no_session_leaves_nothing_behind(tmp_path, ball_on_table):
    office = Office(TAPPING, of_system(ball_on_table), tmp_path)
    with pytest.raises(SaltusError):
        office.uploaded(b"no session")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["lever_s"], "did you mean 'lever-s'?"),
        (["nowhere.py:system"], "must be a file that exists"),
        (["--load", "nowhere.nc"], "must be a file that exists"),
        (["--host", "0.0.0.0"], "must be 127.0.0.1, or given with --token"),
    ],
)
def test_errors_of_the_command_are_one_line(arguments, line, tmp_path):
    command = [sys.executable, "-m", "saltus", "explore", "--no-browser", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 2
    assert line in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_system_in_a_file_is_explored(tmp_path, monkeypatch):
    (tmp_path / "swing.py").write_text(
        'import saltus\noscillator = saltus.HybridSystem.smooth({"x": "v", "v": "-x"})\n'
    )
    monkeypatch.chdir(tmp_path)
    assert json.loads(TAPPING.named("swing.py:oscillator").definition)["states"] == ["x", "v"]
