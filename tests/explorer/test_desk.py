"""A desk hands steps to a companion and takes results in; the companion here answers as it is told."""

import os
import signal
import time

import pytest

from saltus.companion import ENDED, Message
from saltus.errors import InputError, SaltusError
from saltus.explorer import desk as desks
from saltus.explorer.desk import Desk, Listener, Work
from saltus.explorer.session import Session
from saltus.explorer.tasks import Outcome, take, warm
from saltus.progress import Progress


class Told:
    """A companion without a process."""

    def __init__(self, prepare=None) -> None:
        self.pieces: dict[int, tuple] = {}
        self.stopped: list[int] = []
        self.said: list[Message] = []
        self.ended = 0
        self.started = 0

    def start(self) -> None:
        self.started += 1

    def submit(self, function, *arguments) -> int:
        self.pieces[len(self.pieces) + 1] = (function, *arguments)
        return len(self.pieces)

    def heard(self) -> list[Message]:
        said, self.said = self.said, []
        return said

    def stop(self, key: int) -> None:
        self.stopped.append(key)

    def leave(self) -> None:
        self.ended += 1

    def end(self) -> None:
        self.ended += 1


class Ear(Listener):
    """What a page would hear."""

    def __init__(self) -> None:
        self.entries: list[str] = []
        self.work: list[tuple] = []
        self.lines: list[tuple[str, bool]] = []
        self.films: list = []
        self.changes = 0

    def added(self, entry) -> None:
        self.entries.append(entry.name)

    def worked(self, work) -> None:
        self.work.append((work.what.partition(":")[0], work.progress))

    def filmed(self, path) -> None:
        self.films.append(path)

    def changed(self) -> None:
        self.changes += 1

    def told(self, line, *, error=False) -> None:
        self.lines.append((line, error))


@pytest.fixture
def desk(empty, toys, monkeypatch) -> Desk:
    monkeypatch.setattr(desks, "Companion", Told)
    made = Desk(toys, empty)
    made.listener = Ear()
    made.join(made.listener)
    return made


def test_a_step_is_handed_over_as_plain_data_with_what_it_needs(desk, taken_steps):
    steps, results = taken_steps
    desk.session.add(steps["orbit1"], results["orbit1"])
    desk.session.add(steps["sweep1"], results["sweep1"])
    desk.run(steps["branch1"])
    function, definition, plain, needed, axes = desk._companion.pieces[1]
    assert (function, definition) == (take, desk.session.subject.definition)
    assert plain == steps["branch1"].model_dump()
    assert needed == {"orbit1": results["orbit1"]}
    assert axes == desk.session.settings.axes
    assert desk.busy
    assert desk.listener.work == [("branch", None)]


def test_a_result_is_added_told_and_written_when_there_is_time(desk, taken_steps):
    steps, results = taken_steps
    done = []
    desk.run(steps["orbit1"], done.append)
    desk._companion.said = [Message(1, "result", Outcome(results["orbit1"], 0.5, ("a note",)))]
    desk.listen()
    assert desk.listener.entries == [entry.name for entry in done] == ["orbit1"]
    assert desk.listener.lines == [("a note", False)]
    assert not desk.busy
    assert desk.listener.work[-1] == ("", None)
    assert not [*desk.session.folder.glob("*.nc")]
    desk.write()
    assert Session.reopened(desk.session.folder).results == {"orbit1": results["orbit1"]}


def test_a_better_result_takes_the_place_of_another(desk, taken_steps):
    steps, results = taken_steps
    desk.session.add(steps["motion1"], results["motion1"])
    desk.run(steps["motion1"], replaces="motion1")
    desk._companion.said = [Message(1, "result", Outcome(results["motion1"], 2.0, ()))]
    desk.listen()
    assert [(entry.name, entry.seconds) for entry in desk.session.entries] == [("motion1", 2.0)]


@pytest.mark.parametrize(
    ("kind", "content", "line"),
    [
        ("error", "it does not converge", ("it does not converge", True)),
        ("stopped", None, ("stopped before there was anything to keep", False)),
    ],
)
def test_work_without_a_result_is_told(desk, taken_steps, kind, content, line):
    desk.run(taken_steps[0]["orbit1"])
    desk._companion.said = [Message(1, kind, content)]
    desk.listen()
    assert desk.listener.lines == [line]
    assert (desk.session.entries, desk.busy) == ([], False)


def test_progress_is_told_and_what_is_forgotten_is_not(desk, taken_steps):
    desk.run(taken_steps[0]["branch1"])
    progress = Progress(3, 10, 1.0, "points")
    desk._companion.said = [Message(1, "progress", progress), Message(9, "error", "of a piece long gone")]
    desk.listen()
    assert desk.listener.work == [("branch", None), ("branch", progress)]
    assert desk.listener.lines == []
    assert desk.busy


