"""The lock of a session: while one server shows it, no other opens it; the system drops it with a killed process."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO

from saltus.errors import InputError

__all__ = ["SessionLock"]

_FILE = "session.lock"


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
        self._file: IO[bytes] | None = None

    def take(self) -> None:
        """Take the lock.

        Raises
        ------
        InputError
            Another server has it, or the folder cannot be written.
        """
        try:
            file = self._path.open("a+b")
        except OSError as error:
            raise InputError("session", str(self._path.parent), "in a folder that can be written", str(error)) from None
        if not _locked(file):
            file.seek(0)
            owner = file.read(20).decode(errors="replace").strip()
            file.close()
            hint = f"process {owner} has it open: close its page there, or begin a new session" if owner else ""
            raise InputError("session", self._path.parent.name, "one that no other server has open", hint)
        file.truncate(0)
        file.write(f"{os.getpid()}\n".encode())
        file.flush()
        self._file = file

    @property
    def is_free(self) -> bool:
        """Whether nobody has the lock."""
        try:
            with self._path.open("a+b") as file:
                return _locked(file)
        except OSError:
            return False

    def release(self) -> None:
        """Give the lock back."""
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):
                file.truncate(0)
            file.close()


def _locked(file: IO[bytes]) -> bool:
    """Return whether a file could be locked: until it is closed, at the latest when the process ends."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(2**20)  # beyond what is read: there a lock forbids reading
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
