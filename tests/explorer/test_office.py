"""Sessions of a server: which are open, which come back, which are deleted."""

import pytest

from saltus.errors import InputError, SaltusError
from saltus.explorer.desk import Listener, Work
from saltus.explorer.office import Office
from saltus.explorer.session import Session
from saltus.explorer.subjects import of_system


def abandoned(office: Office) -> Office:
    """Drop the locks of an office, as the system does when its process is killed."""
    for lock in office._locks.values():
        lock.release()
    return office


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


@pytest.fixture
def office(toys, tmp_path) -> Office:
    return Office(toys, None, tmp_path)


def test_a_choice_among_models_begins_with_the_first(office, toys):
    assert office.desk(None).session.subject.key == next(iter(toys.titles))
    assert office.desk(None, "bench").session.subject.key == "bench"
    assert office.desk(None).application is toys
    with pytest.raises(InputError, match="did you mean 'bench'"):
        office.desk(None, "benhc")


def test_a_desk_is_closed_when_its_last_page_is_gone(office):
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
    assert office.desk(name) is not desk


def test_a_page_without_results_that_is_loaded_again_has_its_model_and_values(office, toys, tmp_path):
    desk, page = office.desk(None, "bench"), Listener()
    desk.join(page)
    desk.session.settings.parameters["a"] = 1.25
    desk.session.keep()
    name = desk.session.folder.name
    desk.leave(page)  # a reload
    office.attend()
    assert name not in {entry.folder for entry in office.listed()}
    again = office.desk(name)
    assert again.session.subject.key == "bench"
    assert again.session.settings.parameters["a"] == 1.25
    other = Office(toys, None, tmp_path)
    again.join(page)
    again.leave(page)
    office.attend()
    other.sweep()
    with pytest.raises(InputError, match="must be one that no other server has open"):
        other.desk(name)
    assert (tmp_path / name).exists()
    office.close()
    assert not (tmp_path / name).exists()


def test_a_start_removes_what_killed_servers_have_left_without_results(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    (empty, kept, cut), other = (office.desk(None).session for _ in range(3)), Office(toys, None, tmp_path)
    kept.write(kept.add(steps["orbit1"], results["orbit1"]))
    results["orbit1"].save(cut.folder / "orbit1.nc")  # the server was killed before the notes had it
    other.sweep()
    assert {path.name for path in tmp_path.iterdir()} == {one.folder.name for one in (empty, kept, cut)}
    abandoned(office)
    other.sweep()
    assert {path.name for path in tmp_path.iterdir()} == {one.folder.name for one in (kept, cut)}
    assert other.desk(kept.folder.name).session.results == kept.results


def test_a_tab_that_is_closed_counts_as_closed(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    desk, page = office.desk(None), Listener()
    desk.join(page)
    desk.session.write(desk.session.add(steps["orbit1"], results["orbit1"]))
    assert Office(toys, None, tmp_path).unfinished() is None  # this office has it open
    abandoned(office)
    assert Office(toys, None, tmp_path).unfinished() == desk.session.folder.name
    desk.leave(page)
    office.attend()
    assert Office(toys, None, tmp_path).unfinished() is None
    other = Office(toys, None, tmp_path)
    again = other.desk(desk.session.folder.name)
    abandoned(other)
    assert Office(toys, None, tmp_path).unfinished() == again.session.folder.name  # it was open again


def test_a_start_offers_no_session_of_another_model(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    session = office.desk(None, "bench").session
    session.write(session.add(steps["orbit1"], results["orbit1"]))
    abandoned(office)
    assert Office(toys, None, tmp_path).unfinished() is None
    assert Office(toys, toys.subject("bench"), tmp_path).unfinished() == session.folder.name


@pytest.mark.campaign
def test_a_session_that_was_not_closed_is_gone_on_with(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    session = office.desk(None).session
    assert Office(toys, None, tmp_path).unfinished() is None  # it has no results
    session.write(session.add(steps["orbit1"], results["orbit1"]))
    assert office.unfinished() is None  # its page is open
    abandoned(office)
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
    monkeypatch.setattr("saltus.explorer.office._UPLOAD", 10)
    with pytest.raises(InputError, match="file = '11 bytes': must be one of at most 10 bytes"):
        office.uploaded(b"x" * 11)


def test_a_session_that_another_server_has_open_is_refused_and_not_deleted(office, toys, tmp_path, taken_steps):
    steps, results = taken_steps
    session, other = office.desk(None).session, Office(toys, None, tmp_path)
    session.write(session.add(steps["orbit1"], results["orbit1"]))
    name = session.folder.name
    for refused in (other.desk, other.delete):
        with pytest.raises(InputError, match=f"session = '{name}': must be one that no other server has open"):
            refused(name)
    assert Session.reopened(session.folder).results == session.results
    abandoned(office)  # a killed process leaves no lock
    assert other.desk(name).session.results == session.results
    other.close()
    assert Office(toys, None, tmp_path).desk(name).session.results == session.results


def test_sessions_are_listed_by_name_and_deleted(office, tmp_path, taken_steps):
    steps, results = taken_steps
    one, other = office.desk(None), office.desk(None, "bench")
    one.session.write(one.session.add(steps["orbit1"], results["orbit1"]))
    one.session.name = "near the fold"
    one.session.keep()
    listed = {entry.folder: entry for entry in office.listed()}
    assert listed[one.session.folder.name][1:4] == ("near the fold", "table", 1)
    assert listed[other.session.folder.name][1:4] == ("", "bench", 0)
    assert Session.reopened(one.session.folder).name == "near the fold"
    page = Listener()
    lines = []
    page.told = lambda line, error=False: lines.append(line)
    one.join(page)
    office.delete(one.session.folder.name)
    assert [entry.key for entry in office.listed()] == ["bench"]
    one.run(steps["orbit1"])
    one.session.keep()
    assert not one.session.folder.exists()
    assert lines == ["this session was deleted in another page"] * 2
    office.delete("../../etc")


def test_a_session_that_is_deleted_elsewhere_has_no_work_left(office, monkeypatch, taken_steps):
    desk, page, heard = office.desk(None), Listener(), []
    page.worked, page.told = heard.append, lambda line, error=False: heard.append(line)
    desk.join(page)
    monkeypatch.setattr(desk._companion, "submit", lambda *given: 1)
    desk.run(taken_steps[0]["orbit1"])
    assert desk.busy
    office.delete(desk.session.folder.name)
    assert not desk.busy
    assert heard[1:] == [Work(), "this session was deleted in another page"]
    desk.stop()
    assert desk.undo("") is None
