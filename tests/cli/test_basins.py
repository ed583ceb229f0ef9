"""`saltus basins`: a configuration mapped into a store, what is in one, what it will cost, and every refusal."""

from __future__ import annotations

import io
import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import saltus.basins.map.grid
from commands import run_command
from saltus import cli
from saltus.basins import Basins
from saltus.cli import console
from saltus.errors import InputError
from saltus.progress import Progress
from wells import Interrupt

WELLS = """
system = "wells:double_well"
[parameters]
A = 0.05
[grid]
x = [-2.0, 2.0, 12]
v = [-2.0, 2.0, 10]
[attractors.options]
starts = 16
samples = 200
"""


@pytest.fixture
def config(tmp_path) -> Path:
    path = tmp_path / "wells.toml"
    path.write_text(WELLS)
    return path


@pytest.fixture(scope="module")
def mapped(tmp_path_factory) -> tuple[Path, Path]:
    """A configuration and the store that it was mapped into."""
    folder = tmp_path_factory.mktemp("wells")
    config, store = folder / "wells.toml", folder / "wells.zarr"
    config.write_text(WELLS)
    with pytest.raises(SystemExit) as left:
        cli.main(["basins", str(config), "-o", str(store)])
    assert not left.value.code
    return config, store


def _rows(out: str) -> dict[str, str]:
    """The table's values by what they are of; a value that goes on in the next line is joined."""
    rows: dict[str, str] = {}
    last = ""
    for line in out.splitlines():
        name, _, value = line.strip().partition("  ")
        if last and line.startswith("     ") and line.strip():
            rows[last] += " " + line.strip()
        elif value:
            last = name
            rows[last] = value.strip()
    return rows


@pytest.mark.campaign
def test_a_configuration_is_mapped_into_a_store(mapped, capsys):
    store = Basins.open(mapped[1])
    assert store.grid.ranges == ((-2.0, 2.0, 12), (-2.0, 2.0, 10))
    assert store.stopped == "all 120 cells done"
    assert set(np.unique(store.labels)) == {0, 1}


@pytest.mark.campaign
def test_the_store_told_has_grid_attractors_parts_and_inputs(mapped, capsys):
    code, out, err = run_command(capsys, "basins", "info", str(mapped[1]))
    assert (code, err) == (0, "")
    rows = _rows(out)
    assert rows["system"] == "double well"
    assert (rows["x"], rows["v"]) == ("-2 to 2, 12 cells", "-2 to 2, 10 cells")
    share = 100.0 * float((np.asarray(Basins.open(mapped[1]).labels) == 0).mean())
    assert rows["period-1 A"] == f"{share:.4f} % of the cells, period-1, label 0"
    assert rows["done"] == "all 120 cells done"
    assert rows["trap of period-1 A"].startswith("ellipsoid of the discrete Lyapunov equation")
    assert (rows["engine"], rows["tolerance"], rows["A"]) == ("cpu", "3e-09", "0.05")
    assert rows["speed"].endswith(" orbits/s")
    told = "0 of 120 when followed again at tolerance 1e-12: < 0.025 at 95 %; 0 of 50 followed one by one"
    assert rows["wrong labels"] == told


def test_what_is_written_is_told_with_its_size(mapped, capsys):
    code, out, _ = run_command(capsys, "basins", str(mapped[0]), "-o", str(mapped[1]), "--resume")
    assert code == 0
    assert out.splitlines()[-1].startswith(f"written  {mapped[1]}  (")
    assert "all 120 cells done" in out


@pytest.mark.campaign
def test_an_interrupted_run_says_how_to_go_on_and_goes_on_to_the_same_labels(mapped, config, capsys, monkeypatch):
    monkeypatch.setattr(saltus.basins.map.grid, "_LEAST", 30)
    monkeypatch.setattr(saltus.basins.map.grid, "_CHUNK", 15)

    @contextmanager
    def interrupting(first):
        yield Interrupt(2)

    store = config.with_name("part.zarr")
    with monkeypatch.context() as patch:
        patch.setattr(cli.basins, "bar", interrupting)
        code, out, err = run_command(capsys, "basins", str(config), "-o", str(store))
    assert code == 130
    assert f"kept  {store}" in out
    assert err == "saltus: interrupted: 60 of 120 cells done; the same command with --resume goes on\n"
    assert run_command(capsys, "basins", str(config), "-o", str(store), "--resume")[0] == 0
    assert np.array_equal(Basins.open(store).labels, Basins.open(mapped[1]).labels)


def test_an_interrupt_before_there_is_a_store_is_told(config, capsys, monkeypatch):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("saltus.basins.map.mapping.find_attractors", stop)
    found = run_command(capsys, "basins", str(config), "-o", str(config.with_name("none.zarr")))
    assert found == (130, "", "saltus: interrupted before there was anything to keep\n")


