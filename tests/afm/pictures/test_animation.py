"""The film of tapping: what it shows against closed forms, the files that it writes, and what it refuses."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np
import pytest
from PIL import Image

import saltus
from saltus import afm
from saltus.afm.paper.sample import tip_force
from saltus.afm.pictures.animation import Scene, animate
from saltus.afm.pictures.cantilever_motion import hertz_profile, motion_of
from saltus.afm.probe.beam import mode_shape
from saltus.errors import InputError, SaltusError

SETUP = afm.table1()
ETA = 60.0  # nm
PLACES = np.linspace(0.0, 1.0, 2001)
README_PICTURE = Path(__file__).parents[3] / "docs" / "images" / "tap.gif"


@pytest.fixture(scope="module")
def orbit():
    """Of period two, as the paper's Fig. 7(c)."""
    return afm.settled_orbit(afm.tapping_mode(SETUP, modes=2), {"Omega": 1.0})


@pytest.fixture(scope="module")
def motion(orbit):
    return motion_of(orbit, PLACES, 40, SETUP)


def test_two_periods_of_the_drive_in_microseconds(motion):
    assert motion.period == pytest.approx(2e6 / 51519.24, rel=1e-6)
    assert motion.t == pytest.approx(motion.period * np.arange(40) / 40)


def test_the_beam_ends_in_the_tip_and_begins_in_the_moving_base(motion):
    assert motion.beam[:, -1] == pytest.approx(motion.z, abs=1e-9)
    base = ETA * (1.0 - 0.108 * np.sin(2.0 * math.pi * motion.t * 51519.24e-6))
    assert motion.beam[:, 0] == pytest.approx(base, abs=1e-4)


def test_the_beam_has_the_shape_of_both_modes(orbit, motion):
    """Modes are orthogonal, and int(phi**2) = 1/4: projecting the beam gives back the states of the simulation."""
    bent = 1.0 - (motion.beam - motion.beam[:, :1]) / ETA - 1.0
    weights = np.full(len(PLACES), 1.0 / (len(PLACES) - 1))
    weights[[0, -1]] /= 2.0
    states = saltus.simulate(orbit.system, orbit.parameters, orbit.x0, periods=2)
    times = states.t_end * np.arange(40) / 40
    for i in (1, 2):
        amplitude = 4.0 * (bent * mode_shape(i, PLACES)) @ weights
        assert amplitude == pytest.approx(states(times)[:, i - 1], abs=2e-5)  # trapezoidal rule, 2000 intervals


def test_the_beam_is_level_at_the_clamp(motion):
    """phi(0) = phi'(0) = 0, so that near the clamp the beam leaves the base like x**2: 4 times as far at 2 x."""
    left = motion.beam[:, [4, 8]] - motion.beam[:, :1]
    far = np.abs(left[:, 0]) > 1e-4
    assert left[far, 1] / left[far, 0] == pytest.approx(np.full(far.sum(), 4.0), rel=0.02)


def test_the_force_is_the_sample_s_in_nanonewtons(motion):
    assert motion.force == pytest.approx(tip_force(1e-9 * motion.z, SETUP.sample) * 1e9, rel=1e-7, abs=1e-9)


def test_the_velocity_is_the_gap_s_rate(orbit):
    """1 nm/us is 1 mm/s; central differences of 4000 steps a period, away from where the acceleration jumps."""
    motion = motion_of(orbit, PLACES[:1], 8000, SETUP)
    rate = (np.roll(motion.z, -1) - np.roll(motion.z, 1)) / (motion.period / 4000.0)
    away = ~(motion.contact | np.roll(motion.contact, 1) | np.roll(motion.contact, -1))
    assert rate[away] == pytest.approx(motion.v[away], abs=1e-4 * np.abs(motion.v).max())


def test_without_a_setup_time_is_in_periods_and_heights_stay_in_nanometres(orbit, motion):
    bare = motion_of(orbit, PLACES, 40)
    assert (bare.period, bare.t[1]) == (1.0, 1.0 / 40)
    assert np.array_equal(bare.beam, motion.beam)
    scene = Scene(orbit, None, 10, 1.0)
    assert "periods" in scene.figure.axes[2].get_xlabel()
    assert "its length" in scene.figure.axes[0].get_xlabel()