def test_work_is_stopped_from_behind_so_that_nothing_begins_meanwhile(desk, taken_steps):
    for name in ("orbit1", "sweep1"):
        desk.run(taken_steps[0][name])
    desk.stop()
    assert desk._companion.stopped == [2, 1]


def test_a_process_that_is_ended_begins_anew(desk, taken_steps):
    desk.run(taken_steps[0]["orbit1"])
    desk.stop()
    desk.kill()
    assert (desk.busy, desk._companion.ended, desk._companion.started) == (False, 1, 1)
    assert desk.listener.lines == [("the work was ended", False)]


def test_a_wish_comes_before_loading_ahead(desk, taken_steps):
    desk.warm()
    assert desk._companion.pieces[1][0] is warm
    assert not desk.busy
    desk.run(taken_steps[0]["orbit1"])
    assert desk._companion.stopped == [1]
    desk.run(taken_steps[0]["sweep1"])
    assert desk._companion.stopped == [1]


def test_the_application_films(desk, results, toys):
    desk.film(results["orbit1"])
    function, orbit, path = desk._companion.pieces[1]
    assert function is toys.film
    desk._companion.said = [Message(1, "result", function(orbit, path, progress=False))]
    desk.listen()
    assert desk.listener.films == [desk.session.folder / "film.gif"]
    assert desk.listener.films[0].read_text() == "6.283185"
    assert desk.session.entries == []


def test_what_was_found_of_a_branch_is_shown_on_the_axes_that_are_still_there(desk, taken_steps):
    desk.session.settings.axes = ("a", "max_z")
    desk.run(taken_steps[0]["branch1"])
    desk._companion.said = [Message(1, "progress", Progress(k, None, 1.0, "", (0.1 * k, 1.0))) for k in (1, 2)]
    desk.listen()
    assert desk.work.trail == ((0.1, 1.0), (0.2, 1.0))
    desk.session.settings.axes = ("a", "min_z")
    assert desk.work.trail == ()


def test_where_no_attractor_is_periodic_the_motion_is_shown(desk, taken_steps):
    desk.run(taken_steps[0]["orbit1"])
    desk._companion.said = [Message(1, "error", "periodic attractor: no convergence; the motion is chaotic")]
    desk.listen()
    assert desk.listener.lines == [("periodic attractor: no convergence; the motion is chaotic", True)]
    assert desk.work.what.startswith("motion: saltus.simulate(system, {'a': 1.2}, [0.6, 3.1, 0.5], periods=200)")


def test_all_pages_hear_the_same_each_under_its_own_lock(desk, taken_steps):
    steps, results = taken_steps
    posted, other = [], Ear()
    desk.join(other, posted.append)
    desk.run(steps["orbit1"])
    desk._companion.said = [Message(1, "result", Outcome(results["orbit1"], 0.5, ()))]
    desk.listen()
    assert desk.listener.entries == ["orbit1"]
    assert other.entries == other.work == []
    for work in posted:
        work()
    assert (other.entries, other.work) == (desk.listener.entries, desk.listener.work)


def test_a_change_is_told_to_all_pages_but_the_one_that_made_it(desk):
    other = Ear()
    desk.join(other)
    desk.change(other)
    assert (desk.listener.changes, other.changes) == (1, 0)


def test_a_desk_is_left_when_its_last_page_is_gone(desk):
    other = Ear()
    desk.join(other)
    desk.leave(desk.listener)
    assert not desk.left
    desk.leave(other)
    assert desk.left
    desk.join(other)
    assert not desk.left


def test_a_page_that_comes_later_sees_how_the_work_stands(desk, taken_steps):
    steps, _ = taken_steps
    assert desk.work == Work()
    desk.run(steps["branch1"])
    desk.run(steps["sweep1"])
    progress = Progress(3, 10, 1.0, "points")
    desk._companion.said = [Message(1, "progress", progress)]
    desk.listen()
    branch, sweep = (f"{name}: {steps[f'{name}1'].text()}" for name in ("branch", "sweep"))
    assert desk.work == Work(branch, progress, (sweep,), stopping=False)
    desk.stop()
    assert desk.work.stopping


def test_what_was_asked_for_after_a_stop_outlives_the_process(desk, taken_steps):
    steps, results = taken_steps
    desk.run(steps["orbit1"])
    desk.stop()
    desk.run(steps["sweep1"])
    desk.kill()
    assert desk.work.what.startswith("sweep: ")
    assert not desk.work.stopping
    desk._companion.said = [Message(3, "result", Outcome(results["sweep1"], 0.5, ()))]
    desk.listen()
    assert desk.listener.entries == ["sweep1"]


