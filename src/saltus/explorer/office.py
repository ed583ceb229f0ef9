"""All sessions of a server: which are open, which lie in their folders."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from saltus.errors import InputError, SaltusError
from saltus.explorer.desk import DELETED, Desk
from saltus.explorer.session import Session, folder_of, is_vacant, new_folder, removed, sessions_in
from saltus.explorer.session_lock import SessionLock

if TYPE_CHECKING:
    from saltus.explorer.application import Application
    from saltus.explorer.subjects import Subject

__all__ = ["Listed", "Office", "home_folder"]

_UPLOAD = 2**26  # bytes that a session's file may have


class Listed(NamedTuple):
    """A session in the list."""

    folder: str  # what its folder is called
    name: str  # what the person has called it; empty without
    key: str  # key of its system
    results: int  # how many it has
    at: float  # when it was changed last, in seconds since 1970


def home_folder() -> Path:
    """Return the folder of all sessions of this user."""
    from platformdirs import user_data_path

    return user_data_path("saltus") / "explorer"


class Office:
    """All sessions of a server.

    Parameters
    ----------
    application : Application
        Whose models can be chosen.
    subject : Subject or None
        The system; None for a choice among the models.
    home : Path
        Folder of the sessions.
    """

    def __init__(self, application: Application, subject: Subject | None, home: Path) -> None:
        self.application, self.subject, self.home = application, subject, home
        self._desks: dict[str, Desk] = {}
        self._locks: dict[str, SessionLock] = {}
        self._empty: dict[str, Path] = {}  # folders of sessions without results whose pages are gone

    def desk(self, name: str | None, system: str | None = None) -> Desk:
        """Return the desk of a session, reopened if it exists, else that of a new session.

        Parameters
        ----------
        name : str or None
            What the session's folder is called.
        system : str, optional
            A model of the application, where the server has no system of its own.

        Raises
        ------
        SaltusError
            There is no such model, another server has the session open, or the folder cannot be written.
        """
        if name is not None and name in self._desks:
            return self._desks[name]
        folder = folder_of(self.home, name)
        if folder is None:
            return self._opened(self._new(system))
        self._lock(folder)
        try:
            return self._opened(Session.reopened(folder))
        except SaltusError:
            self._unlock(folder)
            raise

    def _lock(self, folder: Path) -> None:
        """Keep other servers from a session."""
        if folder.name not in self._locks:
            lock = SessionLock(folder)
            lock.take()
            self._locks[folder.name] = lock

    def _unlock(self, folder: Path) -> None:
        if (lock := self._locks.pop(folder.name, None)) is not None:
            lock.release()

    def _opened(self, session: Session) -> Desk:
        self._lock(session.folder)
        desk = Desk(self.application, session)
        self._desks[session.folder.name] = desk
        self._empty.pop(session.folder.name, None)
        session.keep()
        return desk

    def _new(self, system: str | None = None) -> Session:
        models = self.application
        subject = self.subject or models.subject(system or next(iter(models.titles)))
        return Session(subject, new_folder(self.home))

    def unpacked(self, file: Path) -> str:
        """Return the name of a new session with the content of a file.

        Raises
        ------
        InputError
            The file holds no session.
        """
        folder = new_folder(self.home)
        try:
            return self._opened(Session.unpacked(file, folder)).session.folder.name
        except SaltusError:
            removed(folder)
            raise

    def uploaded(self, content: bytes) -> str:
        """Return the name of a new session with an uploaded content, whatever its file was called.

        Raises
        ------
        InputError
            The content is no session, or too large.
        """
        if len(content) > _UPLOAD:
            raise InputError("file", f"{len(content)} bytes", f"one of at most {_UPLOAD} bytes")
        folder = new_folder(self.home)
        try:
            file = folder / "upload.nc"
            file.write_bytes(content)
            return self.unpacked(file)
        finally:
            removed(folder)

    def defined(self, subject: Subject) -> str:
        """Return the name of a new session of a system that was typed."""
        return self._opened(Session(subject, new_folder(self.home))).session.folder.name

    @property
    def key(self) -> str:
        """Key of the system that a new session has."""
        return next(iter(self.application.titles)) if self.subject is None else self.subject.key

    def unfinished(self) -> str | None:
        """Return the newest session of the same system that was not closed on purpose, if it has results."""
        for folder, notes in sessions_in(self.home):
            if (
                notes["subject"][0] == self.key
                and notes["entries"]
                and not notes.get("closed", True)
                and folder.name not in self._desks
                and SessionLock(folder).is_free
            ):
                return folder.name
        return None

    def attend(self) -> None:
        """Take in what all processes have said; close sessions whose pages are gone when their work is done."""
        for desk in [*self._desks.values()]:
            desk.attend()
            if desk.left and not desk.busy:
                self._close(desk)

    def listed(self) -> list[Listed]:
        """Return all sessions that have results, or are open, the newest first."""
        told = {folder.name: notes for folder, notes in sessions_in(self.home)}
        found = [
            Listed(name, str(notes.get("name", "")), notes["subject"][0], len(notes["entries"]), float(notes["at"]))
            for name, notes in told.items()
        ]
        return [one for one in found if one.results or one.folder in self._desks]

    def delete(self, name: str) -> None:
        """Delete a session with all its results; work for it is ended.

        Raises
        ------
        InputError
            Another server has it open.
        """
        folder = folder_of(self.home, name)
        if folder is not None:
            self._lock(folder)
        desk = self._desks.pop(name, None)
        if desk is not None:
            desk.session.forgotten = True
            desk.close()
            desk.tell(DELETED, error=True)
        if folder is not None:
            self._unlock(folder)
            removed(folder)

    def sweep(self) -> None:
        """Remove the folders without results that killed servers have left; those of a living server are locked."""
        for folder in [folder for folder, notes in sessions_in(self.home) if not notes["entries"]]:
            lock, vacant = SessionLock(folder), False
            with suppress(InputError):  # another server has it open, or has just removed it
                lock.take()
                vacant = is_vacant(folder)
            lock.release()
            if vacant:
                removed(folder)

    def close(self) -> None:
        """Close all sessions, on purpose; those without results are removed."""
        for desk in [*self._desks.values()]:
            self._close(desk)
        for folder in self._empty.values():
            self._unlock(folder)
            removed(folder)

    def _close(self, desk: Desk) -> None:
        """Close a session on purpose: the next start does not offer it; a page that is loaded again finds it."""
        folder = desk.session.folder
        self._desks.pop(folder.name, None)
        desk.close()
        desk.session.keep(closed=True)
        if desk.session.entries:
            self._unlock(folder)
        else:
            self._empty[folder.name] = folder  # it stays locked: another server's start would remove it
