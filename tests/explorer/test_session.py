"""A session is kept as it goes, comes back equal, and its script makes the same numbers."""

import json
import subprocess
import sys

import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer.session import Session, folder_of, new_folder, removed, sessions_in, told_end
from saltus.explorer.steps import FindOrbit, Place
from saltus.explorer.subjects import of_system


@pytest.fixture(scope="module")
def session(tmp_path_factory, ball_on_table, taken_steps):
    made = Session(of_system(ball_on_table), new_folder(tmp_path_factory.mktemp("sessions")))
    made.settings.x0 = (0.6, 3.1)
    steps, results = taken_steps
    for name in ("orbit1", "branch1", "locus1"):
        made.write(made.add(steps[name], results[name], 0.1, ("a note",)))
    made.settings.sets["low"] = {"parameters": {"a": 1.1}, "x0": [0.5, 3.0], "mode": None}
    made.settings.axes, made.settings.selected = ("a", "max_z"), Place(of="branch1", label="SN1")
    made.settings.hidden.add("locus1")
    made.keep()
    return made


def _same(one, other):
    assert [entry.name for entry in one.entries] == [entry.name for entry in other.entries]
    for mine, theirs in zip(one.entries, other.entries, strict=True):
        assert (mine.step, mine.result, mine.notes) == (theirs.step, theirs.result, theirs.notes)
    assert one.settings == other.settings
    assert one.subject == other.subject
    assert one.script() == other.script()


@pytest.mark.campaign
def test_a_session_comes_back_from_its_folder(session):
    _same(session, Session.reopened(session.folder))


@pytest.mark.campaign
def test_a_session_comes_back_from_one_file(session, tmp_path):
    file = session.packed(tmp_path / "session.nc")
    _same(session, Session.unpacked(file, new_folder(tmp_path)))


@pytest.mark.campaign
def test_a_result_that_was_not_yet_written_is_not_in_the_notes(session, tmp_path):
    copy = Session.unpacked(session.packed(tmp_path / "session.nc"), new_folder(tmp_path))
    copy.add(FindOrbit(), copy.entries[0].result)
    copy.keep()
    assert [entry.name for entry in Session.reopened(copy.folder).entries] == ["orbit1", "branch1", "locus1"]


@pytest.mark.campaign
def test_undo_takes_back_the_last_step_and_what_pointed_to_it(session, tmp_path):
    copy = Session.unpacked(session.packed(tmp_path / "session.nc"), new_folder(tmp_path))
    assert copy.undo().name == "locus1"
    assert copy.undo().name == "branch1"
    assert copy.settings.selected is None
    assert sorted(path.name for path in copy.folder.glob("*.nc")) == ["orbit1.nc"]
    assert [entry.name for entry in Session.reopened(copy.folder).entries] == ["orbit1"]
    copy.undo()
    assert copy.undo() is None


@pytest.mark.campaign
def test_notes_never_name_a_result_that_is_not_written(session, tmp_path):
    copy = Session.unpacked(session.packed(tmp_path / "session.nc"), new_folder(tmp_path))
    last = copy.undo()
    again = copy.add(last.step, last.result)
    copy.keep()  # before the result of the same name is written
    assert [entry.name for entry in Session.reopened(copy.folder).entries] == ["orbit1", "branch1"]
    copy.write(again)
    assert Session.reopened(copy.folder).entries[-1].name == "locus1"
    copy.replace("locus1")
    assert [entry.name for entry in Session.reopened(copy.folder).entries] == ["orbit1", "branch1"]


