"""`explore`: what it opens, and what it refuses before a server starts."""

from __future__ import annotations

import subprocess
import sys

import pytest

import saltus
from saltus.errors import InputError
from saltus.explorer import opening


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"system": "pendulum"}, "system = 'str': must be a HybridSystem or a Map"),
        ({"load": 3}, "load = 3: must be the path of a file"),
    ],
)
def test_what_cannot_be_explored_is_told(options, message):
    with pytest.raises(InputError, match=message):
        saltus.explore(**options)


def test_from_a_script_the_page_is_served_and_its_address_printed(monkeypatch, capsys):
    asked = {}

    def serve(*arguments, told, **options):
        asked.update(options)
        told("http://127.0.0.1:8710")

    monkeypatch.setattr("saltus.exploring.in_notebook", lambda: False)
    monkeypatch.setattr(opening, "open_explorer", serve)
    assert saltus.explore(port=8710, browser=False) is None
    assert asked == {"port": 8710, "browser": False}
    assert capsys.readouterr().out == "saltus explorer at http://127.0.0.1:8710\n"


def test_from_a_notebook_a_frame_is_returned(monkeypatch):
    monkeypatch.setattr("saltus.exploring.in_notebook", lambda: True)
    monkeypatch.setattr(opening, "frame_in_notebook", lambda *arguments: arguments[-1])
    assert saltus.explore(port=7) == 7


@pytest.mark.parametrize("missing", ["pydantic", "matplotlib", "panel"])
def test_a_package_that_is_missing_is_told_with_its_extra(missing):
    code = f"import sys; sys.modules[{missing!r}] = None; import saltus; saltus.explore(browser=False)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert f"SaltusError: the explorer needs {missing}: pip install 'saltus[app]'" in done.stderr
