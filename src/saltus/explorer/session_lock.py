"""The lock of a session: while one server shows it, no other opens it; the system drops it with a killed process."""

from __future__ import annotations

import os
import sys
import weakref
from pathlib import Path

from saltus.errors import InputError

__all__ = ["SessionLock"]

_FILE = "session.lock"
_HOW = os.O_RDWR | os.O_CREAT | os.O_APPEND


class SessionLock:
    """The lock of a session's folder, from `take` to `release`.

    It is one of the operating system, which a process cannot leave behind: the file stays, the lock does not.

    Parameters
    ----------
    folder : Path
        The folder.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     lock = SessionLock(Path(folder))
    ...     lock.take()
    ...     other = SessionLock(Path(folder)).is_free
    ...     lock.release()
    >>> other
    False
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / _FILE
        self._closes: weakref.finalize[[int], SessionLock] | None = None

    def take(self) -> None:
        """Take the lock.

        Raises
        ------
        InputError
            Another server has it, or the folder cannot be written.
        """
        try:
            file = os.open(self._path, _HOW)
        except OSError as error:
            raise InputError("session", str(self._path.parent), "in a folder that can be written", str(error)) from None
        if not _locked(file):
            owner = os.read(file, 20).decode(errors="replace").strip()
            os.close(file)
            hint = f"process {owner} has it open: close its page there, or begin a new session" if owner else ""
            raise InputError("session", self._path.parent.name, "one that no other server has open", hint)
        os.ftruncate(file, 0)
        os.write(file, f"{os.getpid()}\n".encode())
        self._closes = weakref.finalize(self, os.close, file)

    @property
    def is_free(self) -> bool:
        """Whether nobody has the lock."""
        try:
            file = os.open(self._path, _HOW)
        except OSError:
            return False
        found = _locked(file)
        os.close(file)
        return found

    def release(self) -> None:
        """Give the lock back."""
        if self._closes is not None:
            self._closes()


def _locked(file: int) -> bool:
    """Return whether a file could be locked: until it is closed, at the latest when the process ends."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(file, 2**20, os.SEEK_SET)  # beyond what is read: there a lock forbids reading
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
            os.lseek(file, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
