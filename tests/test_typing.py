"""Type checkers see true types of all that is public: right calls of a user's script pass, wrong ones are told."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

import saltus
from saltus import afm
from selection import guarding

SCRIPT = Path(__file__).parent / "typing" / "user_script.py"

DOORS = (saltus.options, saltus.results, afm)

PUBLIC = [f"{module.__name__}.{name}" for module in (saltus, *DOORS) for name in module.__all__]


def mypy(folder):
    options = ["--strict", "--no-error-summary", "--config-file=", f"--cache-dir={folder / 'cache'}"]
    return [sys.executable, "-m", "mypy", *options]


def pyrefly(folder):
    empty = folder / "pyrefly.toml"
    empty.write_text('preset = "strict"\n')
    options = [f"--config={empty}", f"--python-interpreter-path={sys.executable}", "--output-format=min-text"]
    return [str(Path(sys.executable).with_name("pyrefly")), "check", *options]


@pytest.fixture(scope="module", params=guarding([mypy, pyrefly], pyrefly))
def told(request, tmp_path_factory):
    """What a checker says of the user's script, by line, and of all public names."""
    folder = tmp_path_factory.mktemp("checked")
    names = folder / "all_names.py"
    names.write_text("import saltus\n" + "".join(f"reveal_type({name})\n" for name in PUBLIC), encoding="utf-8")
    done = subprocess.run([*request.param(folder), str(SCRIPT), str(names)], capture_output=True, text=True, cwd=folder)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found = {SCRIPT.name: {}, names.name: {}}
    for line in done.stdout.splitlines():
        if match := re.search(r"(\w+\.py):(\d+)", line):
            found[match[1]][int(match[2])] = line
    return found


def test_right_calls_pass_and_wrong_ones_are_told(told):
    lines = SCRIPT.read_text(encoding="utf-8").splitlines()
    wrong = {i for i, line in enumerate(lines, 1) if line.endswith("# wrong")}
    assert told[SCRIPT.name].keys() == wrong, "\n".join(told[SCRIPT.name].values())


def test_no_public_name_has_an_unknown_type(told):
    found = told["all_names.py"]
    assert len(found) == len(PUBLIC)
    for i, name in enumerate(PUBLIC, 2):
        assert not re.search(r"revealed type(?: is)?:? [\"'`]?(Any|Unknown)\b", found[i], re.IGNORECASE), name
