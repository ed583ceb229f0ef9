"""What is said where the system allows no further thread or process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from saltus.errors import SaltusError

__all__ = ["starting"]

_REFUSED = "can't start new thread"  # what Python says


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
