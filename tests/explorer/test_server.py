"""The server lets in only who names it and knows its token; sessions stay in their folder."""

import socket
import subprocess
import sys

import pytest

from saltus.errors import InputError, SaltusError
from saltus.explorer.desk import Listener
from saltus.explorer.server import Address, Office, free_port
from saltus.explorer.subjects import of_system
from screen import TOKEN, asked, served


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


def test_a_port_that_is_taken_is_told_and_another_found():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        with pytest.raises(InputError, match="must be free"):
            free_port("127.0.0.1", taken)
    assert free_port("127.0.0.1", None) > 0


def test_a_session_without_results_leaves_nothing_behind(toys, tmp_path, ball_on_table):
    office = Office(toys, of_system(ball_on_table), tmp_path)
    office.desk("../../etc", None)
    office.desk("0123456789ab", None)
    assert len([*tmp_path.iterdir()]) == 2
    office.close()
    assert not [*tmp_path.iterdir()]


@pytest.mark.campaign
def test_an_upload_that_is_no_session_leaves_nothing_behind(toys, tmp_path, ball_on_table):
    office = Office(toys, of_system(ball_on_table), tmp_path)
    with pytest.raises(SaltusError):
        office.uploaded(b"no session")
    assert not [*tmp_path.iterdir()]


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


@pytest.fixture
def office(toys, tmp_path) -> Office:
    return Office(toys, None, tmp_path)


def test_a_choice_among_models_begins_with_the_first(office, toys):
    assert office.desk(None).session.subject.key == next(iter(toys.titles))
    assert office.desk(None, "bench").session.subject.key == "bench"
    assert office.desk(None).application is toys
    with pytest.raises(InputError, match="did you mean 'bench'"):
        office.desk(None, "benhc")


def test_a_desk_is_closed_when_its_last_page_is_gone(office, tmp_path):
    desk, first, second = office.desk(None), Listener(), Listener()
    name = desk.session.folder.name
    assert office.desk(name) is desk
    for page in (first, second):
        desk.join(page)
    desk.leave(first)
    office.attend()
    assert office.desk(name) is desk
    desk.leave(second)
    office.attend()
    assert not (tmp_path / name).exists()


def test_a_tab_that_is_closed_counts_as_closed(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    desk, page = office.desk(None), Listener()
    desk.join(page)
    desk.session.write(desk.session.add(steps["orbit1"], results["orbit1"]))
    assert Office(toys, None, tmp_path).unfinished() == desk.session.folder.name
    desk.leave(page)
    office.attend()
    assert Office(toys, None, tmp_path).unfinished() is None
    again = Office(toys, None, tmp_path).desk(desk.session.folder.name)
    assert Office(toys, None, tmp_path).unfinished() == again.session.folder.name  # it is open again


def test_a_start_offers_no_session_of_another_model(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    session = office.desk(None, "bench").session
    session.write(session.add(steps["orbit1"], results["orbit1"]))
    assert Office(toys, None, tmp_path).unfinished() is None
    assert Office(toys, toys.subject("bench"), tmp_path).unfinished() == session.folder.name


@pytest.mark.campaign
def test_a_session_that_was_not_closed_is_gone_on_with(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    session = office.desk(None).session
    assert Office(toys, None, tmp_path).unfinished() is None  # it has no results
    session.write(session.add(steps["orbit1"], results["orbit1"]))
    assert office.unfinished() is None  # its page is open
    assert Office(toys, None, tmp_path).unfinished() == session.folder.name
    assert Office(toys, toys.subject("bench"), tmp_path).unfinished() is None  # of another system
    office.close()
    assert Office(toys, None, tmp_path).unfinished() is None  # it was closed on purpose


@pytest.mark.campaign
def test_an_upload_is_a_session_of_its_own(office, session, tmp_path):
    content = session.packed(tmp_path / "session.nc").read_bytes()
    first, second = office.uploaded(content), office.uploaded(content)
    assert first != second
    assert office.desk(first).session.results == session.results
    assert not [*tmp_path.rglob("upload.nc")]


@pytest.mark.campaign
def test_an_upload_has_a_largest_size(office, monkeypatch):
    monkeypatch.setattr("saltus.explorer.server._UPLOAD", 10)
    with pytest.raises(InputError, match="file = '11 bytes': must be one of at most 10 bytes"):
        office.uploaded(b"x" * 11)
