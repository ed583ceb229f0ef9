"""A process that works while this one attends to a person: one piece of work after the other, each can be stopped."""

from __future__ import annotations

import _thread
import gc
import queue
import signal
import threading
import traceback
from collections.abc import Callable
from multiprocessing import get_context
from time import monotonic, sleep
from types import FrameType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from saltus.errors import SaltusError
from saltus.progress import Progress
from saltus.work import leave_with_parent, starting, uncollected, unnoticed

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

__all__ = ["ENDED", "Companion", "Message"]

ENDED = "the process that worked on this has ended"  # what is said of each piece that it had

_PACE = 0.25  # seconds between two reports of progress, at least
_PAUSE = 0.005  # seconds between two tries to interrupt what may not be interrupted
# Modules in which an interrupt waits: of a package that is imported, or a function that is compiled, half would stay.
_WHOLE = ("importlib._bootstrap", "numba", "llvmlite")
_SPARES = 2  # processes without work that are kept, at most
_LAST_WORDS = 2.0  # seconds in which a process that is told to end may end by itself


class Message(NamedTuple):
    """What a companion says of a piece of work."""

    key: int  # the number of the piece
    kind: Literal["progress", "result", "error", "stopped"]  # what is said
    # a `saltus.Progress`, what the function returned, or an error's text; None of a piece that was stopped
    content: Any


class Companion:
    """One process that does pieces of work in turn.

    A piece is stopped by an interrupt, so that functions which keep what is done return this. The process starts at
    the first piece, or when `start` is called, and again after it has died. One that another companion has left
    without work is taken over, with the modules and compiled functions that it holds.

    Parameters
    ----------
    prepare : callable, optional
        Called without arguments in the process before the first piece; it must be importable.

    Examples
    --------
    >>> companion = Companion()
    >>> companion.heard()
    []
    """

    def __init__(self, prepare: Callable[[], object] | None = None) -> None:
        self._prepare = prepare
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._waiting: list[int] = []
        self._count = 0

    @property
    def busy(self) -> bool:
        """Whether a piece of work is under way or waits."""
        return bool(self._waiting)

    def start(self) -> None:
        """Start the process, if none runs.

        Raises
        ------
        SaltusError
            The system allows no further process.
        """
        if self._process is not None and self._process.is_alive():
            return
        if (spare := _spare(self._prepare)) is not None:
            self._process, self._pipe, self._count = spare
            return
        context = get_context("spawn")
        self._pipe, far = context.Pipe()
        with unnoticed(), starting():
            self._process = context.Process(target=_serve, args=(far, self._prepare), daemon=True)
            self._process.start()
        far.close()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> int:
        """Hand over a piece of work and return its number.

        Parameters
        ----------
        function : callable
            Called with the arguments and ``progress``, a function that is told how far the work has come.
        *arguments : object
            Function and arguments must be such that they can be pickled.

        Raises
        ------
        SaltusError
            The system allows no further process.
        """
        self.start()
        assert self._pipe is not None
        self._count += 1
        self._pipe.send((self._count, function, arguments))
        self._waiting.append(self._count)
        return self._count

    def heard(self) -> list[Message]:
        """Return what has been said since the last call; of a process that died, an error for each piece it had."""
        found: list[Message] = []
        try:
            while self._pipe is not None and self._pipe.poll():
                found.append(Message(*self._pipe.recv()))
        except (EOFError, OSError):
            self._pipe = None
        done = {message.key for message in found if message.kind != "progress"}
        self._waiting = [key for key in self._waiting if key not in done]
        if self._waiting and self._process is not None and not self._process.is_alive() and not found:
            found += [Message(key, "error", ENDED) for key in self._waiting]
            self._waiting = []
        return found

    def stop(self, key: int) -> None:
        """Interrupt a piece of work, or leave it out if it has not begun."""
        if self._pipe is not None and key in self._waiting:
            self._pipe.send((key, None, ()))

    def leave(self) -> None:
        """Leave the process to the next companion; one that works is ended, and so is the first of too many."""
        self.heard()
        if self._process is not None and self._pipe is not None and not self.busy:
            _LEFT.append((self._prepare, (self._process, self._pipe, self._count)))
            self._process = self._pipe = None
        self.end()
        while len(_LEFT) > _SPARES:
            _ended(_LEFT.pop(0)[1][0])

    def end(self) -> None:
        """End the process, whatever it is doing; what waited is answered as stopped."""
        process, self._process, self._pipe = self._process, None, None
        self._waiting = []
        if process is not None:
            _ended(process)


