"""A companion does its work in turn, reports, is stopped with what is done, and comes back after it has died."""

import math
import os
import sys
import time
from collections.abc import Iterator

import pytest

from saltus.companion import Companion, Message
from saltus.errors import InputError
from saltus.progress import Progress

_LONGEST = 120.0  # seconds that a busy machine may need to start a process


def _squared(value: float, *, progress) -> float:
    progress(Progress(1, 2, 1.0, "half"))
    return value * value


def _refused(*, progress) -> None:
    raise InputError("x", 3, "a text")


def _broken(*, progress) -> None:
    raise ZeroDivisionError("by hand")


def _dies(*, progress) -> None:
    os._exit(1)


def _counts_until_stopped(*, progress) -> str:
    count = 0
    try:
        while True:
            count += 1
            progress(Progress(count, None, 1.0))
            time.sleep(0.01)
    except KeyboardInterrupt:
        return f"kept {'some' if count else 'none'}"


def _sleeps(*, progress) -> None:
    time.sleep(600.0)


def _imports_slowly(folder: str, *, progress) -> str:
    sys.path.insert(0, folder)
    progress(Progress(0, None, 1.0))
    try:
        import slow_to_import  # type: ignore[import-not-found]

        while True:
            time.sleep(0.01)
    except KeyboardInterrupt:
        return slow_to_import.ready


def _compiles(*, progress) -> str:
    import numba

    lines = [f"    if x > {k}.0:\n        x = math.sin(x) + {k}.0*math.sqrt(abs(x))" for k in range(40)]
    space: dict = {"math": math}
    exec("def long_text(x):\n" + "\n".join(lines) + "\n    return x", space)
    made = numba.njit(space["long_text"])
    progress(Progress(0, None, 1.0))
    try:
        made(1.0)
        while True:
            time.sleep(0.01)
    except KeyboardInterrupt:
        return f"{len(made.signatures)} compiled"


@pytest.fixture
def companion() -> Iterator[Companion]:
    made = Companion()
    yield made
    made.end()


def _ends(companion: Companion, keys: list[int]) -> dict[int, Message]:
    """Return what is said of pieces of work at their ends."""
    begun, found = time.monotonic(), {}
    while len(found) < len(keys):
        found |= {m.key: m for m in companion.heard() if m.key in keys and m.kind != "progress"}
        if time.monotonic() - begun > _LONGEST:
            raise TimeoutError(f"nothing was heard of some of the pieces {keys}")
        time.sleep(0.01)
    return found


def _last(companion: Companion, key: int) -> Message:
    return _ends(companion, [key])[key]


def _begun(companion: Companion, key: int) -> None:
    """Wait for the first report of a piece of work."""
    begun = time.monotonic()
    while not any(message.key == key for message in companion.heard()):
        if time.monotonic() - begun > _LONGEST:
            raise TimeoutError("the work did not begin")
        time.sleep(0.01)


def test_results_and_errors_come_back_in_turn(companion):
    keys = [companion.submit(_squared, 3.0), companion.submit(_refused), companion.submit(_broken)]
    said = _ends(companion, keys)
    assert said[keys[0]].content == 9.0
    assert said[keys[1]].kind == "error"
    assert said[keys[1]].content == "x = 3: must be a text"
    assert said[keys[2]].content == "ZeroDivisionError: by hand; this is a fault of saltus"
    assert not companion.busy


def _own_number(*, progress) -> int:
    return os.getpid()


def _nothing() -> None:
    pass


def test_a_process_that_is_left_without_work_is_taken_over_and_one_that_works_is_ended(companion):
    number = _last(companion, companion.submit(_own_number)).content
    companion.leave()
    other = Companion(_nothing)  # something else is called there first
    assert _last(other, other.submit(_own_number)).content != number
    other.end()
    after = Companion()
    assert _last(after, after.submit(_own_number)).content == number
    assert _last(after, after.submit(_squared, 3.0)).content == 9.0
    _begun(after, after.submit(_counts_until_stopped))
    after.leave()
    last = Companion()
    assert _last(last, last.submit(_own_number)).content != number
    last.end()


def test_stopped_work_returns_what_it_kept_and_the_next_piece_is_done(companion):
    key = companion.submit(_counts_until_stopped)
    _begun(companion, key)
    companion.stop(key)
    assert _last(companion, key) == (key, "result", "kept some")
    assert _last(companion, companion.submit(_squared, 2.0)).content == 4.0


def test_work_that_keeps_nothing_is_stopped_and_work_that_waits_is_left_out(companion):
    first = companion.submit(_counts_until_stopped)
    waiting = companion.submit(_squared, 5.0)
    _begun(companion, first)
    companion.stop(waiting)
    companion.stop(first)
    heard = _ends(companion, [first, waiting])
    assert heard[waiting].kind == "stopped"
    assert heard[first].content == "kept some"


def test_a_companion_that_died_says_so_and_another_takes_over(companion):
    assert "has ended" in _last(companion, companion.submit(_dies)).content
    assert _last(companion, companion.submit(_squared, 4.0)).content == 16.0


def test_no_import_is_interrupted(companion, tmp_path):
    (tmp_path / "slow_to_import.py").write_text("import time\ntime.sleep(1.0)\nready = 'whole'\n")
    key = companion.submit(_imports_slowly, str(tmp_path))
    _begun(companion, key)
    companion.stop(key)
    assert _last(companion, key).content == "whole"


@pytest.mark.campaign
def test_no_compilation_is_interrupted(companion, capfd):
    key = companion.submit(_compiles)
    _begun(companion, key)
    companion.stop(key)
    assert _last(companion, key).content == "1 compiled"
    assert capfd.readouterr().err == ""


def test_a_companion_is_ended_whatever_it_does(companion):
    companion.submit(_sleeps)
    companion.end()
    assert not companion.busy
    assert _last(companion, companion.submit(_squared, 6.0)).content == 36.0