def test_a_result_with_which_work_is_under_way_is_not_undone(desk, taken_steps):
    steps, results = taken_steps
    desk.session.add(steps["orbit1"], results["orbit1"])
    desk.run(steps["branch1"])
    with pytest.raises(InputError, match="stop the branch first"):
        desk.undo("orbit1")
    desk._companion.said = [Message(1, "stopped", None)]
    desk.listen()
    assert desk.undo("orbit1").name == "orbit1"


def test_a_result_that_the_person_did_not_see_is_not_undone(desk, taken_steps):
    steps, results = taken_steps
    for name in ("orbit1", "branch1"):
        desk.session.add(steps[name], results[name])
    with pytest.raises(InputError, match="'orbit1': must be the last one; that is branch1 now"):
        desk.undo("orbit1")
    assert [*desk.session.results] == ["orbit1", "branch1"]
    for name in ("branch1", "orbit1"):
        desk.undo(name)
    with pytest.raises(InputError, match="all are gone"):
        desk.undo("orbit1")


def test_a_system_without_processes_is_told(desk, taken_steps, monkeypatch):
    def refused(*arguments):
        raise SaltusError("no further process")

    monkeypatch.setattr(desk._companion, "submit", refused)
    monkeypatch.setattr(desk._companion, "start", refused)
    desk.start()
    desk.run(taken_steps[0]["orbit1"])
    assert desk.listener.lines == [("no further process", True)] * 2
    assert not desk.busy


def test_a_folder_that_cannot_be_written_is_told(desk, taken_steps, tmp_path):
    steps, results = taken_steps
    desk.run(steps["orbit1"])
    desk._companion.said = [Message(1, "result", Outcome(results["orbit1"], 0.5, ()))]
    desk.listen()
    desk.session.folder = tmp_path / "gone"
    desk.close()
    (line, error), *_ = desk.listener.lines
    assert line.startswith("the session is not kept: ")
    assert error
    assert desk._companion.ended == 1


def test_what_was_undone_meanwhile_is_not_written(desk, taken_steps):
    steps, results = taken_steps
    desk.run(steps["orbit1"])
    desk._companion.said = [Message(1, "result", Outcome(results["orbit1"], 0.5, ()))]
    desk.listen()
    desk.session.undo()
    desk.write()
    assert not [*desk.session.folder.glob("*.nc")]


def test_a_process_that_died_is_told_with_what_is_kept(desk, taken_steps):
    steps, results = taken_steps
    desk.run(steps["orbit1"])
    desk._companion.said = [Message(1, "error", ENDED)]
    desk.listen()
    desk.session.add(steps["orbit1"], results["orbit1"])
    desk.run(steps["branch1"])
    desk._companion.said = [Message(2, "error", ENDED)]
    desk.listen()
    first, second = (line for line, error in desk.listener.lines if error)
    assert first == f"{ENDED}; there was nothing to keep"
    assert second == f"{ENDED}; kept: orbit1"


def test_a_process_that_says_nothing_is_told_after_a_second(desk, taken_steps, monkeypatch):
    now = 100.0
    monkeypatch.setattr(desks, "monotonic", lambda: now)
    desk.run(taken_steps[0]["sweep1"])
    for passed, silent in ((0.9, 0), (0.2, 1), (1.0, 2)):
        now += passed
        desk.attend()
        assert desk.work.silent == silent
    assert len(desk.listener.work) == 3  # as it began, and each second
    desk._companion.said = [Message(1, "progress", Progress(3, 10, 1.0, "values"))]
    desk.attend()
    assert desk.work.silent == 0
    now += 60.0
    desk._companion.said = [Message(1, "stopped", None)]
    desk.attend()
    desk.attend()
    assert desk.work == Work()


@pytest.mark.campaign
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL")
def test_a_killed_process_is_told_within_two_seconds_and_the_next_step_is_done(toys, empty, taken_steps):
    steps, results = taken_steps
    desk, ear = Desk(toys, empty), Ear()
    desk.join(ear)
    desk.session.add(steps["orbit1"], results["orbit1"])
    try:
        desk.run(steps["sweep1"].model_copy(update={"count": 10_000}))
        while desk._progress is None:
            desk.attend()
            time.sleep(0.01)
        os.kill(desk._companion._process.pid, signal.SIGKILL)
        looks = 0
        while not ear.lines:
            desk.attend()
            time.sleep(0.04)  # as the server looks
            looks += 1
            assert looks < 50
        assert ear.lines == [(f"{ENDED}; kept: orbit1", True)]
        assert not desk.busy
        desk.run(steps["motion1"])
        while desk.busy:
            desk.attend()
            time.sleep(0.01)
        assert ear.entries == ["motion1"]
    finally:
        desk.close()
