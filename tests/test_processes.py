"""Processes that rest between two calls, and when work is handed to them."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import subprocess
import sys
import threading
import time
from typing import ClassVar

import pytest

from saltus import processes
from saltus.processes import HereFirst, Processes, is_stopped


def done_by(workers, count):
    """Have some pieces done; return what did each."""
    for key in range(count):
        workers.submit(key, os.getpid)
    found = {}
    while len(found) < count:
        found |= {key: outcome.result() for key, outcome in workers.finished(waiting=True)}
    workers.stop()
    return set(found.values())


@pytest.fixture
def rested():
    """Processes that have worked once, and what they are known by."""
    processes.resting.end()
    first = done_by(Processes(1, "workers=1"), 3)
    assert os.getpid() not in first
    yield first
    processes.resting.end()
    assert not multiprocessing.active_children()


def test_the_next_call_takes_the_processes_that_rest(rested):
    assert processes.resting.has(1)
    assert done_by(Processes(1, "workers=1"), 2) == rested
    assert processes.resting.has(1)
    assert not processes.resting.has(2)


def test_processes_that_died_at_rest_are_replaced(rested):
    for process in multiprocessing.active_children():
        process.kill()
        process.join()
    time.sleep(0.5)
    assert done_by(Processes(1, "workers=1"), 2).isdisjoint(rested)


def test_processes_of_another_environment_are_not_taken(rested, monkeypatch):
    monkeypatch.setenv("SALTUS_SOMETHING", "else")
    assert not processes.resting.has(1)
    assert done_by(Processes(1, "workers=1"), 2).isdisjoint(rested)


def _until_stopped():
    while not is_stopped():
        time.sleep(0.01)
    return "stopped"


def test_processes_with_work_that_is_given_up_end(rested):
    workers = Processes(1, "workers=1")
    workers.submit("a", _until_stopped)
    time.sleep(0.2)
    workers.stop()
    assert not processes.resting.has(1)
    assert not multiprocessing.active_children()
    assert [outcome.result() for _, outcome in workers.finished(waiting=False)] == ["stopped"]


def test_at_rest_they_end_after_a_while(monkeypatch):
    monkeypatch.setattr(processes, "_REST", 0.05)
    done_by(Processes(1, "workers=1"), 1)
    deadline = time.monotonic() + 20.0
    while multiprocessing.active_children() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not multiprocessing.active_children()


class Starting:
    """Processes that take pieces and bring none before they are told to."""

    def __init__(self, count, fewer):
        self.keys, self.ready = [], False
        Starting.last = self

    def submit(self, key, function, *arguments):
        self.keys.append(key)

    def waiting(self):
        return 0 if self.ready else len(self.keys)

    def finished(self, *, waiting):
        return [(key, None) for key in self.keys] if self.ready else []


def test_this_process_goes_on_while_others_start(monkeypatch):
    monkeypatch.setattr(processes, "Processes", Starting)
    monkeypatch.setattr(processes, "_START", 0.0)
    workers = HereFirst(2, "workers=1", 10)
    for key in range(6):
        workers.submit(key, time.sleep, 0.001)
    assert Starting.last.keys == [1, 2]
    assert [key for key, _ in workers.finished(waiting=False)] == [0, 3, 4, 5]
    Starting.last.ready = True
    workers.finished(waiting=False)
    for key in range(6, 10):
        workers.submit(key, time.sleep, 0.001)
    assert Starting.last.keys == [1, 2, 6, 7, 8, 9]


def test_a_long_piece_is_not_done_here_while_others_start(monkeypatch):
    monkeypatch.setattr(processes, "Processes", Starting)
    monkeypatch.setattr(processes, "_START", 0.0)
    monkeypatch.setattr(processes, "_SHORT", 0.0)
    workers = HereFirst(2, "workers=1", 10)
    for key in range(6):
        workers.submit(key, time.sleep, 0.001)
    assert Starting.last.keys == [1, 2, 3, 4, 5]


REST = """
import os
from saltus.processes import Processes

workers = Processes(2, "")
workers.submit(0, os.getpid)
while not workers.finished(waiting=True):
    pass
workers.stop()
"""

LATE = """
import time
from concurrent.futures import process
from saltus.processes import resting

def wakeup(self):
    if not self._closed:
        writer = self._writer
        if process._global_shutdown:
            time.sleep(0.5)  # the pool's thread takes the last result here
        writer.send_bytes(b"")

process._ThreadWakeup.wakeup = wakeup
resting._pool.executor.submit(time.sleep, 0.1)
"""


@pytest.mark.parametrize("after", ["", LATE], ids=["no work", "a result on its way"])
def test_a_script_ends_with_processes_at_rest(after):
    ran = subprocess.run([sys.executable, "-c", REST + after], capture_output=True, text=True, timeout=60, check=True)
    assert (ran.stdout, ran.stderr) == ("", "")


class Watched:
    """A piece that knows which thread made the copy for a process."""

    copied_by: ClassVar[list[threading.Thread]] = []

    def __reduce__(self):
        self.copied_by.append(threading.current_thread())
        return str, ("copied",)


def test_pieces_are_copied_by_the_thread_that_hands_them_out(rested):
    """The executor's own thread waits for the lock of an interpreter at work, thousands of times during an import."""
    workers = Processes(1, "workers=1")
    workers.submit(0, str.upper, Watched())
    found = []
    while not found:
        found = workers.finished(waiting=True)
    workers.stop()
    assert found[0][1].result() == "COPIED"
    assert Watched.copied_by == [threading.current_thread()]


def test_a_piece_without_a_copy_has_the_error_as_its_outcome(rested):
    workers = Processes(1, "workers=1")
    workers.submit(0, lambda: None)
    ((_, outcome),) = workers.finished(waiting=True)
    with pytest.raises((AttributeError, pickle.PicklingError)):
        outcome.result()
    workers.stop()
