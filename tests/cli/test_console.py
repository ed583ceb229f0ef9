"""The command: what it prints, where, and with which exit code."""

from __future__ import annotations

import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from commands import HEAVY, run_command
from saltus.errors import ConvergenceError

FIGURES = ["fig2", "fig3", "fig4", "fig5", "fig6", "fig7", "fig7a", "fig8", "fig9", "fig10"]
POINT = {"type": "SN", "omega": 0.916055296824, "min_z": 0.0116, "signature": [["flight", "theta"]], "admissible": True}


@pytest.fixture
def figure(monkeypatch):
    """A figure that is computed at once; its `act` can be replaced."""
    import saltus.afm.paper.figures as figures

    class Branch:
        def __repr__(self):
            return "Branch of 57 orbits\n  began: somewhere"

    state = SimpleNamespace(said=[], calls=0, interrupted=False, act=lambda: None, content={"special_points": [POINT]})

    def run(out: Path, progress=None):
        state.calls += 1
        state.progress = progress
        state.act()
        (out / "fig3.nc").write_text("data")
        found = {"files": [out / "fig3.nc"], "results": {"": Branch()}, "content": state.content}
        return found | {"interrupted": state.interrupted}

    monkeypatch.setattr(figures, "runner", lambda name: run)
    return state


def test_help_names_the_commands(capsys):
    code, out, _ = run_command(capsys, "--help")
    assert code == 0
    assert "reproduce" in out
    assert "animate" in out
    assert "plot" in out
    assert "--version" in out


def test_no_arguments_print_the_help_and_are_a_usage_error(capsys):
    code, out, err = run_command(capsys)
    assert code == 2
    assert "Usage: saltus" in out + err


def test_version_is_the_package_s(capsys):
    assert run_command(capsys, "--version") == (0, f"saltus {importlib.metadata.version('saltus')}\n", "")


def test_list_tells_each_figure_in_a_line(capsys):
    code, out, err = run_command(capsys, "reproduce", "list")
    assert (code, err) == (0, "")
    assert [line.split("  ")[0] for line in out.splitlines()] == FIGURES
    assert all(line.split("  ", 1)[1] for line in out.splitlines())


def test_an_unknown_figure_is_answered_with_the_nearest_name(capsys):
    wanted = f"saltus: figure = 'fgi3': must be one of {', '.join(FIGURES)}; did you mean 'fig3'?\n"
    assert run_command(capsys, "reproduce", "fgi3") == (2, "", wanted)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("reprduce",), "No such command 'reprduce'"),
        (("reproduce", "fig3", "--oot", "x"), "No such option"),
        (("reproduce", "fig3", "-o"), "requires an argument"),
        (("reproduce", "fig3", "fig4"), "unexpected extra argument"),
    ],
)
def test_usage_errors_leave_with_2(capsys, args, message):
    code, out, err = run_command(capsys, *args)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err


def test_files_and_special_points_are_printed(capsys, tmp_path, figure):
    code, out, err = run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path / "new" / "folder"))
    assert (code, err) == (0, "")
    assert out.startswith(f"folder   {tmp_path / 'new' / 'folder'}\n")
    assert f"written  {tmp_path / 'new' / 'folder' / 'fig3.nc'}\n" in out
    row = next(line for line in out.splitlines() if "SN" in line)
    assert row.split() == ["SN", "0.9160552968", "0.011600000", "flight:theta", "yes"]
    assert max(map(len, out.splitlines()[1:-1])) <= 80


def test_a_figure_without_special_points_prints_its_numbers(capsys, tmp_path, figure):
    onset = {"ybar": 0.12513993027532, "omega": 0.911114298981}
    figure.content = {"figure": "fig4", "parameters": {"eta": 6e-8}, "pd_onset": onset, "turns": 3, "other": None}
    code, out, err = run_command(capsys, "reproduce", "fig4", "-o", str(tmp_path))
    assert (code, err) == (0, "")
    rows = [line.split(maxsplit=1) for line in out.splitlines()]
    assert ["pd_onset", "ybar = 0.1251399303, omega = 0.911114299"] in [[c.strip() for c in row] for row in rows]
    assert ["turns", "3"] in [[c.strip() for c in row] for row in rows]
    assert "eta" not in out
    assert "other" not in out


def test_a_figure_without_numbers_prints_its_files_alone(capsys, tmp_path, figure):
    figure.content = {"figure": "fig4", "pd_onset": None}
    wanted = f"written  {tmp_path / 'fig3.nc'}\n"
    assert run_command(capsys, "reproduce", "fig4", "-o", str(tmp_path)) == (0, wanted, "")