def test_resume_refuses_other_input_and_names_it(mapped, config, capsys):
    config.write_text(WELLS.replace("A = 0.05", "A = 0.06"))
    code, _, err = run_command(capsys, "basins", str(config), "-o", str(mapped[1]), "--resume")
    assert code == 2
    assert "A" in err
    assert "0.05" in err
    assert "0.06" in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("starts = 16", "starts = 17", "its search.options.starts is 16, not 17"),
        ("starts = 16\n", "", "its search.options.starts is 16, not 256"),
        ("samples = 200", "samples = 300", "its search.options.samples is 200, not 300"),
        (
            "[attractors.options]", "[attractors.region]\nx = 0.0\nv = [-1.0, 1.0]\n[attractors.options]",
            "its search.region.x is [-2.0, 2.0], not 0.0",
        ),
        (
            "[attractors.options]\nstarts = 16", "[attractors]\nseeds = 17\n[attractors.search]",
            "its search.options.starts is 16, not 17",
        ),
    ],
)  # fmt: skip
def test_resume_refuses_another_search_for_attractors_and_names_what_differs(mapped, config, capsys, old, new, told):
    config.write_text(WELLS.replace(old, new))
    wanted = f"saltus: path = {str(mapped[1])!r}: must be a new one, or that of the same input; {told}\n"
    assert run_command(capsys, "basins", str(config), "-o", str(mapped[1]), "--resume") == (2, "", wanted)


def test_an_existing_store_is_refused_with_a_hint(mapped, capsys):
    wanted = f"saltus: --out = {str(mapped[1])!r}: must be new; it exists: --resume goes on with it\n"
    assert run_command(capsys, "basins", str(mapped[0]), "-o", str(mapped[1])) == (2, "", wanted)


def test_a_store_is_asked_for(config, capsys):
    wanted = "saltus: --out = None: must be given: the store that is written; add -o STORE.zarr, or --estimate alone\n"
    assert run_command(capsys, "basins", str(config)) == (2, "", wanted)


def test_options_may_stand_before_the_configuration(mapped, capsys):
    assert run_command(capsys, "basins", "--resume", "-o", str(mapped[1]), str(mapped[0]))[0] == 0