def test_hertz_s_profile_meets_at_the_rim_and_tends_to_a_point_load_s():
    """Half the depth at r = a; far off 4 sqrt(R) depth**1.5 / (3 pi r), as Boussinesq's point load, to (a/r)**2."""
    depth, radius = 2.6, 20.0
    a = math.sqrt(depth * radius)
    inside, outside = hertz_profile(np.array([a * (1 - 1e-9), a * (1 + 1e-9)]), depth, radius)
    assert (inside, outside) == (pytest.approx(depth / 2, rel=1e-6), pytest.approx(depth / 2, rel=1e-4))
    far = 100.0 * a
    point_load = 4.0 * math.sqrt(radius) * depth**1.5 / (3.0 * math.pi * far)
    assert hertz_profile(np.array([far]), depth, radius)[0] == pytest.approx(point_load, rel=1e-4)
    assert hertz_profile(np.array([0.0]), 0.0, radius)[0] == 0.0


def test_contact_is_coloured_and_told(orbit):
    frames = 50
    scene = Scene(orbit, SETUP, frames, 1.0)
    contact = motion_of(orbit, PLACES[:1], frames, SETUP).contact
    assert 0 < contact.sum() < frames
    seen = {}
    for frame in (int(np.argmax(contact)), int(np.argmin(contact))):
        scene.show(frame)
        texts = [text.get_text() for text in scene.figure.axes[0].texts]
        seen[bool(contact[frame])] = ("contact" in texts, scene._tip.get_facecolor())
    assert seen[True][0]
    assert not seen[False][0]
    assert seen[True][1] != seen[False][1]


def test_the_tip_s_apex_and_the_moving_points_are_the_motion(orbit):
    frames = 30
    scene, motion = Scene(orbit, SETUP, frames, 1.0), motion_of(orbit, PLACES[:1], frames, SETUP)
    for frame in (0, 7, 22):
        scene.show(frame)
        assert scene._tip.get_xy()[:, 1].min() == pytest.approx(motion.z[frame])
        assert scene._moving.get_xydata()[0] == pytest.approx([motion.z[frame], motion.v[frame]])
        assert scene._pushed.get_xydata()[0] == pytest.approx([motion.t[frame], motion.force[frame]])


@pytest.mark.campaign
def test_a_gif_has_all_frames_runs_for_ever_and_is_white(orbit, tmp_path):
    said = []
    path = animate(
        orbit,
        tmp_path / "tap.gif",
        setup=SETUP,
        fps=10,
        seconds=1.0,
        width=400,
        progress=said.append,
    )
    assert [(told.done, told.total) for told in said] == [(i, 10) for i in range(1, 11)]
    with Image.open(path) as film:
        assert film.size == (400, 220)
        assert film.n_frames == 10
        assert (film.info["loop"], film.info["duration"]) == (0, 100)
        for frame in range(10):
            film.seek(frame)
            assert film.convert("RGB").getpixel((2, 2)) == (255, 255, 255)


