"""Files that are written whole or not at all: beside their place, flushed to the disk, then renamed.

Every file of the package is written by `whole_file`. Whatever ends the writing (an error, an interrupt, a full disk),
what stood there before is left as it was and nothing is left beside it; a process that is killed may leave a hidden
file whose name ends in ``.part`` and the file's suffix.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

from saltus.errors import InputError

__all__ = ["checked_seal", "flush", "is_sealed", "sealed", "telling", "whole_file", "write_sealed"]

_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}  # errors of a full disk
_NAME = 60  # characters of a file's name that the name of its draft repeats: names have at most 255 bytes
_PIECE = 2**24  # bytes that are written or read at once; an interrupt waits until the piece is done

_SEAL = b"\nsaltus sha256 "  # words before the digest
_SEALED = len(_SEAL) + 64  # bytes of a seal: these words and a digest in hexadecimal


@contextmanager
def whole_file(path: Path, name: str = "path") -> Iterator[Path]:
    """Give a place beside a file for its new content, which takes the file's place when the block ends.

    Parameters
    ----------
    path : Path
        The file; where it is a link, what it leads to is replaced.
    name : str, optional
        Name of the argument in messages.

    Yields
    ------
    Path
        Path of the new content, in the same folder and with the same suffix; no file is there yet.

    Raises
    ------
    InputError
        The file cannot be written: there is no such folder, no permission, no room on the disk, or no regular file in
        its place.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with whole_file(Path(folder) / "a.txt") as draft:
    ...         _ = draft.write_text("new")
    ...     [file.name for file in Path(folder).iterdir()]
    ['a.txt']
    """
    target = _replaceable(path, name)
    draft = target.with_name(f".{target.stem[:_NAME]}.{uuid4().hex[:12]}.part{target.suffix[:_NAME]}")
    try:
        with telling(path, name):
            yield draft
            if target.exists():
                shutil.copymode(target, draft)
            flush(draft)
            os.replace(draft, target)
            flush(target.parent)
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _replaceable(path: Path, name: str) -> Path:
    """Return the place of a file, links followed; raise `InputError` where it cannot be replaced."""
    with telling(path, name):
        target = Path(os.path.realpath(path))
        if not target.parent.is_dir():
            raise InputError(name, str(path), "in a folder that exists")
        if target.is_dir():
            raise InputError(name, str(path), "a file", "it is a folder")
        if target.exists() and not target.is_file():
            raise InputError(name, str(path), "a regular file", "it is a device or a pipe")
        if target.exists() and not os.access(target, os.W_OK):
            raise InputError(name, str(path), "a file that can be written", os.strerror(errno.EACCES))
    return target


def flush(path: Path) -> None:
    """Wait until a file, or the names in a folder, stand on the disk."""
    if path.is_dir() and os.name == "nt":  # where folders cannot be opened
        return
    handle = os.open(path, os.O_RDONLY if os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # a file system that has no such thing
            raise
    finally:
        os.close(handle)


@contextmanager
def telling(path: Path, name: str = "path", hint: str = "", place: str = "a file") -> Iterator[None]:
    """Turn what the file system refuses into an `InputError` of one line.

    Parameters
    ----------
    path : Path
        What is written.
    name : str, optional
        Name of the argument in messages.
    hint : str, optional
        What to do where the disk is full.
    place : str, optional
        The place in words.
    """
    try:
        yield
    except OSError as error:
        why = error.strerror or str(error)
        if error.errno in _FULL:
            told = f"{why}; {hint}" if hint else why
            raise InputError(name, str(path), "on a disk with room for it", told) from error
        if isinstance(error, FileNotFoundError | NotADirectoryError) and not path.absolute().parent.is_dir():
            raise InputError(name, str(path), "in a folder that exists", why) from error
        raise InputError(name, str(path), f"{place} that can be written", why) from error


def write_sealed(path: Path, content: memoryview, name: str = "path") -> None:
    """Write a file with a digest of its content behind it, by which `checked_seal` knows it for whole.

    HDF5, and so NetCDF, ignores what stands behind its own end.
    """
    digest = sha256()
    with whole_file(path, name) as draft, draft.open("wb", buffering=0) as stream:
        for start in range(0, len(content), _PIECE):
            piece = content[start : start + _PIECE]
            digest.update(piece)
            _write(stream, piece)
        _write(stream, memoryview(_SEAL + digest.hexdigest().encode()))


def _write(stream: Any, content: memoryview) -> None:
    while content:
        content = content[stream.write(content) :]


def sealed(content: memoryview) -> bytes:
    """Return content with a digest of it behind, as `write_sealed` writes it."""
    return bytes(content) + _SEAL + sha256(content).hexdigest().encode()


def checked_seal(path: Path) -> bool:
    """Return whether a file has a seal, as one has not that another program has written since.

    Raises
    ------
    InputError
        The file cannot be read, or its content is not the one that was sealed.
    """
    try:
        with path.open("rb") as stream:
            return is_sealed(stream, "path", str(path))
    except OSError as error:
        raise InputError("path", str(path), "a file that can be read", error.strerror or str(error)) from error


def is_sealed(stream: Any, name: str, value: str) -> bool:
    """Return whether what a binary stream holds has a seal.

    Parameters
    ----------
    stream : binary stream
        The stream; `seek` must work.
    name, value : str
        Name and value of the content in messages.

    Raises
    ------
    InputError
        The content is not the one that was sealed.
    """
    digest = sha256()
    left = max(stream.seek(0, os.SEEK_END) - _SEALED, 0)
    stream.seek(left)
    seal = stream.read(_SEALED)
    if not seal.startswith(_SEAL):
        return False
    stream.seek(0)
    while left > 0 and (piece := stream.read(min(_PIECE, left))):
        digest.update(piece)
        left -= len(piece)
    if seal.removeprefix(_SEAL) != digest.hexdigest().encode():
        raise InputError(name, value, "a whole file", "it is damaged: its content is not what was written")
    return True
