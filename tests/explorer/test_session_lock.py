"""The lock of a session: one server has it, and a killed one leaves none behind."""

import signal
import subprocess
import sys

import pytest

from saltus.errors import InputError
from saltus.explorer.session_lock import SessionLock

HOLDER = """
import sys, time
from pathlib import Path
from saltus.explorer.session_lock import SessionLock
lock = SessionLock(Path(sys.argv[1]))
lock.take()
print("taken", flush=True)
time.sleep(600.0)
"""


@pytest.fixture
def holder(tmp_path):
    """Run another process that has the lock."""
    process = subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"taken\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_process_is_refused_and_told_who_has_it(tmp_path, holder):
    lock = SessionLock(tmp_path)
    assert not lock.is_free
    with pytest.raises(InputError, match=f"no other server has open; process {holder.pid} has it open: close its page"):
        lock.take()


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_killed_process_leaves_no_lock(tmp_path, holder):
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    lock = SessionLock(tmp_path)
    assert lock.is_free
    lock.take()
    assert not SessionLock(tmp_path).is_free
    lock.release()
    assert lock.is_free


def test_a_folder_that_is_gone_is_told(tmp_path):
    lock = SessionLock(tmp_path / "gone")
    assert not lock.is_free
    with pytest.raises(InputError, match="a folder that can be written"):
        lock.take()
