"""The folder of generated code, whose files are used only if they are whole.

Such files are run, so that the folder must be one that only the user can write. Each carries the digest of its content:
what was cut short, damaged or replaced by something else is written anew. A file is written beside its place and then
renamed, so that several processes may write the same one at a time.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import stat
import tempfile
import warnings
from functools import cache
from pathlib import Path

from saltus.errors import InputError

__all__ = [
    "cache_folder",
    "is_writable_by_others",
    "let_numba_cache",
    "read_checked",
    "warn_not_kept",
    "warn_once",
    "write_checked",
]

_ALLOWED = "a folder that can be made and written, and that nobody else can write"
_MARK = b"# sha256 "
_HEAD = len(_MARK) + 64 + 1  # bytes of the first line, which holds the digest of all behind it


def cache_folder() -> Path:
    """Return the folder of generated files, made if need be.

    It is the one that SALTUS_CACHE_DIR names, else the user's; a private temporary one, with a warning, where that
    cannot be written, can be written by others, or is not an absolute path.

    Raises
    ------
    InputError
        SALTUS_CACHE_DIR names a folder that cannot be made or written, or that others can write; no folder at all can
        be written.
    """
    chosen = os.environ.get("SALTUS_CACHE_DIR")
    if chosen:
        folder = Path(chosen).absolute()
        if reason := _obstacle(folder):
            raise InputError("SALTUS_CACHE_DIR", chosen, _ALLOWED, reason)
        return folder
    usual = _usual_folder()
    if usual is not None and not (reason := _obstacle(usual)):
        return usual
    folder = _temporary_folder()
    if usual is None:
        reason = "there is no absolute path to a home folder"
    warn_once(f"generated code is kept in {folder}: {reason}; SALTUS_CACHE_DIR can name another folder")
    return folder


def let_numba_cache() -> None:
    """Give Numba a folder for compiled code where neither this package's nor the user's can be written.

    Numba reads the setting when it is first imported: call this before.
    """
    if "NUMBA_CACHE_DIR" in os.environ or os.access(Path(__file__).parent, os.W_OK):
        return
    home = Path(os.path.expanduser("~"))
    usual = home / ".cache" if (home / ".cache").exists() else home
    if not home.is_absolute() or not os.access(usual, os.W_OK):
        os.environ["NUMBA_CACHE_DIR"] = str(cache_folder() / "numba")


def read_checked(file: Path) -> bytes | None:
    """Return what `write_checked` wrote; None where it is not there, not whole, or no file."""
    try:
        # a pipe in its place would wait for a writer
        handle = os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with open(handle, "rb") as stream:
            if not stat.S_ISREG(os.fstat(handle).st_mode):
                return None
            content = stream.read()
    except OSError:
        return None
    data = content[_HEAD:]
    return data if content[:_HEAD] == _head(data) else None


def write_checked(file: Path, data: bytes) -> None:
    """Write data with the digest before them, in one step for whoever reads.

    Raises
    ------
    OSError
        The file cannot be written. A file that was there before is unchanged, and nothing is left beside it.
    """
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f"{file.stem[:40]}.", suffix=".tmp")
    try:
        with open(handle, "wb") as stream:
            stream.write(_head(data))
            stream.write(data)
        os.chmod(name, 0o644)  # others may run what is installed for all
        if file.is_dir() and not file.is_symlink():
            shutil.rmtree(file, ignore_errors=True)  # all in this folder is safe to delete
        os.replace(name, file)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(name)
        raise


def is_writable_by_others(folder: Path) -> bool:
    """Whether somebody else owns a folder or can write in it; False where users have no numbers."""
    if not hasattr(os, "geteuid"):
        return False
    found = folder.stat()
    return found.st_uid != os.geteuid() or bool(found.st_mode & (stat.S_IWGRP | stat.S_IWOTH))


@cache
def warn_once(text: str) -> None:
    """Warn, the first time in this process that a text is given."""
    warnings.warn(f"saltus: {text}", RuntimeWarning, stacklevel=2)


_unkept: list[Path] = []  # the folder of which this process was told that it takes no code


def warn_not_kept(folder: Path, reason: str) -> None:
    """Warn, the first time in this process, that a folder takes no code, which lives in memory only then."""
    if not _unkept:
        _unkept.append(folder)
        cure = "SALTUS_CACHE_DIR and NUMBA_CACHE_DIR can name other folders"
        told = f"saltus: code is not kept in {folder}: {reason}; each process makes it anew; {cure}"
        warnings.warn(told, RuntimeWarning, stacklevel=2)


def _head(data: bytes) -> bytes:
    return _MARK + hashlib.sha256(data).hexdigest().encode() + b"\n"


def _usual_folder() -> Path | None:
    import platformdirs

    try:
        folder = Path(platformdirs.user_cache_dir("saltus", appauthor=False))
    except (RuntimeError, KeyError, OSError):  # no home
        return None
    return folder if folder.is_absolute() else None


def _obstacle(folder: Path) -> str:
    """Make a folder if need be, and tell why it cannot be used; nothing where it can."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        if not os.access(folder, os.W_OK | os.X_OK):
            return f"{folder} cannot be written"
        if is_writable_by_others(folder):
            return f"others own or can write {folder} (chmod go-w makes a folder of yours private)"
    except OSError as error:
        return str(error)
    return ""


@cache
def _temporary_folder() -> Path:
    """A folder that nobody else can write, since what lies in it is run: the user's of before, or a fresh one."""
    try:
        parent = Path(tempfile.gettempdir()).absolute()
        if hasattr(os, "getuid"):
            folder = parent / f"saltus-{os.getuid()}"
            with contextlib.suppress(OSError):
                folder.mkdir(mode=0o700, exist_ok=True)
                found = folder.lstat()
                private = found.st_uid == os.getuid() and stat.S_IMODE(found.st_mode) == 0o700
                if stat.S_ISDIR(found.st_mode) and private and os.access(folder, os.W_OK):
                    return folder
        return Path(tempfile.mkdtemp(prefix="saltus-", dir=parent))
    except OSError as error:
        raise InputError("SALTUS_CACHE_DIR", None, _ALLOWED, f"no other folder can be written: {error}") from None
