"""Many pieces of work in processes of this machine, started where that saves time, and kept for the next call."""

from __future__ import annotations

import math
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.work import Here, Outcome, Threads, leave_with_parent, starting, unnoticed

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

__all__ = ["HereFirst", "Processes", "is_stopped"]

_TRIAL = 3.0  # seconds that a piece may take in this process before it is handed to others
_SHORT = 1.0  # seconds of the processor for a piece up to which this process does some, too, while others start
_START = (
    4.0  # seconds of the processor that must be saved to start processes: imports, and code loaded or compiled in each
)
_HAND_OVER = 0.5  # the same that must be saved to hand it to processes that are there
_REST = 60.0  # seconds for which processes are kept without work
_READ = ("SALTUS_", "NUMBA_", "XDG_", "HOME")  # beginnings of the environment's variables that decide what is computed


class _Pool(NamedTuple):
    """Processes, and what they were started with."""

    executor: ProcessPoolExecutor
    stop: Event
    workers: int
    surroundings: tuple[object, ...]


def _surroundings() -> tuple[object, ...]:
    """Return what a process takes over when it is started, as far as its work depends on it."""
    read = sorted((name, value) for name, value in os.environ.items() if name.startswith(_READ))
    return os.getpid(), os.getcwd(), tuple(sys.path), *read


class _Rest:
    """The processes that rest between two calls; they end after a while."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pool: _Pool | None = None
        self._timer: threading.Timer | None = None

    def has(self, count: int) -> bool:
        """Return whether so many processes rest here."""
        pool = self._pool
        return pool is not None and pool.workers == count and pool.surroundings == _surroundings()

    def take(self, count: int) -> _Pool | None:
        """Return so many processes, if they rest here and all live; others end."""
        with self._lock:
            pool, fitting = self._pool, self.has(count)
            self._pool = None
            if self._timer is not None:
                self._timer.cancel()
        if pool is None or pool.surroundings[0] != os.getpid():  # a fork has no threads that serve its parent's pool
            return None
        try:
            if fitting:
                pool.executor.submit(os.getpid)
                return pool
        except RuntimeError:  # a worker has died
            pass
        _end(pool)
        return None

    def keep(self, pool: _Pool) -> None:
        """Let processes rest; those that rested end."""
        with self._lock:
            before, self._pool = self._pool, pool
            if self._timer is not None:
                self._timer.cancel()
            self._timer = threading.Timer(_REST, self.end)
            self._timer.daemon = True
            self._timer.start()
        if before is not None:
            _end(before)

    def end(self) -> None:
        """End the processes that rest."""
        with self._lock:
            pool, self._pool = self._pool, None
            if self._timer is not None:
                self._timer.cancel()
        if pool is not None:
            _end(pool)

    def leave(self) -> None:
        """End the processes that rest, before the interpreter does.

        The interpreter's own way writes to pipes that the pool's thread may just be closing.
        """
        if self._pool is not None and self._pool.surroundings[0] == os.getpid():
            self.end()


def _end(pool: _Pool) -> None:
    pool.stop.set()
    pool.executor.shutdown(wait=True, cancel_futures=True)


resting = _Rest()
threading._register_atexit(resting.leave)  # type: ignore[attr-defined]  # called before that of concurrent.futures


class Processes(Threads):
    """Work in processes on this machine, in which `is_stopped` tells that the work is given up.

    A piece whose process dies has the error as its outcome. Processes that have done all their work rest for a minute:
    the next one of this class with as many takes them over, unless what they were started in has changed.

    Parameters
    ----------
    count : int
        How many processes.
    fewer : str
        The option that asks for none, for messages.
    """

    def __init__(self, count: int, fewer: str) -> None:
        super().__init__(count, fewer)
        self._refused: list[tuple[Any, Outcome]] = []

    def _made(self, count: int) -> Executor:
        pool = resting.take(count)
        self._started = pool is not None
        if pool is None:
            context = get_context("spawn")  # the same everywhere, and safe where threads run: Numba's, NumPy's
            stop = context.Event()
            executor = ProcessPoolExecutor(count, context, _begin_worker, (stop,))
            pool = _Pool(executor, stop, count, _surroundings())
        self._pool = pool
        return pool.executor

    def _start(self) -> None:
        """Start all processes at once: one that dies while others start can bring the executor's own thread down."""
        self._started = True
        with unnoticed(), starting(self._fewer):
            for _ in range(self._pool.workers):
                self._executor.submit(os.getpid)  # as long as none is idle, each call starts one

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Take on a piece of work."""
        if not self._started:
            self._start()
        try:
            # packed here: the executor's thread would wait for the interpreter's lock at each import that this needs
            piece = pickle.dumps((function, arguments))
            self._pending[self._executor.submit(_done, piece)] = key
        except (RuntimeError, pickle.PicklingError, AttributeError, TypeError) as error:  # a worker's death, or no copy
            refused: Future[Any] = Future()
            refused.set_exception(error)
            self._refused.append((key, refused))

    def waiting(self) -> int:
        """Return how many pieces are not done."""
        return sum(not future.done() for future in self._pending)

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once; wait for the next one, if asked to, for half a second."""
        refused, self._refused = self._refused, []
        done = super().finished(waiting=waiting and not refused)
        return refused + [(key, _Unpacked(outcome)) for key, outcome in done]

    def stop(self) -> None:
        """Let the processes rest if all work is done; otherwise tell them to stop, and wait until they are gone."""
        if self._started and not self.waiting() and self._lives():
            resting.keep(self._pool)
            return
        self._pool.stop.set()
        super().stop()

    def _lives(self) -> bool:
        try:
            self._executor.submit(os.getpid)
        except RuntimeError:
            return False
        return True