def test_progress_is_silent_where_stdout_is_no_terminal(capsys, tmp_path, figure):
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path))[0] == 0
    assert figure.progress is False


def test_progress_is_shown_on_a_terminal(capsys, tmp_path, figure, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path))[0] == 0
    assert callable(figure.progress)


def test_an_output_folder_below_a_file_is_told_before_the_work(capsys, tmp_path, figure):
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "folder"
    wanted = f"saltus: --out = {str(out)!r}: must be a folder; {tmp_path / 'file'} is a file\n"
    assert run_command(capsys, "reproduce", "fig3", "-o", str(out)) == (2, "", wanted)
    assert figure.calls == 0


def test_an_output_folder_that_is_a_file_is_told_before_the_work(capsys, tmp_path, figure):
    path = tmp_path / "file"
    path.write_text("")
    wanted = f"saltus: --out = {str(path)!r}: must be a folder; {path} is a file\n"
    assert run_command(capsys, "reproduce", "fig3", "-o", str(path)) == (2, "", wanted)
    assert figure.calls == 0


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_an_output_folder_that_nobody_can_make_is_told_before_the_work(capsys, figure):
    code, out, err = run_command(capsys, "reproduce", "fig3", "-o", "/proc/x")
    assert (code, out) == (2, "")
    assert err.startswith("saltus: --out = '/proc/x': must be a folder that can be written; ")
    assert len(err.splitlines()) == 1
    assert figure.calls == 0


def test_a_read_only_output_folder_is_told_before_the_work(capsys, tmp_path, figure, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere
    wanted = (
        f"saltus: --out = {str(tmp_path / 'new')!r}: must be a folder that can be written; "
        f"{tmp_path} is read-only for this user\n"
    )
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path / "new")) == (2, "", wanted)
    assert not (tmp_path / "new").exists()
    assert figure.calls == 0


def test_an_error_of_the_library_is_a_line_on_stderr(capsys, tmp_path, figure):
    def fail():
        raise ConvergenceError("periodic orbit", 0.5, 40, "start from a nearer guess")

    figure.act = fail
    wanted = "saltus: periodic orbit: no convergence, residual 0.5 after 40 iterations; start from a nearer guess\n"
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path)) == (2, "", wanted)


def test_a_full_disk_is_a_line_on_stderr(capsys, tmp_path, figure):
    def fail():
        raise OSError(28, "No space left on device", "fig3.png")

    figure.act = fail
    wanted = "saltus: fig3.png: No space left on device\n"
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path)) == (2, "", wanted)


def test_an_interrupted_run_says_what_it_kept_and_where(capsys, tmp_path, figure):
    figure.interrupted = True
    code, out, err = run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path))
    assert code == 130
    assert err == "saltus: interrupted; kept\n  Branch of 57 orbits\n"
    assert f"kept  {tmp_path / 'fig3.nc'}\n" in out


def test_an_interrupt_before_anything_was_computed_is_told(capsys, tmp_path, figure):
    def stop():
        raise KeyboardInterrupt

    figure.act = stop
    wanted = "saltus: interrupted before there was anything to keep\n"
    assert run_command(capsys, "reproduce", "fig3", "-o", str(tmp_path)) == (130, "", wanted)


@pytest.fixture
def film(monkeypatch):
    """A film that is written at once; its `act` can be replaced."""
    from saltus import afm

    state = SimpleNamespace(act=lambda: None)

    def settled_orbit(system, parameters, regime):
        state.system, state.parameters, state.regime = system, parameters, regime
        return "PeriodicOrbit of tapping"

    def animate(orbit, path, **options):
        state.act()
        state.options = options
        path.write_bytes(b"GIF89a" * 1000)
        return path

    monkeypatch.setattr(afm, "settled_orbit", settled_orbit)
    monkeypatch.setattr(afm, "animate", animate)
    return state


