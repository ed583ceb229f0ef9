"""Configurations in TOML: what is read, what is called with it, and what is told of errors in it."""

from __future__ import annotations

import sys

import pytest

from saltus.config_files import attribute_of, called, read_toml
from saltus.errors import InputError


def test_a_file_is_read_as_python_reads_it(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text('name = "ball"\n[parameters]\ne = 0.5\n', encoding="utf-8")
    assert read_toml(path) == {"name": "ball", "parameters": {"e": 0.5}}


@pytest.mark.parametrize("content", [b"name = ", b"\xff\xfe", b"a = 1\na = 2\n", b"[[" * 5])
def test_what_is_no_toml_is_told(tmp_path, content):
    path = tmp_path / "a.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"^config = .*a\.toml': must be a TOML file; "):
        read_toml(path)


def test_a_module_beside_the_file_is_found_and_the_path_is_as_before(tmp_path):
    (tmp_path / "of_a_user.py").write_text("class Probe:\n    stiffness = 40.0\n", encoding="utf-8")
    before = list(sys.path)
    assert attribute_of("of_a_user:Probe.stiffness", tmp_path, "system") == 40.0
    assert sys.path == before
    sys.modules.pop("of_a_user")


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("no_such_module:x", "system = 'no_such_module:x': must be a module that can be imported"),
        (":x", "system = ':x': must be a module that can be imported"),
        ("math:pie", "must be an attribute of math; did you mean 'pi'"),
    ],
)
def test_what_cannot_be_found_is_told(tmp_path, reference, message):
    with pytest.raises(InputError, match=message):
        attribute_of(reference, tmp_path, "system")


@pytest.mark.parametrize(
    ("text", "line", "told"),
    [
        ("a = {\n1: 2\n", 1, "SyntaxError: '{' was never closed"),
        ("a = 1\nb = c\n", 2, "NameError: name 'c' is not defined"),
        ("import no_such_module\n", 1, "ModuleNotFoundError: No module named 'no_such_module'"),
        ("\n\nraise SystemExit(3)\n", 3, "SystemExit: 3"),
        (
            "import saltus\ndef f():\n    return saltus.HybridSystem.smooth({'x': '-k*x'}, {'w': 1.0})\na = f()\n",
            3,
            "mode 'smooth' = '-k*x': must be in x, w and pi, but 'k' is unknown",
        ),
    ],
)
def test_a_mistake_in_a_file_of_a_user_is_told_with_its_line(tmp_path, monkeypatch, text, line, told):
    (tmp_path / "with_a_mistake.py").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as raised:
        attribute_of("with_a_mistake:a", tmp_path, "SYSTEM")
    assert str(raised.value).endswith(
        f"must be code that runs without an error; with_a_mistake.py, line {line}: {told}"
    )
    sys.modules.pop("with_a_mistake", None)


def made(k, *, d=0.1):
    return k, d


def test_entries_are_arguments():
    assert called(made, {"k": 1.0}, "oscillator") == (1.0, 0.1)
    assert called(lambda **entries: entries, {"any": 1}, "") == {"any": 1}


@pytest.mark.parametrize(
    ("entries", "table", "message"),
    [
        ({"k": 1.0, "D": 2.0}, "oscillator", r"key = 'D': must be one of k, d in \[oscillator\]"),
        ({"k": 1.0, "e": 2.0}, "", "key = 'e': must be one of k, d"),
        ({"d": 1.0}, "oscillator", r"oscillator\.k = None: must be given"),
        ({"d": 1.0}, "", "^k = None: must be given"),
    ],
)
def test_an_entry_too_many_or_too_few_is_told_by_its_name(entries, table, message):
    with pytest.raises(InputError, match=message):
        called(made, entries, table)