class _Unpacked:
    """The outcome of a piece that was packed where it was done."""

    def __init__(self, packed: Outcome) -> None:
        self._packed = packed

    def result(self) -> Any:
        """Return it, or raise what the work raised."""
        return pickle.loads(self._packed.result())


class HereFirst:
    """Work in this thread for as long as that is quicker than to start processes; then in processes.

    While processes start, this thread goes on with short pieces. A piece that takes long is given up here, where
    `is_stopped` tells it so, and is done anew in a process.

    Parameters
    ----------
    count : int
        How many processes.
    fewer : str
        The option that asks for none, for messages.
    pieces : int
        How many pieces there will be.
    """

    def __init__(self, count: int, fewer: str, pieces: int) -> None:
        self._count, self._fewer, self._left = count, fewer, pieces
        self._here = Here()
        self._seconds: list[float] = []
        self._processes: Processes | None = None
        self._ready = False

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Do a piece of work, or hand it to a process."""
        if not self._hands_over() and self._done_here(key, function, *arguments):
            return
        if self._processes is None:
            self._ready = resting.has(self._count)
            self._processes = Processes(self._count, self._fewer)
        self._processes.submit(key, function, *arguments)

    def _done_here(self, key: Any, function: Callable[..., Any], *arguments: Any) -> bool:
        """Do a piece of work, unless it takes too long; return whether it is done."""
        began = time.thread_time()  # on a busy machine pieces and the start of processes take longer alike
        with _limited(_TRIAL) as given_up:
            trial = Here()
            trial.submit(key, function, *arguments)
        if given_up():
            return False
        self._here.take(trial)
        self._seconds.append(time.thread_time() - began)
        self._left -= 1
        return True

    def _hands_over(self) -> bool:
        """Return whether a process does the next piece: where that saves more time than it takes."""
        mean = sum(self._seconds) / len(self._seconds) if self._seconds else math.inf
        if self._processes is not None:
            return self._ready or mean > _SHORT or self._processes.waiting() < self._count
        if not self._seconds:
            return _TRIAL <= 0.0
        least = _HAND_OVER if resting.has(self._count) else _START
        return mean * self._left * (1.0 - 1.0 / self._count) > least

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once; wait for the next one, if asked to, for half a second."""
        done = self._here.finished(waiting=False)
        if self._processes is None:
            return done
        found = self._processes.finished(waiting=waiting and not done)
        self._ready = self._ready or bool(found)
        return done + found

    def stop(self) -> None:
        """Give up what is not done, and wait until its processes are gone; without such work they rest."""
        if self._processes is not None:
            self._processes.stop()


# ---- inside a process that works ----


_stop: Event | None = None  # set where the parent wants its workers to end
_limit: threading.local = threading.local()  # where a piece of work in this thread has a limit: the time, and a flag


def is_stopped() -> bool:
    """Return whether the work under way has been given up by who handed it out."""
    if _stop is not None and _stop.is_set():
        return True
    until = getattr(_limit, "until", math.inf)
    _limit.passed = getattr(_limit, "passed", False) or time.perf_counter() > until
    return bool(_limit.passed)


@contextmanager
def _limited(seconds: float) -> Iterator[Callable[[], bool]]:
    """Let `is_stopped` tell in this thread, from some seconds on, that the work is given up; yield whether it did."""
    _limit.until, _limit.passed = time.perf_counter() + seconds, False
    told: list[bool] = []
    try:
        yield lambda: bool(told and told[0])
    finally:
        told.append(_limit.passed)
        _limit.until, _limit.passed = math.inf, False


def _done(piece: bytes) -> bytes:
    """Do a piece of work; return its result, packed."""
    function, arguments = pickle.loads(piece)
    return pickle.dumps(function(*arguments))


def _begin_worker(stop: Event) -> None:
    """Prepare a worker: Ctrl-C is the parent's to handle, no worker outlives it, and each keeps to its processor."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read where NumPy is imported
    threading.Thread(target=leave_with_parent, daemon=True).start()