def test_a_film_is_of_what_the_options_say(capsys, tmp_path, film):
    path = tmp_path / "tap.gif"
    chosen = ["--omega", "1.15", "--modes", "3", "--ybar", "0.1", "--d-att", "0.02", "--d-rep", "5"]
    code, out, err = run_command(
        capsys,
        "animate",
        "-o",
        str(path),
        *chosen,
        "--orbit",
        "attractive",
        "--fps",
        "20",
        "--seconds",
        "3",
        "--width",
        "640",
    )
    assert (code, err) == (0, "")
    assert out == f"'PeriodicOrbit of tapping'\nwritten  {path}  (0.01 MB)\n"
    assert len(film.system.states) == 6
    assert film.parameters == {"Omega": 1.15, "ybar": 0.1, "D_att": 0.02, "D_rep": 5.0}
    assert film.regime == "attractive"
    assert {name: film.options[name] for name in ("fps", "seconds", "width", "progress")} == {
        "fps": 20,
        "seconds": 3.0,
        "width": 640,
        "progress": False,
    }


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (("-o", "tap.png"), "path = 'tap.png': must be a file whose name ends in .gif or .mp4"),
        (("-o", "/nowhere/tap.gif"), "path = '/nowhere/tap.gif': must be a file in a folder that exists"),
        (("--fps", "30"), "fps = 30: must be one of 1, 2, 4, 5, 10, 20, 25, 50 for a GIF"),
        (("--modes", "0"), "modes = 0: must be an integer between 1 and 100"),
    ],
)
def test_a_film_that_cannot_be_is_told_in_a_line(capsys, film, args, message):
    assert run_command(capsys, "animate", *args) == (2, "", f"saltus: {message}\n")


def test_a_film_s_parameters_are_checked_by_the_model(capsys, tmp_path):
    path = tmp_path / "tap.gif"
    assert run_command(capsys, "animate", "-o", str(path), "--omega", "-1") == (
        2,
        "",
        "saltus: Omega = -1.0: must be > 0\n",
    )
    wanted = "saltus: orbit = 'attractve': must be one of repulsive, attractive; did you mean 'attractive'?\n"
    assert run_command(capsys, "animate", "-o", str(path), "--orbit", "attractve") == (2, "", wanted)
    assert not path.exists()


def test_an_interrupted_film_is_told(capsys, tmp_path, film):
    def stop():
        raise KeyboardInterrupt

    film.act = stop
    wanted = "saltus: interrupted before there was anything to keep\n"
    assert run_command(capsys, "animate", "-o", str(tmp_path / "tap.gif")) == (130, "", wanted)


LIGHT = [
    ["--help"],
    ["reproduce", "list"],
    ["reproduce", "fgi3"],
    ["reproduce", "--help"],
    ["animate", "--help"],
]


@pytest.mark.parametrize("args", LIGHT)
def test_a_command_that_computes_nothing_imports_nothing_heavy(args):
    code = (
        "import sys, saltus.cli\n"
        f"try: saltus.cli.main({args!r})\n"
        "except SystemExit: pass\n"
        f"sys.exit(', '.join(name for name in {HEAVY!r} if name in sys.modules) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_importing_saltus_imports_at_most_numpy():
    allowed = tuple(name for name in HEAVY if name != "numpy")
    code = f"import sys, saltus; sys.exit(', '.join(name for name in {allowed!r} if name in sys.modules) or 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_module_is_the_command():
    done = subprocess.run([sys.executable, "-m", "saltus", "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: saltus ")


@pytest.mark.parametrize(
    ("args", "told"),
    [
        (("animate", "--modes", "x"), "Invalid value for '--modes'"),
        (("explore", "--prot", "3"), "No such option: --prot"),
        (("explore", "--port", "99999999"), "Invalid value for '--port'"),
        (("explroe",), "No such command 'explroe'"),
    ],
)
def test_an_error_of_arguments_is_one_line_as_all_others(capsys, args, told):
    code, out, err = run_command(capsys, *args)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"saltus: {told}")
    assert "--help tells what is allowed" in err


@pytest.mark.parametrize(
    ("shell", "surroundings"),
    [
        ("bash", {"COMP_WORDS": "saltus explore lever-p-n", "COMP_CWORD": "2"}),
        ("zsh", {"_TYPER_COMPLETE_ARGS": "saltus explore lever-p-n"}),
        ("fish", {"_TYPER_COMPLETE_ARGS": "saltus explore lever-p-n", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}),
    ],
)
def test_shells_complete_commands_and_models(capsys, monkeypatch, shell, surroundings):
    monkeypatch.setenv("_SALTUS_COMPLETE", f"complete_{shell}")
    for name, value in surroundings.items():
        monkeypatch.setenv(name, value)
    code, out, _ = run_command(capsys)
    assert code == 0
    assert "lever-p-neck" in out
    assert "lever-s" not in out