# processes that were left without work: what was called in each first, the process, its pipe, pieces it has done
_LEFT: list[tuple[Callable[[], object] | None, tuple[BaseProcess, Connection, int]]] = []


def _ended(process: BaseProcess) -> None:
    """End a process, whatever it is doing."""
    if process.is_alive():
        process.terminate()
        process.join(_LAST_WORDS)
        if process.is_alive():
            process.kill()


def _spare(prepare: Callable[[], object] | None) -> tuple[BaseProcess, Connection, int] | None:
    """Take a living process that was left, and in which the same was called first; None where there is none."""
    _LEFT[:] = [left for left in _LEFT if left[1][0].is_alive()]
    found = next((left for left in _LEFT if left[0] is prepare), None)
    if found is None:
        return None
    _LEFT.remove(found)
    return found[1]


# ---- inside the companion's process ----


class _Desk:
    """The piece of work under way, shared by the thread that works and the one that listens."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.current: int | None = None
        self.interrupted: int | None = None
        self.left_out: set[int] = set()

    def interrupt(self, signum: int, frame: FrameType | None) -> None:
        """Raise `KeyboardInterrupt`, unless the thread that works is where an interrupt waits."""
        if self.current is not None and not _is_whole(frame):
            self.interrupted = self.current
            raise KeyboardInterrupt


def _serve(pipe: Connection, prepare: Callable[[], object] | None) -> None:
    """Do what comes through the pipe until it is closed.

    Ctrl-C on the terminal stays blocked here, as the process was started so; `interrupt_main` is not a signal.
    """
    desk = _Desk()
    signal.signal(signal.SIGINT, desk.interrupt)
    threading.Thread(target=leave_with_parent, daemon=True).start()
    pieces: queue.Queue[Any] = queue.Queue()
    threading.Thread(target=_listen, args=(pipe, pieces, desk), daemon=True).start()
    if prepare is not None:
        with uncollected():
            prepare()
        gc.freeze()  # modules stay: no collection looks at them again
    while True:
        try:
            piece = pieces.get()
            if piece is None:
                return
            _do(pipe, desk, *piece)
        except KeyboardInterrupt:  # it came after the piece had ended
            continue


def _listen(pipe: Connection, pieces: queue.Queue[Any], desk: _Desk) -> None:
    """Queue pieces of work as they come; interrupt the one under way when its number comes alone."""
    while True:
        try:
            key, function, arguments = pipe.recv()
        except (EOFError, OSError):
            pieces.put(None)
            return
        if function is not None:
            pieces.put((key, function, arguments))
            continue
        with desk.lock:
            if desk.current != key:
                desk.left_out.add(key)
                continue
        threading.Thread(target=_interrupt, args=(desk, key), daemon=True).start()


def _interrupt(desk: _Desk, key: int) -> None:
    """Interrupt a piece of work as soon as this may be; once it was heard, the piece may use it to end well."""
    while True:
        with desk.lock:
            if desk.current != key or desk.interrupted == key:
                return
            _thread.interrupt_main()
        sleep(_PAUSE)


def _is_whole(frame: FrameType | None) -> bool:
    """Return whether a module is imported, or a function compiled, by the code at a frame."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(_WHOLE):
            return True
        frame = frame.f_back
    return False


def _do(pipe: Connection, desk: _Desk, key: int, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    """Do a piece of work and say what came of it."""
    last = 0.0

    def report(progress: Progress) -> None:
        nonlocal last
        if monotonic() - last >= _PACE:
            last = monotonic()
            pipe.send((key, "progress", progress))

    with desk.lock:
        if key in desk.left_out:
            pipe.send((key, "stopped", None))
            return
        desk.current = key
    answer: tuple[int, str, Any] = (key, "stopped", None)
    try:
        try:
            answer = (key, "result", function(*arguments, progress=report))
        finally:
            with desk.lock:
                desk.current = None
            sleep(0.0)  # an interrupt that came meanwhile is raised here, or at the latest by the next call
    except KeyboardInterrupt:
        pass
    except SaltusError as error:
        answer = (key, "error", str(error))
    except Exception as error:  # a fault of the package: the page tells it, the trace goes to stderr
        traceback.print_exc()
        answer = (key, "error", f"{type(error).__name__}: {error}; this is a fault of saltus")
    pipe.send(answer)
