"""The version of this package, which is written here and nowhere else, and what to say of files of other versions."""

import re
import warnings
from typing import Any

__all__ = ["__version__", "tell_newer", "written_by"]

__version__ = "0.2.0"

_TOLD = 200  # characters of another version that a message shows


def written_by(writer: Any) -> list[str]:
    """Return what to say of a file that another version wrote; nothing of one that this version wrote."""
    if not isinstance(writer, str) or writer == __version__:
        return []
    newer = "the newer version " if _newer(writer) else ""
    return [f"{newer}saltus {writer[:_TOLD]} wrote it, this is {__version__}: load it with that version"]


def tell_newer(writer: Any, path: object) -> None:
    """Warn where a file that could be read is of a version after this one."""
    if _newer(writer):
        told = f"{path}: the newer version saltus {writer[:_TOLD]} wrote it, this is {__version__}"
        warnings.warn(f"saltus: {told}: what that version added is not read", RuntimeWarning, stacklevel=4)


def _newer(writer: Any) -> bool:
    if not isinstance(writer, str):
        return False
    theirs, mine = ([int(part) for part in re.findall(r"\d+", one[:_TOLD])[:3]] for one in (writer, __version__))
    return theirs > mine
