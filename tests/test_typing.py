"""Type checkers see true types of all that is public: right calls of a user's script pass, wrong ones are told."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import saltus
from saltus import afm

SCRIPT = Path(__file__).parent / "typing" / "user_script.py"

PUBLIC = [f"saltus.{name}" for name in saltus.__all__ if name != "afm"] + [f"saltus.afm.{name}" for name in afm.__all__]


def mypy(file, folder):
    options = ["--strict", "--no-error-summary", "--config-file=", f"--cache-dir={folder / 'cache'}"]
    return [sys.executable, "-m", "mypy", *options, str(file)]


def pyrefly(file, folder):
    empty = folder / "pyrefly.toml"
    empty.write_text('preset = "strict"\n')
    options = [f"--config={empty}", f"--python-interpreter-path={sys.executable}", "--output-format=min-text"]
    return [str(Path(sys.executable).with_name("pyrefly")), "check", *options, str(file)]


def told(checker, file, folder):
    """What a checker says, by line."""
    done = subprocess.run(checker(file, folder), capture_output=True, text=True, cwd=folder)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = {}
    for line in done.stdout.splitlines():
        if match := re.search(rf"{re.escape(file.name)}:(\d+)", line):
            found[int(match[1])] = line
    return found


@pytest.mark.parametrize("checker", [mypy, pyrefly])
def test_right_calls_pass_and_wrong_ones_are_told(checker, tmp_path):
    lines = SCRIPT.read_text(encoding="utf-8").splitlines()
    wrong = {i for i, line in enumerate(lines, 1) if line.endswith("# wrong")}
    found = told(checker, SCRIPT, tmp_path)
    assert found.keys() == wrong, "\n".join(found.values())


@pytest.mark.parametrize("checker", [mypy, pyrefly])
def test_no_public_name_has_an_unknown_type(checker, tmp_path):
    file = tmp_path / "all_names.py"
    file.write_text("import saltus\n" + "".join(f"reveal_type({name})\n" for name in PUBLIC), encoding="utf-8")
    found = told(checker, file, tmp_path)
    assert len(found) == len(PUBLIC)
    for i, name in enumerate(PUBLIC, 2):
        assert not re.search(r"revealed type(?: is)?:? [\"'`]?(Any|Unknown)\b", found[i], re.IGNORECASE), name