@pytest.mark.campaign
def test_the_script_of_a_session_makes_the_same_numbers(session, tmp_path):
    lines = [session.script(), 'for name in ("orbit1", "branch1", "locus1"):', '    globals()[name].save(name + ".nc")']
    (tmp_path / "again.py").write_text("\n".join(lines))
    done = subprocess.run(
        [sys.executable, "again.py"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    for name, result in session.results.items():
        assert saltus.load(tmp_path / f"{name}.nc") == result
    assert (tmp_path / "diagram.png").stat().st_size > 10_000


@pytest.mark.campaign
def test_sessions_are_listed_newest_first_and_damaged_ones_left_out(session, tmp_path):
    copy = Session.unpacked(session.packed(tmp_path / "session.nc"), new_folder(tmp_path))
    later = Session.unpacked(tmp_path / "session.nc", new_folder(tmp_path))
    (new_folder(tmp_path) / "session.json").write_text("{")
    assert [folder for folder, _ in sessions_in(tmp_path)] == [later.folder, copy.folder]


@pytest.mark.parametrize("name", ["..", "../x", "/etc", "abc", "ABCDEF012345", "0123456789ab/..", None, 3])
def test_no_name_of_a_session_leads_out_of_its_home(session, name):
    assert folder_of(session.folder.parent, name) is None
    assert folder_of(session.folder.parent, session.folder.name) == session.folder


@pytest.mark.campaign
@pytest.mark.parametrize(
    "change",
    [
        {"format": 2},
        {"entries": [{"name": "../../evil", "step": {}, "seconds": 0, "notes": []}]},
        {"entries": [{"name": "branch7", "step": {"kind": "find_orbit"}, "seconds": 0, "notes": []}]},
        {"subject": ["x"]},
        {"subject": ["x", '{"states": ["__import__"]}', [], [], {}]},
        {"x0": ["a"]},
        {"entries": 3},
    ],
)
def test_damaged_notes_are_refused_in_words(session, tmp_path, change):
    folder = new_folder(tmp_path)
    notes = json.loads((session.folder / "session.json").read_text()) | change
    (folder / "session.json").write_text(json.dumps(notes))
    for name in ("orbit1", "branch1", "locus1"):
        (folder / f"{name}.nc").write_bytes((session.folder / f"{name}.nc").read_bytes())
    with pytest.raises(saltus.SaltusError):
        Session.reopened(folder)


def test_a_file_that_is_no_session_is_refused(session, tmp_path):
    with pytest.raises(InputError, match="session"):
        Session.unpacked(session.entries[0].result.save(tmp_path / "orbit.nc"), new_folder(tmp_path))


def test_a_result_on_which_another_rests_is_not_replaced(empty, taken_steps):
    steps, results = taken_steps
    for name in ("orbit1", "branch1"):
        empty.add(steps[name], results[name])
    with pytest.raises(InputError, match="on which no other rests"):
        empty.replace("orbit1")
    empty.replace("branch1")
    assert [entry.name for entry in empty.entries] == ["orbit1"]
    assert empty.add(steps["orbit1"], results["orbit1"]).name == "orbit2"


def test_parameters_that_differ_are_told(empty):
    assert empty.changed() == {}
    empty.settings.parameters["e"] = 0.25
    assert empty.changed() == {"e": 0.25}


def test_a_removed_folder_is_gone_and_a_second_time_is_no_error(tmp_path):
    folder = new_folder(tmp_path)
    removed(folder)
    removed(folder)
    assert not folder.exists()


def test_reasons_of_an_end_are_told_once(results):
    class Both:
        stopped = ("it returned", "it returned")

    assert told_end(Both()) == "it returned"
    assert told_end(results["branch1"]) == results["branch1"].stopped[0] == results["branch1"].stopped[1]
    assert told_end(results["orbit1"]) == ""


def test_the_file_of_a_session_is_no_result_and_says_so(session, tmp_path):
    file = session.packed(tmp_path / "session.nc")
    with pytest.raises(InputError, match="this is a session of the explorer: saltus explore --load"):
        saltus.load(file)


def test_a_script_draws_in_the_colours_of_the_page(session, monkeypatch, tmp_path):
    import matplotlib
    from matplotlib import pyplot

    from saltus.explorer.colours import colour_of
    from saltus.explorer.drawing import drawn

    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(session.settings, "hidden", set())
    monkeypatch.setattr(session.settings, "axes", ("a", "max_z"))
    lines = session.script().splitlines()
    plots = [line for line in lines[lines.index("") + 1 :] if ".plot(" in line]
    assert len(plots) == 2  # a branch and a locus
    told = {**session.results}
    exec("\n".join(plots), told)
    colours = {line.get_color() for line in told["ax"].lines if line.get_linestyle() != "None"}
    pyplot.close(told["ax"].figure)
    for number, entry in enumerate(session.entries[1:], 1):
        assert drawn(entry.result, ("a", "max_z")).strands
        assert colour_of(number, entry.result) in colours
    assert "#1b1b1e" not in colours  # black is the colour of the first result, an orbit
