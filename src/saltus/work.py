"""Many pieces of work at the same time: in this thread, in threads, or on a Dask cluster."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from importlib import import_module
from multiprocessing import parent_process
from types import ModuleType
from typing import Any, Protocol, TypeAlias

from saltus.errors import InputError, SaltusError

__all__ = [
    "Cluster",
    "Here",
    "Job",
    "Outcome",
    "Threads",
    "Workers",
    "handed_out",
    "interrupt_noted",
    "interrupt_waits",
    "leave_with_parent",
    "processors",
    "starting",
    "uncollected",
    "unnoticed",
]

Job: TypeAlias = "tuple[Any, Callable[..., Any], *tuple[Any, ...]]"  # a piece's key, a function and its arguments
_HEARD = 0.5  # seconds between two looks of a process that waits for a piece, so that Ctrl-C is heard everywhere
_REFUSED = "can't start new thread"  # Python's words for it


@contextmanager
def starting(fewer: str = "") -> Iterator[None]:
    """Raise `SaltusError` where a thread or a process is refused.

    Parameters
    ----------
    fewer : str, optional
        The option that says how many there are, and the value for which none is started.

    Examples
    --------
    >>> with starting("workers=1"):
    ...     raise RuntimeError("can't start new thread")
    Traceback (most recent call last):
        ...
    saltus.errors.SaltusError: the system allows no further thread or process here (ulimit -u): allow more, or workers=1
    """
    try:
        yield
    except (RuntimeError, BlockingIOError) as error:
        if isinstance(error, RuntimeError) and _REFUSED not in str(error):
            raise
        told = "the system allows no further thread or process here (ulimit -u): allow more"
        raise SaltusError(told + (f", or {fewer}" if fewer else "")) from error


@contextmanager
def interrupt_waits() -> Iterator[None]:
    """Let an interrupt (Ctrl-C) wait until the block has ended: inside C libraries that call back it may get lost."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    waiting: list[tuple[Any, ...]] = []
    signal.signal(signal.SIGINT, lambda *told: waiting.append(told))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if waiting:
            handler(*waiting[0])


@contextmanager
def interrupt_noted(act: Callable[[], object] = lambda: None) -> Iterator[list[float]]:
    """Note an interrupt (Ctrl-C) in the block, which then ends soon by itself; a second one is raised as always.

    `act` is called at the interrupt, between two instructions of the block. The list that is given has an entry from
    then on. Outside the main thread nothing is noted.
    """
    noted: list[float] = []
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield noted
        return

    def note(*told: Any) -> None:
        if noted:
            handler(*told)
        noted.append(time.monotonic())
        act()

    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, handler)


@contextmanager
def uncollected() -> Iterator[None]:
    """Keep the garbage collector away while much is made that stays, such as modules: it looks at all objects again.

    Importing Panel and the explorer's page takes 0.6 s of a processor in place of 1.1 s.
    """
    before = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if before:
            gc.enable()


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Outcome(Protocol):
    """The outcome of a piece of work: a future, of any library."""

    def result(self) -> Any:
        """Return it, or raise what the work raised."""


class Workers(Protocol):
    """Workers that take pieces of work and return them in the order in which they are done."""

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Take on a piece of work."""

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once; wait for the next one, at most for a short while, if asked to."""

    def stop(self) -> None:
        """Give up what is not done; what is done meanwhile `finished` still returns."""


class Here:
    """Work in this thread: done as soon as it is submitted."""

    def __init__(self) -> None:
        self._done: list[tuple[Any, Outcome]] = []

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Do a piece of work; what it raises is raised."""
        done: Future[Any] = Future()
        done.set_result(function(*arguments))
        self._done.append((key, done))

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once."""
        done, self._done = self._done, []
        return done

    def take(self, other: Here) -> None:
        """Take over what another one has done."""
        self._done += other.finished(waiting=False)

    def stop(self) -> None:
        """Nothing is under way."""


