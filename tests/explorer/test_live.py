"""What moves with a slider: motions with few steps, orbits carried along, and only the last wish counts."""

import time

import numpy as np
import pytest

from saltus.explorer.live import Frame, Live, Wish, motion_frame, orbit_frame, picture, segments_of
from saltus.explorer.subjects import definition_of


@pytest.fixture
def wish(ball_on_table):
    """Return what makes wishes for the ball."""

    def made(**changed) -> Wish:
        given = {
            "definition": definition_of(ball_on_table), "parameters": {"a": 1.2}, "x0": (0.6, 3.1, 0.5), "mode": None,
            "planes": ("z", "v", "z"), "span": 3.0,
        }  # fmt: skip
        return Wish(**(given | changed))

    return made


def test_a_motion_is_the_one_that_is_simulated(wish, ball_on_table):
    import saltus

    drawn = motion_frame(wish(), 1000)
    motion = saltus.simulate(ball_on_table, {"a": 1.2}, [0.6, 3.1, 0.5], periods=3)
    times = drawn.series[:, 0]
    inside = np.isfinite(times) & (times < motion.t_end)
    assert np.nanmax(times) == pytest.approx(motion.t_end)
    assert np.sort(drawn.series[inside, 1])[-1] == pytest.approx(motion(times[inside])[:, 0].max())
    assert drawn.portrait[:, 0] == pytest.approx(drawn.series[:, 1], nan_ok=True)
    assert drawn.told == ""


def test_few_steps_draw_a_part_and_say_so(wish):
    drawn = motion_frame(wish(span=500.0), 20)
    assert "drawn to t =" in drawn.told
    assert len(drawn.portrait) < 200


def test_a_motion_that_cannot_be_is_told(wish):
    drawn = motion_frame(wish(x0=(np.nan, 0.0)), 100)
    assert drawn.told.startswith("no motion: ")
    assert len(drawn.portrait) == 0


def test_an_orbit_is_carried_and_is_that_of_a_search(wish, results, ball_on_table):
    import saltus

    drawn = orbit_frame(wish(parameters={"a": 1.25}), segments_of(results["orbit1"]))
    assert drawn.told == "the orbit is carried, stable"
    exact = saltus.find_orbit(ball_on_table, {"a": 1.25}, x0=[0.6, 3.1, 0.5])
    assert np.nanmax(drawn.portrait[:, 0]) == pytest.approx(exact.max["z"], rel=1e-4)
    again = orbit_frame(wish(parameters={"a": 1.2}), drawn.segments)
    assert np.nanmax(again.portrait[:, 0]) == pytest.approx(results["orbit1"].max["z"], rel=1e-4)


def test_an_orbit_that_is_not_there_is_not_carried(wish, results):
    drawn = orbit_frame(wish(parameters={"a": 0.2}), segments_of(results["orbit1"]))  # below the saddle-node
    assert drawn.told.startswith("the orbit is not carried")
    assert (len(drawn.portrait), drawn.segments) == (0, None)


class Slow:
    """A companion that answers when it is told to."""

    def __init__(self) -> None:
        self.asked, self.answers = [], []

    def submit(self, function, *arguments) -> int:
        self.asked.append((function, arguments))
        return len(self.asked)

    def answer(self, **content) -> None:
        function, (wish, *_) = self.asked[-1]
        part = "motion" if function is motion_frame else "orbit"
        self.say(Frame(wish, part, np.empty((0, 2)), np.empty((0, 2)), **content))

    def say(self, content) -> None:
        from saltus.companion import Message

        self.answers.append(Message(len(self.asked), "result", content))

    def heard(self) -> list:
        told, self.answers = self.answers, []
        return told

    def leave(self) -> None:
        self.asked.clear()


@pytest.fixture
def slow():
    shown: list[Frame] = []
    live = Live(shown.append)
    live._companion = Slow()
    return live, live._companion, shown


