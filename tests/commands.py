"""The command line in this process, and the packages that a start should not need."""

from __future__ import annotations

import pytest

from saltus import cli

HEAVY = ("sympy", "numba", "xarray", "matplotlib", "scipy", "pandas", "numpy", "h5py", "pint", "rich")


def run_command(capsys: pytest.CaptureFixture[str], *args: str) -> tuple[int, str, str]:
    """Return the exit code of a command, and what it printed on both ways."""
    with pytest.raises(SystemExit) as left:
        cli.main(list(args))
    printed = capsys.readouterr()
    return int(left.value.code or 0), printed.out, printed.err
