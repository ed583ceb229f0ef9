"""A backend of matplotlib that cannot be used is told in a line."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from saltus.plotting import style
from selection import guarding

CODE = """
import sys
from saltus.errors import InputError
from saltus.plotting.style import new_figure
try:
    new_figure()
except InputError as error:
    print(error)
"""


@pytest.mark.parametrize("named", guarding(["nonsense", "module://nonsense"], "nonsense"))
def test_a_backend_that_is_none_is_told(named):
    paths = os.pathsep.join(sys.path)
    environment = {**os.environ, "MPLBACKEND": named, "PYTHONPATH": paths}
    done = subprocess.run([sys.executable, "-c", CODE], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"MPLBACKEND = {named!r}: must be ")
    assert len(done.stdout.splitlines()) == 1


def test_a_figure_is_made_where_a_backend_can_be_used():
    assert style.new_figure(figsize=(2.0, 1.0)).get_size_inches().tolist() == [2.0, 1.0]