def test_only_the_last_wish_counts(slow, wish):
    live, companion, shown = slow
    for a in (1.0, 1.1, 1.2, 1.3):
        live.want(wish(parameters={"a": a}))
    assert [arguments[0].parameters["a"] for _, arguments in companion.asked] == [1.0]
    companion.answer(seconds=0.01)
    live.listen()
    assert [arguments[0].parameters["a"] for _, arguments in companion.asked] == [1.0, 1.3]
    companion.answer(seconds=0.01)
    live.listen()
    assert not live.busy
    assert [frame.wish.parameters["a"] for frame in shown] == [1.0, 1.3]


def test_to_get_ready_replaces_no_wish_that_is_to_be_shown(slow, wish):
    live, companion, shown = slow
    for a in (1.0, 1.1):
        live.want(wish(parameters={"a": a}))
    live.want(wish(parameters={"a": 1.1}, shown=False))  # an orbit has come meanwhile
    for _ in range(2):
        companion.answer(seconds=0.01)
        live.listen()
    assert not live.busy
    assert [frame.wish.parameters["a"] for frame in shown] == [1.0, 1.1]


def test_an_orbit_that_takes_little_is_drawn_with_the_motion(slow, wish, results):
    live, companion, shown = slow
    live.start_from(results["orbit1"])
    live.want(wish())
    for _ in range(2):  # at first one after the other
        companion.answer(seconds=0.01, segments="next")
        live.listen()
    live.want(wish(parameters={"a": 1.25}))
    function, (_, _, first) = companion.asked[-1]
    assert (function, first) == (picture, "next")
    both = [Frame(wish(), part, np.empty((0, 2)), np.empty((0, 2)), "", "last", 0.1) for part in ("motion", "orbit")]
    companion.say(tuple(both))
    live.listen()
    assert not live.busy
    assert [frame.part for frame in shown] == ["motion", "orbit", "motion", "orbit"]
    live.want(wish())  # this orbit has taken longer
    assert companion.asked[-1][0] is motion_frame
    assert live._segments == "last"


def test_a_picture_has_the_motion_and_the_orbit(wish, results):
    segments = segments_of(results["orbit1"])
    for drawn, alone in zip(
        picture(wish(), 500, segments), (motion_frame(wish(), 500), orbit_frame(wish(), segments)), strict=True
    ):
        assert (drawn.part, drawn.told) == (alone.part, alone.told)
        assert np.array_equal(drawn.portrait, alone.portrait, equal_nan=True)
        assert drawn.seconds > 0.0


def test_the_orbit_follows_the_motion_and_goes_on_from_the_last(slow, wish, results):
    live, companion, shown = slow
    live.start_from(results["orbit1"])
    live.want(wish())
    companion.answer(seconds=0.01)
    live.listen()
    function, (_, first) = companion.asked[-1]
    assert function is orbit_frame
    assert repr(first) == repr(segments_of(results["orbit1"]))
    companion.answer(segments="next", seconds=1.0)
    live.want(wish())
    live.listen()
    companion.answer(seconds=0.01)
    live.listen()
    assert companion.asked[-1][1][1] == "next"
    live.start_from(None)  # another is selected: what comes of the last one is out of date
    companion.answer(segments="late")
    live.listen()
    assert [frame.part for frame in shown] == ["motion", "orbit", "motion"]
    assert live._segments is None


def test_slow_motions_get_fewer_steps(slow, wish):
    live, companion, _ = slow
    counts = []
    for seconds in (0.03, 0.03, 0.001, 10.0, 10.0, 10.0):
        live.want(wish())
        counts.append(companion.asked[-1][1][1])
        companion.answer(seconds=seconds)
        live.listen()
    assert counts[1] == counts[0] // 2
    assert counts[3] > counts[2]
    assert live._steps == 150


@pytest.mark.campaign
def test_a_process_draws(wish, results):
    shown: list[Frame] = []
    live = Live(shown.append)
    live.start_from(results["orbit1"])
    live.want(wish())
    begun = time.monotonic()
    while live.busy and time.monotonic() - begun < 100.0:
        live.listen()
        time.sleep(0.01)
    live.close()
    assert [frame.part for frame in shown] == ["motion", "orbit"]
    assert shown[1].told == "the orbit is carried, stable"
