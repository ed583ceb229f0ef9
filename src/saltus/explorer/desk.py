"""A session at work: steps go to a companion process, results come back; what a page shows, without widgets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.companion import Companion
from saltus.errors import SaltusError
from saltus.explorer.tasks import Outcome, normal_forms, prepare, take, warm

if TYPE_CHECKING:
    from saltus.explorer.application import Application
    from saltus.explorer.session import Entry, Session
    from saltus.explorer.steps import Step
    from saltus.progress import Progress

__all__ = ["Desk", "Job", "Listener"]


@dataclass(frozen=True)
class Job:
    """A piece of work under way."""

    what: str  # what is done, in words
    step: Step | None = None  # the step; None for a film or normal forms
    done: Callable[[Any], None] | None = None  # called with the entry of a step, or what else has come
    replaces: str = ""  # name of a result that this one replaces


class Listener:
    """What a desk tells its page; a page overrides what it wants to hear."""

    def added(self, entry: Entry) -> None:
        """A result has come."""

    def progressed(self, what: str, progress: Progress | None) -> None:
        """Work goes on; `what` is empty when all is done."""

    def told(self, line: str, *, error: bool = False) -> None:
        """A line is to be shown."""

    def left(self) -> None:
        """Another page has taken the session over."""


class Desk:
    """A session and the process that works for it.

    Parameters
    ----------
    application : Application
        Who films.
    session : Session
        The session.
    """

    def __init__(self, application: Application, session: Session) -> None:
        self.application, self.session = application, session
        self.listener = Listener()
        self._companion = Companion(prepare)
        self._jobs: dict[int, Job] = {}
        self._unwritten: list[Entry] = []
        self._warming: int | None = None

    @property
    def busy(self) -> bool:
        """Whether work is under way."""
        return bool(self._jobs)

    def start(self) -> None:
        """Start the process that works, before there is work."""
        try:
            self._companion.start()
        except SaltusError as error:
            self.listener.told(str(error), error=True)

    def taken_by(self, listener: Listener) -> None:
        """Let another page show this session from now on."""
        before, self.listener = self.listener, listener
        before.left()

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
        arguments = (self.session.subject.definition, step.model_dump(), results)
        self._hand_over(Job(f"{step.noun}: {step.text()}", step, done, replaces), take, *arguments)

    def film(self, orbit: Any, done: Callable[[Path], None]) -> None:
        """Film an orbit into the session's folder."""
        path = self.session.folder / "film.gif"
        self._hand_over(Job("film", None, done), self.application.film, orbit, str(path))

    def normal_forms(self, result: Any, done: Callable[[dict[str, str]], None]) -> None:
        """Compute the normal forms of a curve's special points, in words by label."""
        self._hand_over(Job("normal forms", None, done), normal_forms, result)

    def warm(self) -> None:
        """Let the companion load what basins need, as long as nothing else is wanted."""
        self._warming = self._companion.submit(warm, self.session.subject.definition, self.session.settings.x0)

    def _hand_over(self, job: Job, function: Callable[..., Any], *arguments: Any) -> None:
        if self._warming is not None:
            self._companion.stop(self._warming)
            self._warming = None
        try:
            key = self._companion.submit(function, *arguments)
        except SaltusError as error:
            self.listener.told(str(error), error=True)
            return
        self._jobs[key] = job
        self.listener.progressed(job.what, None)

    def listen(self) -> None:
        """Take in what the companion has said since the last call."""
        for message in self._companion.heard():
            job = self._jobs.get(message.key)
            if job is None:
                continue
            if message.kind == "progress":
                self.listener.progressed(job.what, message.content)
                continue
            del self._jobs[message.key]
            if message.kind == "result":
                self._arrived(job, message.content)
            elif message.kind == "error":
                self.listener.told(str(message.content), error=True)
            else:
                self.listener.told("stopped before there was anything to keep")
        if not self._jobs:
            self.listener.progressed("", None)

    def _arrived(self, job: Job, content: Any) -> None:
        if not isinstance(content, Outcome):
            if job.done is not None:
                job.done(content)
            return
        if job.replaces and job.replaces in self.session.results:
            self.session.replace(job.replaces)
        assert job.step is not None
        entry = self.session.add(job.step, content.result, content.seconds, content.notes)
        self._unwritten.append(entry)
        self.listener.added(entry)
        for note in content.notes:
            self.listener.told(note)
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
                    self.listener.told(f"the session is not kept: {error}", error=True)

    def stop(self) -> None:
        """Interrupt what is under way, and leave out what waits; what is done is kept where the function keeps it."""
        for key in reversed(self._jobs):
            self._companion.stop(key)

    def kill(self) -> None:
        """End the process that works, whatever it does, and start a new one."""
        self._companion.end()
        self._jobs.clear()
        self._companion.start()
        self.listener.progressed("", None)
        self.listener.told("the work was ended")

    def close(self) -> None:
        """End the process that works; the session stays in its folder."""
        self.write()
        self._companion.end()