def test_the_cost_is_told_and_nothing_is_written(config, capsys):
    before = set(config.parent.iterdir())
    code, out, err = run_command(capsys, "basins", str(config), "--estimate")
    assert (code, err) == (0, "")
    rows = _rows(out)
    assert rows["cells"] == "120"
    assert rows["measured"].endswith("orbits/s on this machine (64 cells)")
    assert "on 256 such machines" in rows["time"]
    assert rows["store"].startswith("at most 120 B, about ")
    assert {path for path in config.parent.iterdir() if path.name != "__pycache__"} == before


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--engine", "gpu"], "--engine = 'gpu': must be one of cpu, cuda, dask; did you mean 'cpu'?"),
        (["--engine", "dask"], "--scheduler = None: must be given for the engine dask, and for no other"),
        (
            ["--engine", "cpu", "--scheduler", "tcp://h:1"],
            "--scheduler = 'tcp://h:1': must be given for the engine dask, and for no other",
        ),
        (
            ["--scheduler", "tcp://h:1"],
            "--scheduler = 'tcp://h:1': must be given for the engine dask, and for no other",
        ),
        (
            ["--estimate", "--preview"],
            "--preview = True: must be left out with --estimate; its cost follows from the basins' boundary",
        ),
    ],
)
def test_options_that_do_not_belong_together_are_told(config, capsys, options, told):
    store = config.with_name("new.zarr")
    assert run_command(capsys, "basins", str(config), "-o", str(store), *options) == (2, "", f"saltus: {told}\n")
    assert not store.exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("system = ", "config = '{path}': must be a TOML file; Invalid value (at end of document)"),
        ("", "system = None: must be given"),
        ("sytem = 'x'", "key = 'sytem': must be one of system, model, parameters, interval, grid, "
         "plane, engine, attractors; did you mean 'system'?"),
        ("system = 'x'\nsytem = 'x'", "key = 'sytem': must be one of system, model, parameters, interval, grid, "
         "plane, engine, attractors; did you mean 'system'?"),
        ("system = 'tapping_mod'\n[grid]",
         "system = 'tapping_mod': must be tapping_mode, afm.model, or module:attribute; did you mean 'tapping_mode'?"),
        ("system = 'tapping_mode'", "grid, plane = 'neither': must be one of the two tables, [grid] or [plane]"),
        ("system = 'tapping_mode'\n[engine]\nname = 'gpu'\n[grid]", "engine.name = 'gpu': must be cpu, cuda or dask"),
        ("system = 'tapping_mode'\n[engine]\nlongst = 2\n[grid]",
         "key = 'longst': must be one of name, tolerance, longest in [engine]; did you mean 'longest'?"),
        ("system = 'tapping_mode'\n[parameters]\nOmega = 'fast'\n[grid]",
         "parameters.Omega = 'fast': must be a number"),
        ("system = 'tapping_mode'\n[parameters]\nOmega = '1'\n[grid]", "parameters.Omega = '1': must be a number"),
        ("system = 'tapping_mode'\n[engine]\nlongest = true\n[grid]", "engine.longest = True: must be an integer"),
        ("system = 'tapping_mode'\n[attractors]\noptions = 3\n[grid]", "attractors.options = 3: must be a dictionary"),
        ("system = 'tapping_mode'\n[model]\nmods = 2\n[grid]", "key = 'mods': must be one of modes, static_term, eta, "
         "R, H, E_star, a0, length, width, thickness, density, young, k, f0, Q; did you mean 'modes'?"),
        ("system = 'tapping_mode'\n[grid]\nq1 = [1, -1, 5]\nv1 = 0",
         "grid['q1'] = (1, -1, 5): must be (low, high, count) with low < high; turn it round"),
        ("system = 'nowhere:x'\n[grid]",
         "system = 'nowhere:x': must be a module that can be imported, and its attribute; No module named 'nowhere'"),
        ("system = 'wells:double_wel'\n[grid]",
         "system = 'wells:double_wel': must be an attribute of wells; did you mean 'double_well'?"),
        ("system = 'wells:BOX'\n[grid]", "system = 'wells:BOX': must be a HybridSystem or a Map, or what makes one; "
         "it is {{'x': (-2.0, 2.0, 30), 'v': (-2.0, 2.0, 20)}}"),
        ("system = 'wells:double_well'\n[model]\nnme = 'x'\n[grid]",
         "key = 'nme': must be one of name in [model]; did you mean 'name'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_configuration_is_told_in_a_line(tmp_path, capsys, text, told):
    path = tmp_path / "config.toml"
    path.write_text(text)
    code, out, err = run_command(capsys, "basins", str(path), "-o", str(tmp_path / "new.zarr"))
    assert (code, out, err) == (2, "", f"saltus: {told.format(path=path)}\n")


def test_a_configuration_that_is_not_there_is_told(tmp_path, capsys):
    path = tmp_path / "config.toml"
    wanted = f"saltus: config = {str(path)!r}: must be a file that can be read; No such file or directory\n"
    assert run_command(capsys, "basins", str(path), "-o", "new.zarr") == (2, "", wanted)


def test_a_store_in_a_folder_that_is_not_there_is_told_before_the_work(config, capsys):
    store = config.parent / "none" / "new.zarr"
    wanted = f"saltus: --out = {str(store)!r}: must be in a folder that exists\n"
    assert run_command(capsys, "basins", str(config), "-o", str(store)) == (2, "", wanted)


def test_info_tells_of_an_array_from_elsewhere_what_is_known(tmp_path, capsys):
    x = np.linspace(-0.95, 0.95, 20)
    disc = Basins.from_array(x[:, None] ** 2 + x**2 < 0.36, {"x": x, "y": x}, {"outside": 0, "inside": 1})
    code, out, err = run_command(capsys, "basins", "info", str(disc.save(tmp_path / "disc.zarr")))
    assert (code, err) == (0, "")
    rows = _rows(out)
    assert (rows["system"], rows["inside"], rows["done"]) == ("unknown", "28.0000 % of the cells", "all 400 cells done")


def test_names_from_a_file_are_shown_as_they_are(tmp_path, capsys):
    names = ("[red]a[/red]", "\x1b[31mb", "[/]", "Ω\a")
    of_them = Basins.from_array([0, 1, 2, 3], {"x": np.arange(4.0)}, {name: k for k, name in enumerate(names)})
    code, out, err = run_command(capsys, "basins", "info", str(of_them.save(tmp_path / "names.zarr")))
    assert (code, err) == (0, "")
    for shown in ("[red]a[/red]", r"\x1b[31mb", "[/]", r"Ω\x07"):
        assert f" {shown} " in out.replace("\n", " \n ")


def test_a_terminal_that_lacks_letters_shows_names_all_the_same(tmp_path, monkeypatch):
    of_them = Basins.from_array([0, 1], {"x": np.arange(2.0)}, {"Ω ± 1": 0, "b": 1})
    path = str(of_them.save(tmp_path / "names.zarr"))
    for encoding, shown in (("ascii", r"\u03a9 \xb1 1"), ("latin-1", "\\u03a9 \xb1 1"), ("utf-8", "Ω ± 1")):
        out = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(sys, "stdout", out)
        with pytest.raises(SystemExit) as left:
            cli.main(["basins", "info", path])
        out.flush()
        assert left.value.code == 0
        assert shown in out.buffer.getvalue().decode(encoding)


def test_info_of_something_else_is_told(tmp_path, capsys):
    code, out, err = run_command(capsys, "basins", "info", str(tmp_path))
    assert (code, out) == (2, "")
    assert err.startswith(f"saltus: path = {str(tmp_path)!r}: must be a store of basins that saltus wrote; ")
    assert len(err.splitlines()) == 1


def test_help_has_both_command_lines_and_the_options(capsys):
    code, out, _ = run_command(capsys, "basins", "--help")
    assert code == 0
    assert "saltus basins CONFIG.toml -o STORE.zarr" in out
    assert "saltus basins info STORE.zarr" in out
    assert all(option in out for option in ("--engine", "--scheduler", "--resume", "--estimate", "--preview"))


@pytest.mark.parametrize("args", [["basins", "--help"], ["basins", "c.toml"], ["basins", "c.toml", "--engine", "x"]])
def test_a_command_that_computes_nothing_imports_nothing_heavy(args):
    heavy = ("sympy", "numba", "xarray", "matplotlib", "scipy", "numpy", "zarr", "pyvista", "distributed")
    code = (
        "import sys, saltus.cli\n"
        f"try: saltus.cli.main({args!r})\n"
        "except SystemExit: pass\n"
        f"sys.exit(', '.join(name for name in {heavy!r} if name in sys.modules) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["fig3", "fig9"])
def test_an_option_that_a_figure_does_not_take_is_told(name, tmp_path, capsys):
    wanted = f"saltus: --animate = True: must be left out for {name}\n"
    assert run_command(capsys, "reproduce", name, "--animate", "-o", str(tmp_path / "new")) == (2, "", wanted)
    assert not (tmp_path / "new").exists()


def test_a_bar_stands_on_a_terminal_only(capsys, monkeypatch):
    with console.bar() as nothing:
        assert nothing is False
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    with console.bar() as show:
        show(Progress(25_000, 100_000, 12_500.0, "labelling cells"))
    out, err = capsys.readouterr()
    assert not out
    assert "25.0 %" in err
    assert "12,500 a second  6 s left  labelling cells" in err


def test_a_system_that_is_made_takes_no_arguments(tmp_path):
    from saltus.basins.map.config import read_config, system_of

    (tmp_path / "made_here.py").write_text("from wells import double_well\nwell = double_well()\n")
    path = tmp_path / "config.toml"
    path.write_text("system = 'made_here:well'\n[grid]\nx = 0.0\n")
    assert system_of(read_config(path), {}, tmp_path).name == "double well"
    path.write_text("system = 'made_here:well'\n[model]\nname = 'x'\n[grid]\nx = 0.0\n")
    with pytest.raises(InputError, match="model = {'name': 'x'}: must be left out; made_here:well is made already"):
        system_of(read_config(path), {}, tmp_path)


def test_a_plane_of_any_direction_is_read(tmp_path):
    from saltus.basins.map.config import read_config
    from saltus.basins.map.grid import Grid

    path = tmp_path / "config.toml"
    path.write_text(
        "system = 'x:y'\n[plane]\norigin = {x = 0.5, v = 0.0}\nu = {x = 0.6, v = 0.8}\nv = {x = -0.8, v = 0.6}\n"
        "extents = [[-1, 1], [0, 1]]\ncounts = [2, 1]\nnames = ['a', 'b']\n"
    )
    points = Grid(("x", "v"), read_config(path).cells).points()
    assert points == pytest.approx(np.array([[0.5 - 0.3 - 0.4, -0.4 + 0.3], [0.5 + 0.3 - 0.4, 0.4 + 0.3]]))


def test_the_example_configurations_can_be_read():
    from saltus.afm.files.configuration import model_of
    from saltus.afm.paper.variations import tapping_mode_with
    from saltus.basins.map.config import read_config, system_of
    from saltus.basins.map.grid import Grid

    folder = Path(__file__).parents[2] / "examples" / "configs"
    sizes = {}
    for path in sorted(folder.glob("*.toml")):
        read = read_config(path)
        makers = {"tapping_mode": tapping_mode_with, "afm.model": partial(model_of, folder)}
        system = system_of(read, makers, folder)
        system.resolve(read.parameters)
        sizes[path.stem] = Grid(system.states, read.cells).shape
    assert sizes == {"basins_4d": (400,) * 4, "basins_lever": (60, 60), "basins_plane": (200, 200)}


@pytest.mark.campaign
def test_the_engine_dask_labels_as_the_processor_does(mapped, config, capsys):
    distributed = pytest.importorskip("distributed")
    store = config.with_name("dask.zarr")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        options = ["--engine", "dask", "--scheduler", cluster.scheduler_address]
        assert run_command(capsys, "basins", str(config), "-o", str(store), *options)[0] == 0
    assert np.array_equal(Basins.open(store).labels, Basins.open(mapped[1]).labels)
