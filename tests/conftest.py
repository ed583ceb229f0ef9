"""Fixtures: the systems of `systems`, each defined once a run."""

from __future__ import annotations

import gc
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read where numpy is imported: threads of small products only wait

import hypothesis
import pytest

import systems
from saltus.system.hybrid import HybridSystem

collect_ignore = ["typing/user_script.py", "campaign"]  # type checkers read the first; `make campaign` runs the second

# compiling makes millions of objects that live on: to look through them as often as by default takes 6 % of the time
gc.set_threshold(50_000, 50, 50)

# the same examples in each run, however busy the machine
hypothesis.settings.register_profile("saltus", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("saltus")


@pytest.fixture(scope="session")
def afm1() -> HybridSystem:
    return systems.afm(1)


@pytest.fixture(scope="session")
def afm2() -> HybridSystem:
    return systems.afm(2)


@pytest.fixture(scope="session")
def ball() -> HybridSystem:
    return systems.ball()


@pytest.fixture(scope="session")
def ball_on_table() -> HybridSystem:
    return systems.ball_on_table()


@pytest.fixture(scope="session")
def impact_oscillator() -> HybridSystem:
    return systems.impact_oscillator()


@pytest.fixture(scope="session")
def two_fields() -> HybridSystem:
    return systems.two_fields()


@pytest.fixture(scope="session")
def stick_slip() -> HybridSystem:
    return systems.stick_slip()


@pytest.fixture(scope="session")
def relay() -> HybridSystem:
    return systems.relay()
