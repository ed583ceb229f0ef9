"""What a long computation tells of its progress."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from saltus.errors import InputError
from saltus.progress import Progress, Reporter, duration_text


def test_a_function_is_told_of_each_step() -> None:
    told: list[Progress] = []
    with Reporter(told.append) as reporter:
        reporter.step(1, "first")
        reporter.expect(3)
        reporter.step(1)
        reporter.finish()
    assert [(item.done, item.total, item.text) for item in told] == [(1, None, "first"), (2, 3, ""), (3, 3, "")]
    assert all(item.rate > 0.0 for item in told)


def test_more_than_was_expected_is_all_of_it() -> None:
    told: list[Progress] = []
    with Reporter(told.append, 2) as reporter:
        reporter.step(5)
    assert (told[-1].done, told[-1].total, told[-1].left) == (5, 5, 0.0)


def test_time_left_is_known_with_total_and_rate_only() -> None:
    assert Progress(10, 40, 2.0).left == 15.0
    assert Progress(10, None, 2.0).left is None
    assert Progress(0, 40, 0.0).left is None


def test_true_shows_a_bar_on_stderr_and_nothing_on_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter(True, 4) as reporter:
        reporter.step(1, "w = [0.93]")
        assert reporter.report is not None
    out, err = capsys.readouterr()
    assert not out
    assert "25.0 %" in err
    assert "w = [0.93]" in err


def test_what_an_earlier_run_has_done_leaves_the_rate_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 0.0])
    monkeypatch.setattr("saltus.progress.monotonic", lambda: next(clock, 10.0))
    told: list[Progress] = []
    with Reporter(told.append) as reporter:
        reporter.expect(600, 400)
        reporter.step(100)
    assert told == [Progress(500, 600, 10.0)]
    assert told[0].left == 10.0


@pytest.mark.parametrize("nothing", [False, None])
def test_nobody_asked_is_nobody_told(nothing: bool | None, capsys: pytest.CaptureFixture[str]) -> None:
    with Reporter(nothing) as reporter:
        reporter.step(1)
        assert reporter.report is None
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("wrong", ["yes", 1, object()])
def test_what_is_no_function_is_told(wrong: object) -> None:
    with pytest.raises(InputError, match="progress"):
        Reporter(wrong)  # type: ignore[arg-type]


def test_an_error_ends_the_bar_and_is_raised(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ZeroDivisionError), Reporter(True, 2):
        raise ZeroDivisionError
    capsys.readouterr()
    with Reporter(True, 2) as again:  # a bar that still ran would refuse a second one
        again.step(2)
    assert "100.0 %" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.034, "0.034 s"),
        (3.0, "3 s"),
        (59.0, "59 s"),
        (59.7, "1 min 0 s"),
        (61.0, "1 min 1 s"),
        (1800.0, "30 min"),
        (3570.0, "1 h 0 min"),
        (3700.0, "1 h 2 min"),
        (7e5, "8 d 2 h"),
    ],
)
def test_durations_have_two_units_at_most(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what a notebook's cell shows, one after the other."""
    seen: list[str] = []
    handle = SimpleNamespace(update=seen.append)

    def display(what: str, display_id: bool) -> SimpleNamespace:
        seen.append(what)
        return handle

    kernel = SimpleNamespace(config={"IPKernelApp": {}})
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: kernel))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(HTML=str, display=display))
    return seen


def test_a_notebook_shows_one_bar_that_moves_and_no_warning(cell: list[str]) -> None:
    with Reporter(True, 2) as reporter:
        reporter.step(1, "w < 1")
        reporter.step(1, "w = 2")
    assert cell[0] == "starting"
    assert cell[1].startswith('<progress value="1" max="2"></progress>  50.0 %')
    assert cell[1].endswith("w &lt; 1")
    assert cell[2].startswith('<progress value="2" max="2"></progress> 100.0 %')
    assert len(cell) == 3


def test_a_notebooks_bar_stands_still_at_the_end_and_shows_the_last_step(cell: list[str]) -> None:
    with Reporter(True) as reporter:
        for count in range(1, 46):
            reporter.step(text=f"w = {count}")
    assert cell[1].startswith("<progress ></progress> 1 ")  # nobody knows how many come: it runs to and fro
    assert cell[-1].startswith('<progress value="45" max="45"></progress> 45 ')
    assert cell[-1].endswith("w = 45")


def test_a_notebooks_bar_stays_where_an_error_came(cell: list[str]) -> None:
    def broken() -> None:
        with Reporter(True, 8) as reporter:
            reporter.step(1)
            reporter.step(1)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        broken()
    assert cell[-1].startswith('<progress value="2" max="8"></progress>  25.0 %')
