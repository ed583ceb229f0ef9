"""A session at work: steps go to a companion process, results come back; what its pages show, without widgets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.companion import ENDED, Companion
from saltus.errors import InputError, SaltusError
from saltus.explorer.kinds import motion_instead
from saltus.explorer.tasks import Outcome, normal_forms, prepare, take, warm

if TYPE_CHECKING:
    from saltus.explorer.application import Application
    from saltus.explorer.session import Entry, Session
    from saltus.explorer.steps import Step
    from saltus.progress import Progress

__all__ = ["DELETED", "FILM", "Desk", "Job", "Listener", "Work", "start_ahead"]

FILM = "film.gif"  # file of a session's folder that has the last film
DELETED = "this session was deleted in another page"


@dataclass(frozen=True)
class Job:
    """A piece of work that was asked for."""

    what: str  # what is done, in words
    function: Callable[..., Any]  # what the companion calls
    arguments: tuple[Any, ...]
    step: Step | None = None  # the step; None for a film or normal forms
    done: Callable[[Any], object] | None = None  # called with the entry of a step, or with normal forms
    replaces: str = ""  # name of a result that this one replaces
    axes: tuple[str, ...] = ()  # what the diagram showed when it was asked for


class Work(NamedTuple):
    """How the work stands."""

    what: str = ""  # what is under way, in words; empty when all is done
    progress: Progress | None = None  # how far it has come, once that is known
    waiting: tuple[str, ...] = ()  # what waits behind it, in words
    stopping: bool = False  # whether it was told to stop
    trail: tuple[tuple[float, float], ...] = ()  # places on the diagram's axes of what was found so far
    silent: int = 0  # seconds since the process has said anything


class Listener:
    """What a desk tells each of its pages; a page overrides what it wants to hear."""

    def added(self, entry: Entry) -> None:
        """A result has come."""

    def filmed(self, path: Path) -> None:
        """A film has come."""

    def changed(self) -> None:
        """Another page has changed the session."""

    def worked(self, work: Work) -> None:
        """Work goes on, or is done."""

    def told(self, line: str, *, error: bool = False) -> None:
        """A line is to be shown."""


def start_ahead() -> None:
    """Start a process that works before there is a desk, which takes it over.

    Raises
    ------
    SaltusError
        The system allows no further process.
    """
    ahead = Companion(prepare)
    ahead.start()
    ahead.leave()


def _at_once(work: Callable[[], None]) -> None:
    work()


class Desk:
    """A session, the process that works for it, and the pages that show it.

    Parameters
    ----------
    application : Application
        Who films.
    session : Session
        The session.

    Attributes
    ----------
    left : bool
        Whether all pages that showed the session are gone.
    """

    def __init__(self, application: Application, session: Session) -> None:
        self.application, self.session = application, session
        self.left = False
        self._listeners: dict[Listener, Callable[[Callable[[], None]], object]] = {}
        self._companion = Companion(prepare)
        self._jobs: dict[int, Job] = {}
        self._progress: Progress | None = None
        self._trail: list[tuple[float, float]] = []
        self._stopping: set[int] = set()
        self._unwritten: list[Entry] = []
        self._warming: int | None = None
        self._silent, self._heard = 0, monotonic()

    @property
    def busy(self) -> bool:
        """Whether work is under way."""
        return bool(self._jobs)

    @property
    def work(self) -> Work:
        """How the work stands."""
        if not self._jobs:
            return Work()
        (key, job), *others = self._jobs.items()
        waiting = tuple(other.what for _, other in others)
        trail = tuple(self._trail) if job.axes == self.session.settings.axes else ()
        return Work(job.what, self._progress, waiting, key in self._stopping, trail, self._silent)

    @property
    def kept(self) -> str:
        """What the session has, in words."""
        names = ", ".join(entry.name for entry in self.session.entries)
        return f"kept: {names}" if names else "there was nothing to keep"

    # ---- pages ----

    def join(self, listener: Listener, post: Callable[[Callable[[], None]], object] = _at_once) -> None:
        """Let a page show this session.

        Parameters
        ----------
        listener : Listener
            The page.
        post : callable, optional
            Called with a function without arguments, which it calls, soon, where the page may be written.
        """
        self._listeners[listener] = post
        self.left = False

    def leave(self, listener: Listener) -> None:
        """Forget a page that is gone."""
        self._listeners.pop(listener, None)
        self.left = not self._listeners

    def change(self, by: Listener) -> None:
        """Tell all other pages that one of them has changed the session."""
        self._tell(lambda listener: listener.changed(), but=by)

    def tell(self, line: str, *, error: bool = False) -> None:
        """Show a line in all pages."""
        self._tell(lambda listener: listener.told(line, error=error))

    def _tell(self, say: Callable[[Listener], None], but: Listener | None = None) -> None:
        """Say something to each page, under its own lock."""
        for listener, post in [*self._listeners.items()]:
            if listener is not but:
                post(lambda listener=listener: say(listener))  # type: ignore[misc]  # the loop's listener, as it is now

    def _tell_work(self) -> None:
        work = self.work
        self._tell(lambda listener: listener.worked(work))

    # ---- work ----

    def start(self) -> None:
        """Start the process that works, before there is work."""
        try:
            self._companion.start()
        except SaltusError as error:
            self.tell(str(error), error=True)

    def run(self, step: Step, done: Callable[[Entry], None] | None = None, replaces: str = "") -> None:
        """Take a step.

        Parameters
        ----------
        step : Step
            The step.
        done : callable, optional
            Called with the entry when it has come.
        replaces : str, optional
            Name of a result that this one replaces.
        """
        results = {name: result for name, result in self.session.results.items() if name in step.needs}
        axes = self.session.settings.axes
        arguments = (self.session.subject.definition, step.model_dump(), results, axes)
        self._hand_over(Job(f"{step.noun}: {step.text()}", take, arguments, step, done, replaces, axes))

    def film(self, orbit: Any) -> None:
        """Film an orbit into the session's folder."""
        path = self.session.folder / FILM
        self._hand_over(Job("film", self.application.film, (orbit, str(path))))

    def normal_forms(self, result: Any, done: Callable[[dict[str, str]], None], by: Listener) -> None:
        """Compute the normal forms of a curve's special points, in words by label, for one of the pages."""
        post = self._listeners.get(by, _at_once)
        told = Job("normal forms", normal_forms, (result,), done=lambda forms: post(lambda: done(forms)))
        self._hand_over(told)

    def warm(self) -> None:
        """Let the companion load what branches and basins need, as long as nothing else is wanted."""
        self._warming = self._companion.submit(warm, self.session.subject.definition, self.session.settings.x0)

    def _hand_over(self, job: Job) -> None:
        if self.session.forgotten:
            self.tell(DELETED, error=True)
            return
        if self._warming is not None:
            self._companion.stop(self._warming)
            self._warming = None
        try:
            key = self._companion.submit(job.function, *job.arguments)
        except SaltusError as error:
            self.tell(str(error), error=True)
            return
        if not self._jobs:
            self._silent, self._heard = 0, monotonic()
        self._jobs[key] = job
        self._tell_work()

    def attend(self) -> None:
        """Take in what the companion has said, else write what has come: to be called again and again."""
        if self._jobs and self.listen():
            return
        silent = int(monotonic() - self._heard) if self._jobs else 0
        if silent != self._silent:
            self._silent = silent
            self._tell_work()
        self.write()

    def listen(self) -> bool:
        """Take in what the companion has said since the last call, and return whether it has said anything."""
        messages = [message for message in self._companion.heard() if message.key in self._jobs]
        if messages:
            self._silent, self._heard = 0, monotonic()
        for message in messages:
            if message.kind == "progress":
                self._progress = message.content
                if message.content.last is not None:
                    self._trail.append(message.content.last)
                continue
            job, self._progress, self._trail = self._jobs.pop(message.key), None, []
            self._stopping.discard(message.key)
            if message.kind == "result":
                self._arrived(job, message.content)
            elif message.kind == "error":
                self.tell(self._told(str(message.content)), error=True)
                if (motion := motion_instead(job.step, str(message.content), self.session.system)) is not None:
                    self.run(motion)
            else:
                self.tell("stopped before there was anything to keep")
        if messages:
            self._tell_work()
            if not self._jobs and len(self.session.entries) == 1:
                self.warm()
        return bool(messages)

    def _told(self, error: str) -> str:
        """Return an error in words; of a process that died, also what is kept."""
        return f"{error}; {self.kept}" if error == ENDED else error

    def _arrived(self, job: Job, content: Any) -> None:
        if not isinstance(content, Outcome):
            if job.done is not None:
                job.done(content)
            else:
                self._tell(lambda listener: listener.filmed(content))
            return
        if job.replaces and job.replaces in self.session.results:
            self.session.replace(job.replaces)
        assert job.step is not None
        entry = self.session.add(job.step, content.result, content.seconds, content.notes)
        self._unwritten.append(entry)
        self._tell(lambda listener: listener.added(entry))
        for note in content.notes:
            self.tell(note)
        if job.done is not None:
            job.done(entry)

    def write(self) -> None:
        """Write results that have come since the last call into the session's folder."""
        while self._unwritten:
            entry = self._unwritten.pop(0)
            if entry in self.session.entries:
                try:
                    self.session.write(entry)
                except SaltusError as error:
                    self.tell(f"the session is not kept: {error}", error=True)

    def undo(self, seen: str) -> Entry | None:
        """Drop the last result; return it.

        Parameters
        ----------
        seen : str
            Its name, as the person saw it: another result may have come meanwhile.

        Raises
        ------
        InputError
            Another result is the last one, or work under way begins at it.
        """
        last = self.session.last
        if seen != last:
            hint = f"that is {last} now" if last else "all are gone"
            raise InputError("result to be dropped", seen, "the last one", hint)
        for job in self._jobs.values():
            if job.step is not None and last in job.step.needs:
                raise InputError(
                    "result", last, "one with which nothing is under way", f"stop the {job.step.noun} first"
                )
        return self.session.undo()

    def stop(self) -> None:
        """Interrupt what is under way, and leave out what waits; what is done is kept where the function keeps it."""
        for key in reversed(self._jobs):
            self._companion.stop(key)
        self._stopping.update(self._jobs)
        self._tell_work()

    def kill(self) -> None:
        """End the process that works, whatever it does, and start a new one; work asked for since `stop` is redone."""
        self._companion.end()
        later = [job for key, job in self._jobs.items() if key not in self._stopping]
        self._forget_work()
        self.start()
        for job in later:
            self._hand_over(job)
        self._tell_work()
        self.tell("the work was ended")

    def _forget_work(self) -> None:
        self._jobs.clear()
        self._stopping.clear()
        self._progress = self._warming = None
        self._trail = []

    def close(self) -> None:
        """Leave the process that works, and what it has not done; the session stays in its folder."""
        self.write()
        self._companion.leave()
        self._forget_work()
        self._tell_work()
