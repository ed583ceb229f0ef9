"""Whatever kills a process that writes, the old file or the new one stands there whole."""

from __future__ import annotations

import os

import numpy as np
import pytest

import killed
from selection import guarding

pytestmark = pytest.mark.skipif(os.name == "nt", reason="of POSIX")


NAMES = guarding(killed.KINDS, campaign=2)


@pytest.mark.parametrize("name", NAMES)
def test_killed_at_any_moment_it_leaves_whole_files_and_goes_on(tmp_path, name):
    kind, random = killed.KINDS[name](), np.random.default_rng(3)
    for sent in killed.SIGNALS:
        for after in random.uniform(0.0, 0.5, 4):
            taken, left = killed.killed(kind, tmp_path / "work", sent, after)
            if sent == "SIGINT":
                assert taken < 10.0 * killed.WAITED  # it ended by itself
                assert not left, (name, after)
