"""Threads of the linear algebra in a block, and behind it."""

from __future__ import annotations

import threading

import pytest

from saltus import linear_threads
from saltus.linear_threads import one_thread


@pytest.fixture
def count(monkeypatch):
    """A library with four threads."""
    found = [4]
    library = linear_threads._Library(lambda: found[0], lambda number: found.__setitem__(0, number))
    monkeypatch.setattr(linear_threads, "_libraries", lambda: (library,))
    return lambda: found[0]


def test_a_block_has_one_thread_and_gives_the_others_back(count):
    with one_thread(100):
        assert count() == 1
    assert count() == 4


def test_threads_come_back_after_an_error_and_behind_blocks_within_blocks(count):
    def work():
        with one_thread(100):
            with one_thread(100):
                pass
            assert count() == 1
            raise ValueError("x")

    with pytest.raises(ValueError, match="x"):
        work()
    assert count() == 4


def test_the_last_of_two_blocks_in_threads_gives_them_back(count):
    inside, leave = threading.Event(), threading.Event()

    def other():
        with one_thread(100):
            inside.set()
            leave.wait(10.0)

    thread = threading.Thread(target=other)
    with one_thread(100):
        thread.start()
        inside.wait(10.0)
    assert count() == 1
    leave.set()
    thread.join()
    assert count() == 4


def test_small_matrices_leave_the_threads_alone(count):
    with one_thread(3):
        assert count() == 4


def test_libraries_of_numpy_and_scipy_tell_their_threads():
    assert all(library.read() >= 1 for library in linear_threads._libraries())