@pytest.mark.campaign
def test_true_shows_a_bar_of_the_frames(orbit, tmp_path, capsys):
    animate(orbit, tmp_path / "tap.gif", setup=SETUP, fps=10, seconds=0.5, width=320, progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err


def test_a_film_closes_on_itself(orbit):
    """The step from the last frame to the first is none of the longest."""
    motion = motion_of(orbit, PLACES[:1], 100, SETUP)
    steps = np.abs(np.diff(np.append(motion.z, motion.z[0])))
    assert steps[-1] < steps[:-1].max()


def test_the_readme_s_film_is_small_and_loops():
    with Image.open(README_PICTURE) as film:
        assert README_PICTURE.stat().st_size <= 3_000_000
        assert film.info["loop"] == 0
        assert 3000 <= film.n_frames * film.info["duration"] <= 5000


def test_an_mp4_without_its_encoder_names_the_extra(orbit, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(SaltusError, match=r'^MP4 needs an encoder: pip install "saltus\[video\]", or write a \.gif$'):
        animate(orbit, tmp_path / "tap.mp4", setup=SETUP)
    assert not list(tmp_path.iterdir())


@pytest.mark.campaign
def test_an_mp4_is_written(orbit, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    path = animate(orbit, tmp_path / "tap.mp4", setup=SETUP, fps=24, seconds=0.5, width=320)
    assert path.read_bytes()[4:8] == b"ftyp"


@pytest.mark.campaign
def test_an_interrupt_leaves_an_older_film_as_it_was(orbit, tmp_path):
    path = tmp_path / "tap.gif"
    path.write_text("older")

    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animate(orbit, path, setup=SETUP, fps=10, seconds=0.5, width=320, progress=stop)
    assert [p.name for p in tmp_path.iterdir()] == ["tap.gif"]
    assert path.read_text() == "older"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"progress": 1}, "progress = 1: must be True for a bar, or a function of a saltus.Progress"),
        ({"fps": 30}, "fps = 30: must be one of 1, 2, 4, 5, 10, 20, 25, 50 for a GIF"),
        ({"fps": 2.5}, "fps = 2.5: must be an integer between 1 and 120"),
        ({"seconds": 0.1}, "seconds = 0.1: must be a number from 0.5 to 60 with 1000 frames at most"),
        ({"seconds": 59.0}, "seconds = 59.0: must be a number from 0.5 to 60 with 1000 frames at most"),
        ({"seconds": math.nan}, "seconds = nan: must be a number from 0.5 to 60 with 1000 frames at most"),
        ({"width": 100}, "width = 100: must be an integer between 320 and 1920, in pixels"),
        ({"setup": 3}, "setup = 3: must be a Setup; table1() returns the paper's"),
    ],
)
def test_options_that_cannot_be_used_are_told(orbit, tmp_path, options, message):
    with pytest.raises(InputError) as told:
        animate(orbit, tmp_path / "tap.gif", **options)
    assert str(told.value) == message


def test_a_path_that_cannot_be_used_is_told(orbit, tmp_path):
    for path, allowed in (
        (tmp_path / "tap.png", "a file whose name ends in .gif or .mp4"),
        (tmp_path / "none" / "tap.gif", "a file in a folder that exists"),
    ):
        with pytest.raises(InputError) as told:
            animate(orbit, path)
        assert str(told.value) == f"path = {str(path)!r}: must be {allowed}"


def test_an_orbit_that_is_no_motion_is_refused(orbit, tmp_path):
    with pytest.raises(InputError, match=r"^orbit = .*: must be admissible; "):
        animate(replace(orbit, faults=1), tmp_path / "tap.gif")


# a model in nm and us


@pytest.fixture(scope="module")
def lever():
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    return saltus.find_orbit(afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=10.0), x0=[0.0, 0.0])


def test_a_model_moves_in_its_own_units(lever):
    motion = motion_of(lever, PLACES, 400)
    assert (motion.period, motion.radius) == (pytest.approx(1e3 / 300.0), 12.0)
    assert motion.surface == pytest.approx(0.3, abs=1e-12)
    assert motion.beam[:, -1] == pytest.approx(motion.z, abs=1e-9)
    assert motion.beam[:, 0] == pytest.approx(np.full(400, 10.0), abs=1e-9)
    states = saltus.simulate(lever.system, lever.parameters, lever.x0, periods=1)(motion.t)
    assert motion.v == pytest.approx(states[:, 1], abs=1e-6)
    attraction = -0.12 * 12.0 / (6.0 * np.maximum(motion.z, 0.3) ** 2)
    assert motion.force == pytest.approx(attraction + 2.0 * math.sqrt(12.0) * np.maximum(0.3 - motion.z, 0.0) ** 1.5)
    assert motion.contact.tolist() == (motion.z < 0.3).tolist()


def test_a_model_is_filmed_on_its_own_scale(lever, tmp_path):
    figure = Scene(lever, None, 10, 2.0).figure
    labels = {ax.get_xlabel() for ax in figure.axes} | {ax.get_ylabel() for ax in figure.axes}
    assert {"gap $z$ (nm)", "velocity $\\dot{z}$ (mm/s)", "time $t$ (µs)", "force (nN)"} <= labels
    assert figure.texts[0].get_text() == "tapping mode, 1 mode  ·  300.0 kHz  ·  slowed 600 000 times"
    with pytest.raises(InputError, match="must be left out for a model of saltus.afm.model"):
        animate(lever, tmp_path / "tap.gif", setup=SETUP)
