"""Pieces of work in this thread and in threads: order, errors, interrupts, refusals."""

from __future__ import annotations

import gc
import signal
import threading

import pytest

from saltus.errors import SaltusError
from saltus.work import Here, handed_out, interrupt_waits, processors, starting, uncollected


def test_work_in_this_thread_is_done_when_it_is_submitted():
    here = Here()
    for key in "ab":
        here.submit(key, str.upper, key)
    assert [(key, outcome.result()) for key, outcome in here.finished(waiting=False)] == [("a", "A"), ("b", "B")]
    assert here.finished(waiting=True) == []


def test_an_error_of_a_piece_in_this_thread_is_raised_at_once():
    with pytest.raises(ValueError, match="no number"):
        Here().submit("a", int, "no number")


def test_pieces_are_handed_out_each_once():
    jobs = [(k, pow, k, 2) for k in range(20)]
    assert dict(handed_out(Here(), iter(jobs), lambda: 3)) == {k: k * k for k in range(20)}


def test_a_piece_may_have_one_that_follows_on_it():
    def after(key, result):
        return [(key + 1, pow, result, 2)] if key < 3 else []

    assert list(handed_out(Here(), [(1, pow, 2, 1)], lambda: 1, after)) == [(1, 2), (2, 4), (3, 16)]


@pytest.mark.parametrize("refused", [RuntimeError("can't start new thread"), BlockingIOError(11, "no")])
def test_a_refused_thread_is_told_with_what_to_do(refused):
    with pytest.raises(SaltusError, match=r"ulimit -u\): allow more, or workers=1$"), starting("workers=1"):
        raise refused


def test_another_error_is_passed_on():
    with pytest.raises(RuntimeError, match="another"), starting():
        raise RuntimeError("another")


def test_an_interrupt_waits_until_the_block_has_ended():
    reached = []

    def work():
        with interrupt_waits():
            signal.raise_signal(signal.SIGINT)
            reached.append("the end")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["the end"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_in_another_thread_no_handler_is_touched():
    found = []

    def work():
        with interrupt_waits():
            found.append(signal.getsignal(signal.SIGINT))

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [before]


def test_the_collector_comes_back_also_after_an_error():
    def work():
        with uncollected():
            assert not gc.isenabled()
            raise ValueError("x")

    with pytest.raises(ValueError, match="x"):
        work()
    assert gc.isenabled()


def test_there_is_a_processor():
    assert processors() >= 1