class Threads:
    """Work in threads of this process: of use where compiled code runs without the interpreter's lock.

    Parameters
    ----------
    count : int
        How many threads.
    fewer : str
        The option that asks for none, for messages.
    """

    def __init__(self, count: int, fewer: str) -> None:
        self._executor = self._made(count)
        self._fewer = fewer
        self._pending: dict[Future[Any], Any] = {}

    def _made(self, count: int) -> Executor:
        return ThreadPoolExecutor(count)

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Take on a piece of work."""
        with starting(self._fewer):
            self._pending[self._executor.submit(function, *arguments)] = key

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once; wait for the next one, if asked to, for half a second."""
        done = wait(self._pending, _HEARD if waiting else 0.0, FIRST_COMPLETED).done
        return [(self._pending.pop(future), future) for future in done]

    def stop(self) -> None:
        """Wait for what is under way; give up the rest."""
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._pending = {future: key for future, key in self._pending.items() if not future.cancelled()}


class Cluster:
    """Work on a Dask cluster.

    Parameters
    ----------
    client : dask.distributed.Client
        The cluster; what a worker that dies had in hand goes to another.
    name : str, optional
        What a message calls it.

    Raises
    ------
    InputError
        It is no client.
    """

    def __init__(self, client: Any, name: str = "client") -> None:
        if not callable(getattr(client, "submit", None)):
            raise InputError(name, client, "a dask.distributed.Client")
        self._client = client
        self._ready: Any = import_module("distributed").as_completed(loop=client.loop)
        self._pending: dict[str, tuple[Any, Any]] = {}
        self._done: list[tuple[Any, Outcome]] = []

    def submit(self, key: Any, function: Callable[..., Any], *arguments: Any) -> None:
        """Take on a piece of work."""
        future = self._client.submit(function, *arguments, pure=False)
        self._pending[future.key] = (key, future)
        self._ready.add(future)

    def finished(self, *, waiting: bool) -> list[tuple[Any, Outcome]]:
        """Return what is done, each piece once; wait for the next one if asked to."""
        done, self._done = self._done, []
        while self._pending and (self._ready.has_ready() or (waiting and not done)):
            future = next(self._ready)
            done.append((self._pending.pop(future.key)[0], future))
        return done

    def stop(self) -> None:
        """Give up what no worker has done."""
        self._done += [(key, future) for key, future in self._pending.values() if future.done()]
        self._client.cancel([future for _, future in self._pending.values() if not future.done()])
        self._pending.clear()


def handed_out(
    workers: Workers,
    jobs: Iterable[Job],
    at_once: Callable[[], int],
    after: Callable[[Any, Any], Iterable[Job]] | None = None,
) -> Generator[tuple[Any, Any], None, None]:
    """Yield key and result of each job as it is finished; closing the generator stops the work.

    Parameters
    ----------
    workers : Workers
        The workers.
    jobs : iterable of tuple
        The jobs, in the order in which they are begun.
    at_once : callable
        Returns how many may wait or be under way with the workers.
    after : callable, optional
        Returns the jobs that follow on a finished one, from what it is known by and its result.
    """
    waiting, under_way = deque(jobs), 0
    try:
        while waiting or under_way:
            while waiting and under_way < at_once():
                workers.submit(*waiting.popleft())
                under_way += 1
            for key, outcome in workers.finished(waiting=True):
                result = outcome.result()
                under_way -= 1
                for following in () if after is None else after(key, result):
                    workers.submit(*following)
                    under_way += 1
                yield key, result
    finally:
        workers.stop()


def leave_with_parent() -> None:
    """End this process when the one that started it has ended."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def unnoticed() -> Iterator[None]:
    """Let processes that start meanwhile neither run the main script again nor hear Ctrl-C.

    All that a worker does is in this package, so that a script needs no ``if __name__ == "__main__"``. The signal stays
    blocked in what starts here; in this process it waits.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    masked = None
    if sys.platform != "win32":
        masked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with interrupt_waits():  # another thread may take the signal: a process half started would say so
            yield
    finally:
        sys.modules["__main__"] = main
        if sys.platform != "win32" and masked is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, masked)
