"""`saltus afm`: curves and observables from a file, parameter sets, and every refusal."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tomllib
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import saltus
from commands import HEAVY, run_command
from instrument_writers import jpk
from saltus import InputError, afm, cli
from saltus.afm.curves.stable_orbits import stable_orbits
from saltus.afm.files.configuration import Experiment, _told, model_of, read_experiment
from saltus.afm.files.sets import entries_of, names, text_of
from saltus.afm.models.modelling import model

LEVER = text_of("lever-s")
TYPES = "the name of a law of saltus.afm, as DMT; Tabulated, with a file; or module:Class"


@pytest.fixture
def lever(tmp_path) -> Path:
    path = tmp_path / "lever.toml"
    path.write_text(LEVER)
    return path


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> tuple[Path, str]:
    """Folder with the curve of lever S and its picture, and what was printed."""
    folder = tmp_path_factory.mktemp("lever")
    (folder / "lever.toml").write_text(LEVER)
    with pytest.MonkeyPatch.context() as patch:
        said: list[str] = []
        patch.setattr("typer.echo", lambda text, **_: said.append(text))
        with pytest.raises(SystemExit) as left:
            cli.main(["afm", "curve", str(folder / "lever.toml"), "-o", str(folder / "apd.nc"),
                      "--plot", str(folder / "apd.png")])  # fmt: skip
    assert not left.value.code
    return folder, "\n".join(said)


# curve


@pytest.mark.campaign
def test_the_curve_that_is_written_is_the_one_of_the_functions(written):
    folder, said = written
    curve = saltus.load(folder / "apd.nc")
    assert isinstance(curve, afm.Curve)
    assert [(jump.direction, jump.value) for jump in curve.jumps] == [
        ("approach", pytest.approx(9.878337793, abs=1e-8)),
        ("retract", pytest.approx(11.50288421, abs=1e-8)),
    ]
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    same = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=14.0), (0.5, 14.0))
    np.testing.assert_array_equal(curve.column("amplitude_nm"), same.column("amplitude_nm"))
    assert said.splitlines()[: len(repr(same).splitlines())] == repr(same).splitlines()
    assert said.splitlines()[-2:] == [f"written  {folder / 'apd.nc'}", f"written  {folder / 'apd.png'}"]
    assert (folder / "apd.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in folder.iterdir()} == {"lever.toml", "apd.nc", "apd.png"}


@pytest.mark.campaign
def test_a_curve_is_drawn_by_the_command_for_results_too(written, tmp_path, capsys):
    picture = tmp_path / "curve.svg"
    assert run_command(capsys, "plot", str(written[0] / "apd.nc"), "-o", str(picture))[0] == 0
    assert "distance" in picture.read_text()


@pytest.mark.campaign
def test_a_frequency_curve_lies_at_the_distance_of_the_file(lever):
    lever.write_text(LEVER.replace('along = "Zc_nm"\nrange = [0.5, 14.0]', 'along = "f_kHz"\nrange = [299.4, 299.6]'))
    curve = read_experiment(lever).traced()
    assert (curve.along, curve.bounds, curve.system.parameters["Zc_nm"]) == ("f_kHz", (299.4, 299.6), 10.0)


def test_options_of_the_curve_reach_it(lever):
    lever.write_text(
        LEVER.replace(
            "range = [0.5, 14.0]",
            "range = [13.5, 14.0]\nof = 'tip'\nphase_convention = 'asylum'\nparameters = {E_GPa = 2.0}",
        )
        + "[curve.steps]\nlargest = 0.01\n"
    )
    curve = read_experiment(lever).traced()
    assert (curve.of, curve.phase_convention) == ("tip", "asylum")
    assert curve.branches[0].solution(0).parameters["E_GPa"] == 2.0
    assert len(curve) > 10


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_curve_below_the_distance_where_an_adhesive_contact_forms(tmp_path):
    """The free motion ends at 20 nm, where it forms the contact; the curve from 19 nm has the motion beyond."""
    path = tmp_path / "jkr.toml"
    path.write_text(text_of("adhesive-jkr").replace("[10.0, 19.0]", "[14.0, 19.0]"))
    curve = read_experiment(path).traced()
    (orbit,) = curve.at(15.0)
    assert afm.observables(orbit)["amplitude_nm"] == pytest.approx(16.9055245, rel=1e-8)
    assert curve.ways[0].stopped == "Zc_nm = 14: the end of the range"


def test_an_interrupt_keeps_the_sheets_so_far(lever, capsys, monkeypatch):
    def stop(progress):
        raise KeyboardInterrupt

    @contextmanager
    def interrupting(first):
        yield stop

    monkeypatch.setattr(cli.afm, "bar", interrupting)
    out = lever.with_name("apd.nc")
    picture = out.with_suffix(".png")
    status, _, said = run_command(capsys, "afm", "curve", str(lever), "-o", str(out), "--plot", str(picture))
    assert (status, said) == (130, "saltus: interrupted; kept the sheets so far\n")
    assert saltus.load(out).failures[0][1] == "interrupted: sheets may be missing"
    assert picture.stat().st_size > 0


@pytest.mark.campaign
def test_a_bar_is_asked_for(lever, capsys, monkeypatch):
    seen = []

    @contextmanager
    def listening(first):
        yield seen.append

    monkeypatch.setattr(cli.afm, "bar", listening)
    lever.write_text(LEVER.replace("0.5, 14.0", "13.0, 14.0"))
    assert run_command(capsys, "afm", "curve", str(lever), "-o", str(lever.with_name("apd.nc")))[0] == 0
    assert seen[-1].done > 1


# observe


def _observed(out: str) -> dict[str, list[str]]:
    return {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.strip()}


@pytest.mark.campaign
def test_the_stable_orbits_at_the_distance_of_the_file_are_told(lever, capsys):
    code, out, err = run_command(capsys, "afm", "observe", str(lever))
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "Zc_nm = 10, f_kHz = 300: 2 stable, 1 unstable"
    rows = _observed(out)
    assert rows["regime"] == ["repulsive", "attractive"]
    assert rows["amplitude_nm"] == ["nm", "10.7156989", "9.89527886"]
    assert rows["lag_deg"] == ["degrees", "63.2497147", "124.451244"]
    assert rows["contact_fraction"] == ["0.139377622", "0.0635933643"]


@pytest.mark.campaign
def test_another_place_and_a_file_without_a_curve(lever, capsys):
    lever.write_text(LEVER.partition("[curve]")[0].replace("Zc_nm = 10.0\n", ""))
    code, out, _ = run_command(capsys, "afm", "observe", str(lever), "--at", "11.6")
    assert code == 0
    assert out.splitlines()[0] == "Zc_nm = 11.6, f_kHz = 300: 1 stable"
    assert _observed(out)["regime"] == ["attractive"]
    wanted = "saltus: Zc_nm = None: must be given; in the file, above its first table\n"
    assert run_command(capsys, "afm", "observe", str(lever)) == (2, "", wanted)


@pytest.mark.campaign
def test_a_phase_is_told_as_the_instrument_of_the_file_shows_it(lever, capsys):
    lever.write_text(LEVER.replace("range = [0.5, 14.0]", "range = [9.0, 14.0]\nphase_convention = 'bruker0'"))
    code, out, _ = run_command(capsys, "afm", "observe", str(lever))
    assert code == 0
    assert _observed(out)["shown_phase_deg"] == ["degrees", "26.7502853", "-34.4512443"]


@pytest.mark.campaign
def test_a_place_beyond_the_curve_is_told(lever, capsys):
    wanted = "saltus: Zc_nm = 99.0: must be between 0.5 and 14, where the curve is\n"
    assert run_command(capsys, "afm", "observe", str(lever), "--at", "99") == (2, "", wanted)


@pytest.mark.campaign
def test_orbits_that_no_way_from_afar_reaches_are_found_by_motions(written):
    """A curve of the attractive sheet alone, as it is where the repulsive one has only a corner of the range."""
    system = saltus.load(written[0] / "apd.nc").system
    attractive = saltus.find_orbit(system, {"Zc_nm": 11.6}, [0.0, 0.0])
    sheet = saltus.continue_orbit(attractive, "Zc_nm", (10.2, 11.6), stop_at="SN")
    curve = afm.Curve(system, "Zc_nm", (10.2, 11.6), (sheet,))
    assert len(curve.at(10.5)) == 1
    found = stable_orbits(curve, 10.5)
    assert (found.beside, found.unstable, found.unsettled) == (1, 0, 0)
    whole = [orbit for orbit in saltus.load(written[0] / "apd.nc").at(10.5) if orbit.stable]
    for one, other, regime in zip(found.orbits, whole[::-1], ("attractive", "repulsive"), strict=True):
        assert one.x0 == pytest.approx(other.x0, rel=1e-6)
        assert afm.observables(one)["regime"] == regime


# animate


@pytest.mark.campaign
def test_a_film_of_either_regime_is_written(lever, capsys, monkeypatch):
    filmed = []

    def film(orbit, path, **options):
        filmed.append(afm.observables(orbit)["amplitude_nm"])
        path.write_bytes(b"film")

    monkeypatch.setattr("saltus.afm.animate", film, raising=False)
    out = lever.with_name("tap.gif")
    for options in ([], ["--regime", "attractive"], ["--at", "12.0"]):
        assert run_command(capsys, "afm", "animate", str(lever), "-o", str(out), *options)[0] == 0
    assert filmed == pytest.approx([10.71569893, 9.895278868, 11.6076107], rel=1e-8)
    wanted = "saltus: --regime = 'repulsive': must be a regime with a stable orbit at Zc_nm = 12: attractive\n"
    told = run_command(capsys, "afm", "animate", str(lever), "-o", str(out), "--at", "12.0", "--regime", "repulsive")
    assert told == (2, "", wanted)


# files


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[probe]", "[prob]", "key = 'prob': must be one of probe, law, drive, Zc_nm, f_kHz, check, curve, title, "
         "source, fit; did you mean 'probe'?"),
        ("R_nm", "R_mn", "key = 'R_mn': must be one of k_N_m, f0_kHz, Q, R_nm, optical_weights, base_weights, check in "
         "[probe]; did you mean 'R_nm'?"),
        ("R_nm = 12.0\n", "", "probe.R_nm = None: must be given"),
        ("R_nm = 12.0", "R_nm = 12e-9", "R_nm = 1.2e-08: must be between 0.5 and 100000 nm; in m? then it is 12 nm; "
         "check=False insists"),
        ("k_N_m = 26.0", "k_N_m = '26'", "k_N_m = '26': must be a finite number > 0 (in N/m)"),
        ('"DMT"', '"DTM"', f"law.type = 'DTM': must be {TYPES}; did you mean 'DMT'?"),
        ('type = "DMT"\n', "", f"law.type = None: must be given: {TYPES}"),
        ('"DMT"', '"nowhere:DMT"', "law.type = 'nowhere:DMT': must be a module that can be imported, and its "
         "attribute; No module named 'nowhere'"),
        ('"DMT"', '"math:pi"',
         "law.type = 'math:pi': must be a class that is made from saltus.afm.Law; it is 3.141592653589793"),
        ("H_aJ = 0.12", "H_aJ = '0.12'", "H_aJ = '0.12': must be a finite number (in aJ)"),
        ("A0_nm", "A_nm", "key = 'A_nm': must be one of A0_nm, mode, ratio, at, phase_deg, F0_nN, Y_nm, fluid, check "
         "in [drive]; did you mean 'A0_nm'?"),
        ('along = "Zc_nm"', 'along = "Zc"', "curve.along = 'Zc': must be one of Zc_nm, f_kHz; did you mean 'Zc_nm'?"),
        ("range = [0.5, 14.0]", "rnge = [1, 2]", "key = 'rnge': must be one of range, along, parameters, of, "
         "phase_convention, steps, starts in [curve]; did you mean 'range'?"),
        ("range = [0.5, 14.0]", "", "curve.range = None: must be given"),
        ("[0.5, 14.0]", "[14.0, 0.5]", "curve.range = [14.0, 0.5]: must be two finite numbers, the lower first"),
        ("range = [0.5, 14.0]", "range = [1, 2]\nsteps = 3", "curve.steps = 3: must be a table, [curve.steps]"),
        ("[drive]\nA0_nm = 12.0", "", "drive = None: must be given"),
        ('[curve]\nalong = "Zc_nm"\nrange = [0.5, 14.0]\n', "", "curve = None: must be given: a table with the range, "
         "as range = [0.5, 14.0]"),
        ('f_kHz = "f0"', 'f_kHz = "f1"', "f_kHz = 'f1': must be one of f0, peak, or a number of kHz; "
         "did you mean 'f0'?"),
        ("[probe]", "probe = ", "config = '{path}': must be a TOML file; Invalid value (at line 8, column 9)"),
    ],
)  # fmt: skip
def test_what_is_wrong_in_a_file_is_told_in_a_line(lever, capsys, old, new, told):
    lever.write_text(LEVER.replace(old, new))
    code, out, err = run_command(capsys, "afm", "curve", str(lever), "-o", str(lever.with_name("apd.nc")))
    assert (code, out, err) == (2, "", f"saltus: {told.format(path=lever)}\n")


def test_values_beyond_the_plausible_are_taken_where_the_table_insists(lever):
    lever.write_text(LEVER.replace("R_nm = 12.0", "R_nm = 0.1\ncheck = false"))
    assert read_experiment(lever).probe.R_nm == 0.1


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ([], "--out = None: must be given: the file that is written; add -o FILE.nc"),
        (["-o", "apd.csv"], "--out = 'apd.csv': must be a file whose name ends in .nc"),
        (["-o", "{folder}/lever.toml/apd.nc"], "--out = '{folder}/lever.toml': must be a folder; "
         "{folder}/lever.toml is a file"),
    ],
)  # fmt: skip
def test_places_that_cannot_be_written_are_told_before_the_work(lever, capsys, options, told):
    given = [option.format(folder=lever.parent) for option in options]
    wanted = f"saltus: {told.format(folder=lever.parent)}\n"
    assert run_command(capsys, "afm", "curve", str(lever), *given) == (2, "", wanted)


def test_a_picture_of_no_kind_is_told_before_the_work(lever, capsys):
    out = lever.with_name("apd.nc")
    code, _, err = run_command(capsys, "afm", "curve", str(lever), "-o", str(out), "--plot", "apd.txt")
    assert code == 2
    assert err.startswith("saltus: --plot = 'apd.txt': must be a picture: .")
    assert not out.exists()


def test_a_law_of_one_s_own_lies_beside_the_file(lever):
    lever.with_name("own_springs.py").write_text(
        "from dataclasses import dataclass\nfrom saltus import afm\n"
        "@dataclass(frozen=True, kw_only=True)\n"
        "class Spring(afm.Law):\n"
        "    k1_N_m: float\n"
        "    @property\n"
        "    def regions(self):\n"
        "        return {'everywhere': afm.Region('-k1_N_m*D_nm')}\n"
    )
    lever.write_text(LEVER.replace('type = "DMT"\nE_GPa = 1.5', 'type = "own_springs:Spring"\nk1_N_m = 3.0'))
    law = read_experiment(lever).law
    assert law.parameters == {"H_aJ": 0.12, "a0_nm": 0.3, "k1_N_m": 3.0}
    assert float(law.parts[1].force_nN(2.0)) == -6.0


def test_a_law_is_a_table_beside_the_file(lever, capsys):
    gaps = np.linspace(0.3, 5.0, 60)
    table = pd.DataFrame({"F_nN": -0.4 / gaps**2, "D_nm": gaps})
    table.to_csv(lever.with_name("force.csv"), index=False)
    head = LEVER.split("[[law]]", 1)[0] + LEVER[LEVER.index("[drive]") :]
    end = '\n[[law]]\ntype = "Tabulated"\nfile = "force.csv"\n'
    lever.write_text(head + end)
    law = read_experiment(lever).law
    assert law == afm.Law.tabulated(gaps, -0.4 / gaps**2)
    assert float(law.force_nN(2.0)) == pytest.approx(-0.1, abs=law.misfit * 0.4 / 0.09)
    refused = {
        end.replace("force.csv", "nowhere.csv"): "must be a CSV file that can be read; No such file or directory",
        end.replace("file =", "fiel ="): "must be one of file in [law]; did you mean 'file'?",
        end.replace('file = "force.csv"', ""): "law.file = None: must be given",
    }
    for text, told in refused.items():
        lever.write_text(head + text)
        code, _, err = run_command(capsys, "afm", "curve", str(lever), "-o", str(lever.with_name("apd.nc")))
        assert code == 2
        assert told in err
    table.rename(columns={"F_nN": "F_N"}).to_csv(lever.with_name("force.csv"), index=False)
    lever.write_text(head + end)
    with pytest.raises(InputError, match=r"columns = \['F_N', 'D_nm'\]: must be D_nm, F_nN and, if it is known, sigma"):
        read_experiment(lever)


def test_help_says_that_a_module_is_run(capsys):
    code, out, _ = run_command(capsys, "afm", "curve", "--help")
    assert code == 0
    assert "'module:Class' runs a module" in " ".join(out.split())


# sets


def test_every_set_has_a_source_and_describes_an_experiment(tmp_path):
    assert {"lever-s", "lever-p-neck", "paper-table-1"} <= set(names())
    for name in names():
        path = tmp_path / f"{name}.toml"
        path.write_text(text_of(name))
        experiment = read_experiment(path)
        assert experiment.title
        assert experiment.source
        low, high = experiment.curve["range"]
        place = experiment.probe.f0_kHz[0] if experiment.curve["along"] == "f_kHz" else experiment.Zc_nm
        assert low < place < high


def test_sets_are_listed_and_printed(capsys):
    code, out, err = run_command(capsys, "afm", "sets")
    assert (code, err) == (0, "")
    assert all(name in out for name in names())
    assert "doi:10.1115/1.4062228" in out
    assert run_command(capsys, "afm", "sets", "lever-s") == (0, LEVER, "")
    wanted = f"saltus: set = 'lever_s': must be one of {', '.join(names())}; did you mean 'lever-s'?\n"
    assert run_command(capsys, "afm", "sets", "lever_s") == (2, "", wanted)


def test_the_set_of_the_paper_is_its_table():
    setup, given = afm.table1(), entries_of("paper-table-1")
    k, f0 = setup.cantilever.k, setup.cantilever.f0
    assert given["probe"] == pytest.approx({"k_N_m": k, "f0_kHz": f0 * 1e-3, "Q": 1 / 0.025, "R_nm": 20.0}, rel=1e-6)
    assert given["law"][0] == {"type": "VanDerWaals", "H_aJ": setup.sample.H * 1e18, "a0_nm": setup.sample.a0 * 1e9}
    assert given["law"][1]["E_GPa"] == setup.sample.E_star * 1e-9
    assert given["law"][2]["c_uNs_m"] == pytest.approx((4.0 - 0.025) * k / setup.cantilever.omega_1 * 1e6, rel=1e-6)
    assert given["drive"]["Y_nm"] == pytest.approx(0.108 * setup.eta * 1e9)
    assert given["Zc_nm"] == pytest.approx(setup.eta * 1e9)


@pytest.mark.campaign
def test_the_set_of_the_paper_moves_as_the_paper_s_model_where_nothing_touches(tmp_path):
    """In contact they differ, as the dampings act on different rates."""
    omega, setup = 1.15, afm.table1()
    paper = afm.settled_orbit(afm.tapping_mode(setup), {"Omega": omega}, "attractive")
    wanted = 60.0 * paper.observe("amplitude(z, 1)")["amplitude(z, 1)"]
    path = tmp_path / "paper.toml"
    path.write_text(text_of("paper-table-1"))
    f_kHz = omega * setup.cantilever.f0 * 1e-3
    start = wanted * np.array([-np.sqrt(0.5), 2e-3 * np.pi * f_kHz * np.sqrt(0.5)])
    orbit = saltus.find_orbit(read_experiment(path).model(), {"f_kHz": f_kHz}, start)
    assert orbit.signature == (("far", "theta"),)
    seen = orbit.observe("amplitude(D_nm, 1)").popitem()[1]
    assert seen == pytest.approx(wanted, rel=1e-6)  # the file rounds k and f0


def test_a_set_is_a_model_of_the_basins_too(tmp_path):
    given = {name: entries_of("lever-s")[name] for name in ("probe", "law", "drive", "Zc_nm", "f_kHz")}
    found = model_of(tmp_path, **given)
    experiment = tmp_path / "lever.toml"
    experiment.write_text(LEVER)
    parts = read_experiment(experiment)
    assert found == model(parts.probe, parts.law, parts.drive, Zc_nm=10.0)
    assert tomllib.loads(LEVER)["source"] == parts.source


@pytest.mark.parametrize("args", [["afm", "--help"], ["afm", "sets", "lever-s"], ["afm", "curve", "c.toml"]])
def test_a_command_that_computes_nothing_imports_nothing_heavy(args):
    code = (
        "import sys, saltus.cli\n"
        f"try: saltus.cli.main({args!r})\n"
        "except SystemExit: pass\n"
        f"sys.exit(', '.join(name for name in {HEAVY!r} if name in sys.modules) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# fit


FIT = "[fit]\nvary = {H_aJ = [0.01, 1.0]}\nsigma = {amplitude_nm = 0.03, lag_deg = 0.3}\nstart = {H_aJ = 0.15}\n"


@pytest.fixture(scope="module")
def readings():
    """An approach over lever S without a jump."""
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    curve = afm.distance_curve(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=14.0), (12.0, 14.0))
    return curve.path("approach")[["amplitude_nm", "lag_deg"]].to_dataframe()


@pytest.fixture
def measured(lever, readings):
    """Arguments of the command that fits these readings."""
    readings.to_csv(lever.with_name("apd.csv"), index=False)
    lever.write_text(LEVER + FIT)
    return ["afm", "fit", str(lever.with_name("apd.csv")), str(lever), "-o", str(lever.with_name("fit.nc"))]


@pytest.mark.campaign
def test_a_measured_curve_is_fitted_by_the_command_with_columns_of_other_names(measured, lever, readings, capsys):
    readings.rename(columns={"amplitude_nm": "Amp"}).to_csv(lever.with_name("apd.csv"), index=False)
    names = 'columns = {Zc_nm = "Zc_nm", amplitude_nm = "Amp", lag_deg = "lag_deg"}\n'
    lever.write_text(LEVER + FIT + names)
    wanted = "saltus: column = 'Amp': must be one with a unit, or give a factor, as scale={'amplitude_nm': 1.0}; "
    code, _, told = run_command(capsys, *measured)
    assert (code, told[: len(wanted)]) == (2, wanted)
    lever.write_text(LEVER + FIT + names + "scale = {amplitude_nm = 1.0}\n")
    picture = lever.with_name("fit.png")
    code, said, _ = run_command(capsys, *measured, "--plot", str(picture))
    assert code == 0
    assert saltus.load(lever.with_name("fit.nc"))["H_aJ"] == pytest.approx(0.12, rel=1e-6)
    assert said.splitlines()[-2:] == [f"written  {lever.with_name('fit.nc')}", f"written  {picture}"]
    assert "chi2/n" in said


@pytest.mark.campaign
def test_an_interrupt_of_a_fit_keeps_the_best_so_far(measured, lever, capsys, monkeypatch):
    seen = []

    def stop(progress):
        seen.append(progress.text)
        if len(seen) == 3:
            os.kill(os.getpid(), signal.SIGINT)

    @contextmanager
    def interrupting(first):
        yield stop

    monkeypatch.setattr(cli.afm, "bar", interrupting)
    code, said, told = run_command(capsys, *measured)
    assert (code, told) == (130, "saltus: interrupted; kept the best so far\n")
    assert "interrupted: the best so far, after 3 evaluations" in said
    kept = saltus.load(lever.with_name("fit.nc"))
    assert seen[0].endswith("H_aJ = 0.15")
    assert any(text.endswith(f"H_aJ = {kept['H_aJ']:.6g}") for text in seen[1:])
    assert abs(kept["H_aJ"] - 0.12) < 0.03


def test_priors_of_the_file_are_those_of_the_fit(measured, lever, monkeypatch):
    given = []
    monkeypatch.setattr("saltus.afm.files.configuration.fit", lambda *_, **options: given.append(options["priors"]))
    for text in ("", "priors = {H_aJ = [0.12, 0.01]}\n"):
        lever.write_text(LEVER + FIT + text)
        read_experiment(lever).fitted(lever.with_name("apd.csv"))
    assert given == [None, {"H_aJ": [0.12, 0.01]}]


def test_phases_of_a_convention_and_columns_of_another_sign_become_lags(tmp_path):
    table = pd.DataFrame({"Zc_nm": [-10.0, -9.0], "lag_deg": [30.0, 20.0], "direction": ["approach"] * 2})
    found = _told(table, "bruker0", {"Zc_nm": -1})
    assert (found["Zc_nm"].tolist(), found["lag_deg"].tolist()) == ([10.0, 9.0], [60.0, 70.0])
    assert _told(table, "lag90", None).equals(table)
    for signs, message in (({"Zc_nm": 2}, "fit.signs.Zc_nm = 2: must be 1 or -1"), ({"x": 1}, "fit.signs = 'x'")):
        with pytest.raises(InputError, match=message):
            _told(table, "lag90", signs)


def test_where_nothing_fits_the_exit_code_is_3_and_the_fit_is_written(lever, capsys, monkeypatch):
    class Nothing:
        misfit, stopped, notes = "the data do not fit: chi2/n = 9", "the optimum is found", ()

        def save(self, path):
            path.write_text("kept")

    monkeypatch.setattr(Experiment, "fitted", lambda *_: Nothing())
    out = lever.with_name("fit.nc")
    code, _, told = run_command(capsys, "afm", "fit", "apd.csv", str(lever), "-o", str(out))
    assert (code, told) == (3, "saltus: the data do not fit: chi2/n = 9\n")
    assert out.read_text() == "kept"


@pytest.mark.campaign
def test_data_of_another_origin_leave_with_exit_code_3_and_say_why(measured, lever, readings, capsys):
    readings.assign(Zc_nm=readings["Zc_nm"] + 2.0).to_csv(lever.with_name("apd.csv"), index=False)
    lever.write_text(LEVER + FIT.replace("start", "profile = []\nstart"))
    code, said, told = run_command(capsys, *measured)
    assert code == 3
    assert "saltus: the data do not fit: chi2/n = " in told
    assert "the data do not fit" in said
    assert saltus.load(lever.with_name("fit.nc")).misfit
    lever.write_text(LEVER + FIT.replace("vary = {", "profile = []\nvary = {Zc_offset_nm = [-3.0, 1.0], "))
    code, _, told = run_command(capsys, *measured)
    assert (code, told) == (0, "")
    assert saltus.load(lever.with_name("fit.nc"))["Zc_offset_nm"] == pytest.approx(-2.0, abs=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("vary", "vray", r"key = 'vray': must be one of vary, .*, priors in \[fit\]; did you mean 'vary'\?"),
        ("vary = {H_aJ", "vary = {H_aj", r"vary = 'H_aj': must be .*; did you mean 'H_aJ'\?"),
        ("start = {H_aJ = 0.15}", "start = {E_GPa = 1.0}", "start = 'E_GPa': must be one of H_aJ"),
        ("[0.01, 1.0]", "[1.0, 0.01]", r"fit.vary.H_aJ = \[1.0, 0.01\]: must be two finite numbers, the lower first"),
        ("start = {H_aJ = 0.15}", "jumps = 1", "fit.jumps = 1: must be True or False"),
    ],
)  # fmt: skip
def test_what_the_table_fit_has_wrong_is_told(measured, lever, capsys, old, new, told):
    lever.write_text(LEVER + FIT.replace(old, new))
    code, out, err = run_command(capsys, *measured)
    assert (code, out) == (2, "")
    assert err.startswith("saltus: ")
    assert re.search(told, err)
    assert not lever.with_name("fit.nc").exists()


# show


def test_what_the_file_of_an_instrument_holds_is_printed(capsys, tmp_path):
    stored = {"vDeflection": [1, 2, 3], "height": [3, 2, 1], "lockInAmplitude": [9, 9, 8]}
    (tmp_path / "c.jpk-force").write_bytes(jpk([[("extend", stored)]]))
    code, out, err = run_command(capsys, "afm", "show", str(tmp_path / "c.jpk-force"))
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == "force curves of JPK"
    assert re.search(r"approach: vDeflection +N +3 points", out)
    assert re.search(r"calibration +k_N_m = 0.04", out)


def test_a_damaged_file_is_refused_in_a_line(capsys, tmp_path):
    (tmp_path / "c.jpk-force").write_bytes(jpk([[("extend", {"vDeflection": [1]})]], channels={
        "vDeflection": (1.0, 0.0, (), "volts")})[:-9])  # fmt: skip
    code, out, err = run_command(capsys, "afm", "show", str(tmp_path / "c.jpk-force"))
    assert code == 2
    assert out == ""
    assert re.fullmatch(r"saltus: .*c.jpk-force': must be a file of JPK with force curves; it is another file.*\n", err)
