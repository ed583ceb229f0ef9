"""The server lets in only who names it and knows its token; sessions stay in their folder."""

import asyncio
import logging
import socket
import subprocess
import sys
from errno import EADDRINUSE
from pathlib import Path
from types import SimpleNamespace

import pytest
from bokeh.server.connection import ServerConnection

from saltus.errors import InputError
from saltus.explorer import server
from saltus.explorer.server import LEFT, Address, listening
from screen import TOKEN, apart, asked, served


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    with served(tmp_path_factory.mktemp("home"), "tapping-mode-1") as (found, _):
        yield found


def test_a_page_needs_the_token(address):
    assert asked(address)[0] == 403
    assert asked(address, "/?token=guessed")[0] == 403
    status, cookie = asked(address, f"/?token={TOKEN}")
    assert status == 200
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert asked(address, Cookie=cookie.partition(";")[0])[0] == 200


@pytest.mark.parametrize("name", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "0.0.0.0"])
def test_a_server_that_is_called_otherwise_refuses(address, name):
    assert asked(address, f"/?token={TOKEN}", Host=name)[0] == 403


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
    answer = asked(address, "/ws", **upgrade)[0]
    assert (answer == 403) == (status == 403)


def test_a_server_has_the_names_of_its_machine():
    assert "localhost:1" in Address(port=1).names
    assert "localhost:1" not in Address(host="192.0.2.1", port=1).names
    assert Address(port=1).token != Address(port=1).token


@pytest.fixture
def taken():
    """Return a port on which another program listens."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_port_that_is_taken_is_told(taken):
    with pytest.raises(InputError, match="must be free; another program listens there"):
        listening(None, Address(port=taken))


def test_where_the_usual_port_is_taken_another_is_found(taken, monkeypatch):
    monkeypatch.setattr(server, "_PORT", taken)

    def ports() -> tuple[int, Address]:
        found, address = listening(None, Address())
        found.stop()
        found.io_loop.close()
        return found.port, address

    port, address = apart(ports)
    assert port == address.port != taken
    assert f"127.0.0.1:{port}" in address.names


def test_where_another_program_is_faster_the_next_port_is_tried(monkeypatch):
    asked = []

    def serve(pages, *, port, **options):
        asked.append(port)
        if len(asked) < 3:
            raise OSError(EADDRINUSE, "taken")
        return "server"

    monkeypatch.setattr("panel.serve", serve)
    assert listening(None, Address())[1].port == asked[2]
    asked[:] = []
    with pytest.raises(InputError, match="another program listens there"):
        listening(None, Address(port=asked_of_nobody()))


def asked_of_nobody() -> int:
    """Return a port on which nobody listens."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        return other.getsockname()[1]


def gone():
    """Raise what Bokeh does where a page is gone."""
    connection = ServerConnection.__new__(ServerConnection)
    connection._session = None  # so Bokeh leaves it
    return connection.session


def wrong():
    """Raise an error of a page that is there."""
    assert not TOKEN


@pytest.mark.parametrize(("act", "left"), [(gone, True), (wrong, False)])
def test_only_what_goes_wrong_with_a_living_page_is_told_in_full(act, left):
    try:
        act()
    except AssertionError:
        record = logging.LogRecord("any", logging.ERROR, __file__, 1, "error", None, sys.exc_info())
    assert server._is_gone(record) is left
    assert server._told_shortly(record)
    assert (record.getMessage(), record.exc_info is None) == ((LEFT, True) if left else ("error", False))
    assert not server._is_gone(logging.LogRecord("any", logging.ERROR, __file__, 1, "error", None, None))


def test_a_page_that_is_closed_while_it_is_written_to_is_no_warning(monkeypatch):
    loop = asyncio.new_event_loop()
    for name in ("bokeh.server.views.ws", "panel.io.document"):
        monkeypatch.setattr(logging.getLogger(name), "level", logging.WARNING)
    server._quieten(SimpleNamespace(asyncio_loop=loop))
    loop.close()
    for name in ("bokeh.server.views.ws", "panel.io.document"):
        assert logging.getLogger(name).level == logging.ERROR


def test_a_host_of_another_machine_is_told():
    with pytest.raises(InputError, match=r"address = .192\.0\.2\.1:"):
        listening(None, Address("192.0.2.1"))


@pytest.mark.campaign
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


def test_the_process_that_works_starts_before_a_browser_asks_and_is_taken_over(tmp_path):
    with served(tmp_path, "tapping-mode-1") as (address, process):
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        if not children.exists():
            pytest.skip("this system does not tell the children of a process")

        def working() -> list[str]:
            numbers = children.read_text().split()
            return [number for number in numbers if "spawn_main" in Path(f"/proc/{number}/cmdline").read_text()]

        before = working()
        assert len(before) == 1
        assert asked(address, f"/?token={TOKEN}")[0] == 200
        assert working() == before


def test_a_page_is_made_without_what_only_computations_need():
    code = (
        "import sys, saltus.explorer.server, saltus.explorer.page, saltus.explorer.views.session_view\n"
        "print([name for name in ('numba', 'xarray', 'scipy.optimize', 'matplotlib') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.strip() == "[]"
