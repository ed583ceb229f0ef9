"""Files of Bruker, JPK, Asylum, Gwyddion and HDF5: numbers, units, constants; damaged ones take no memory."""

import random
import tracemalloc
import zipfile

import h5py
import numpy as np
import pytest

from instrument_writers import ardf, gwyddion, jpk, nanoscope
from saltus import InputError, afm
from saltus.afm.files.columns import FileColumn, FileContents, Lines

NOTE = "SpringConstant: 2.5\rInvOLS: 4.5e-08\rAmpInvOLS: 4.9e-08\rDriveFrequency: 71234\rThermalQ: 150\rOther: 1\r"
BRUKER = [
    ("Height Sensor", "Sens. ZsensSens", 0.000375, 5.966755, [0, 100, 200, 300, 5, 105, 205, 305]),
    ("Amplitude", "Sens. Amplitude", 0.0003, 19.6608, [7, 6, 5, 4, 7, 6, 5, 3]),
    ("Phase", "", 0.01, 655.36, [100, 200, 300, 400, 101, 201, 301, 401]),
]
SCALES = ("@Sens. ZsensSens: V 163.0064 nm/V", "@Sens. Amplitude: V 40 nm/V")
FORCE = ("@4:Ramp size: V [Sens. ZsensSens] (0.006713765 V/LSB) 0.5 V", "Spring Constant: 0.0612",
         "@Drive Frequency: V 71.5 kHz", "Tip Radius: 8")  # fmt: skip
SEGMENTS = [
    ("extend", {"vDeflection": [0, 10, 20], "height": [300, 200, 100], "lockInAmplitude": [5, 4, 3]}),
    ("retract", {"vDeflection": [20, 5], "height": [100, 200], "lockInAmplitude": [3, 5]}),
]


def exported(path, *, numbers=(1.0, 2.0, 4.0, 3.0), **options):
    """An HDF5 file of two curves with the attributes of afmformats."""
    with h5py.File(path, "w") as file:
        for k in range(2):
            group = file.create_group(str(k))
            group.attrs.update({"imaging mode": "force-distance", "spring constant": 0.05, "sensitivity": 6e-8})
            for name, unit, factor in (("force", "nN", 1.0), ("height (measured)", "m", 1e-7)):
                one = group.create_dataset(name, data=np.array(numbers) * factor * (k + 1), **options)
                one.attrs["unit"] = unit
    return path


def files(folder):
    """A good file of each kind, the columns to read, and factors."""
    made = {
        "c.spm": nanoscope(BRUKER, scanner=SCALES, force=FORCE),
        "c.jpk-force": jpk([SEGMENTS]),
        "c.jpk-force-map": jpk([SEGMENTS, SEGMENTS], index=True, shared=True),
        "c.ARDF": ardf([("Raw", "m"), ("Amp", "m")], [[[3e-8, 2e-8, 1e-8, 2e-8], [1e-8, 9e-9, 8e-9, 9e-9]]], note=NOTE),
        "c.gwy": gwyddion({"approach": ([3e-8, 2e-8], [0.0, 1e-9])}, [[1e-9, 2e-9], [3e-9, 4e-9]]),
    }
    for name, content in made.items():
        (folder / name).write_bytes(content)
    exported(folder / "c.h5")
    return {
        "c.spm": {"Zc_nm": "approach: ramp", "amplitude_nm": "approach: Amplitude"},
        "c.jpk-force": {"Zc_nm": "approach: height", "force_nN": "approach: vDeflection"},
        "c.jpk-force-map": {"Zc_nm": "approach: height #2", "force_nN": "approach: vDeflection #2"},
        "c.ARDF": {"Zc_nm": "approach: Raw", "amplitude_nm": "approach: Amp"},
        "c.gwy": {"Zc_nm": "FZ: approach: Z", "force_nN": "FZ: approach"},
        "c.h5": {"Zc_nm": "height (measured) #1", "force_nN": "force #1"},
    }


# numbers, units, constants


def test_a_force_curve_of_bruker_is_integer_times_hard_scale_times_sensitivity(tmp_path):
    """Bruker's own words: the factor of a height sensor is 163.0064 nm/V times 0.000375 V."""
    wanted = files(tmp_path)["c.spm"] | {"lag_deg": "approach: Phase"}
    wanted["Zc_nm"] = "approach: Height Sensor"
    table = afm.read_curve(tmp_path / "c.spm", wanted, scale={"lag_deg": 1.0})
    assert table["Zc_nm"].to_numpy() == pytest.approx(163.0064 * 0.000375 * np.array([0, 100, 200, 300]), rel=1e-15)
    assert table["amplitude_nm"].to_numpy() == pytest.approx(0.0003 * 40 * np.array([7, 6, 5, 4]), rel=1e-15)
    assert table["lag_deg"].to_numpy() == pytest.approx([1.0, 2.0, 3.0, 4.0])
    back = afm.read_curve(tmp_path / "c.spm", {"Zc_nm": "retract: ramp", "amplitude_nm": "retract: Amplitude"})
    assert back["Zc_nm"].to_numpy() == pytest.approx(0.5 * 163.0064 / 4 * np.arange(4))
    assert back["amplitude_nm"].iloc[-1] == pytest.approx(0.0003 * 40 * 3)


def test_constants_of_a_file_stay_with_its_curve(tmp_path):
    wanted = files(tmp_path)
    told = afm.read_curve(tmp_path / "c.spm", wanted["c.spm"]).attrs
    assert told["calibration"] == {"k_N_m": 0.0612, "R_nm": 8.0, "amplitude_invols_nm_V": 40.0, "f_kHz": 71.5}
    assert told["units"] == {"Zc_nm": "nm", "amplitude_nm": "nm"}
    assert told["columns"] == wanted["c.spm"]
    assert told["constants"]["Spring Constant"] == "0.0612"
    assert afm.read_curve(tmp_path / "c.jpk-force", wanted["c.jpk-force"]).attrs["calibration"] == {
        "k_N_m": 0.04, "invols_nm_V": 50.0}  # fmt: skip
    asylum = afm.read_curve(tmp_path / "c.ARDF", wanted["c.ARDF"]).attrs
    assert asylum["calibration"] == {"k_N_m": 2.5, "invols_nm_V": 45.0, "amplitude_invols_nm_V": 49.0,
                                     "f_kHz": 71.234, "Q": 150.0}  # fmt: skip
    assert "Other" not in asylum["constants"]
    assert afm.read_curve(tmp_path / "c.h5", wanted["c.h5"]).attrs["calibration"] == {
        "k_N_m": 0.05,
        "invols_nm_V": 60.0,
    }


def test_integers_of_32_bits_need_a_scale_that_agrees_with_the_range(tmp_path):
    """A bracket of 16 or 32 bits is understood; where neither agrees with the hard value, no unit is told."""
    for scale, value, unit, expected in (
        (0.000375, 24.576, "nm", 24.576 / 2**32 * 1e6),
        (24.576 / 2**32, 24.576, "nm", 24.576 / 2**32 * 1e6),
        (0.000375, 5.966755, None, 1e6),
    ):
        stored = [1000000] * 8
        content = nanoscope([("Height", "Sens. A", scale, value, stored)], depth=4, scanner=["@Sens. A: V 1 nm/V"])
        (tmp_path / "c.pfc").write_bytes(content)
        column = afm.instrument_file(tmp_path / "c.pfc").columns[0]
        assert column.unit == unit
        assert column.lines[0][0] == pytest.approx(expected, rel=1e-9)


def test_a_force_volume_has_a_curve_for_each_of_its_places(tmp_path):
    stored = np.arange(24)
    scales = ["@Sens. A: V 2 nm/V", SCALES[0]]
    content = nanoscope([("Defl", "Sens. A", 1.0, 65536.0, stored)], scanner=scales, force=FORCE)
    (tmp_path / "c.000").write_bytes(content)
    columns = {one.name: one for one in afm.instrument_file(tmp_path / "c.000").columns}
    assert [line.tolist() for line in columns["retract: Defl"].lines] == [
        [8.0, 10.0, 12.0, 14.0], [24.0, 26.0, 28.0, 30.0], [40.0, 42.0, 44.0, 46.0]]  # fmt: skip
    assert "ramp" in " ".join(columns)
    (tmp_path / "c.pfc").write_bytes(content)  # the piezo of a peak force capture goes along a sine
    assert "ramp" not in " ".join(one.name for one in afm.instrument_file(tmp_path / "c.pfc").columns)


@pytest.mark.parametrize("shared", [False, True])
def test_a_curve_of_jpk_goes_through_its_conversions(tmp_path, shared):
    (tmp_path / "c.jpk-force").write_bytes(jpk([SEGMENTS], shared=shared))
    wanted = {"Zc_nm": "approach: height", "force_nN": "approach: vDeflection",
              "deflection_nm": "approach: vDeflection (distance)"}  # fmt: skip
    table = afm.read_curve(tmp_path / "c.jpk-force", wanted)
    volts = 1e-4 * np.array([0, 10, 20]) + 0.5
    assert table["deflection_nm"].to_numpy() == pytest.approx(volts * 50.0, rel=1e-14)
    assert table["force_nN"].to_numpy() == pytest.approx(volts * 50.0 * 0.04, rel=1e-14)
    assert table["Zc_nm"].to_numpy() == pytest.approx(-1e3 * (1e-3 * np.array([300, 200, 100]) + 1.0), rel=1e-14)
    names = [one.name for one in afm.instrument_file(tmp_path / "c.jpk-force").columns]
    assert "retract: lockInAmplitude" in names
    assert "approach: vDeflection (volts)" in names


def test_a_curve_of_jpk_is_what_afmformats_has(tmp_path):
    """The package wants stiffness and sensitivity in each file, and knows force and height only."""
    from afmformats.formats.fmt_jpk import jpk_data as reading

    stored = {"vDeflection": np.arange(-40, 60), "height": np.arange(100) * 7}
    channels = {
        "vDeflection": (1e-4, 0.5, (("distance", 5e-8, "m"), ("force", 0.04, "N")), "force"),
        "height": (1e-3, 1.0, (("nominal", -1e-6, "m"), ("calibrated", 0.7, "m")), "calibrated"),
    }
    content = jpk([[("extend", stored), ("retract", stored)]], channels=channels)
    (tmp_path / "c.jpk-force").write_bytes(content)
    columns = {one.name: one.lines[0] for one in afm.instrument_file(tmp_path / "c.jpk-force").columns}
    with zipfile.ZipFile(tmp_path / "c.jpk-force") as archive:
        properties = dict(line.split("=", 1) for line in archive.read(
            "segments/0/segment-header.properties").decode().splitlines())  # fmt: skip
        numeric = {key: float(value) if "scaling." in key and "unit" not in key and "type" not in key else value
                   for key, value in properties.items()}  # fmt: skip
        for name, slot in (("vDeflection", "force"), ("height", "calibrated")):
            for conversion in ("force", "distance", "nominal", "calibrated"):
                numeric.setdefault(f"channel.{name}.conversion-set.conversion.{conversion}.name", conversion)
            with archive.open(f"segments/0/channels/{name}.dat") as stream:
                values, _, _ = reading.load_dat_unit(
                    stream, name=name, properties=numeric, slot=slot)  # fmt: skip
            np.testing.assert_allclose(columns[f"approach: {name}"], values, rtol=1e-14)


def test_a_map_of_jpk_keeps_the_lengths_of_its_curves(tmp_path):
    short = [("extend", {name: numbers[:2] for name, numbers in SEGMENTS[0][1].items()})]
    (tmp_path / "c.jpk-force-map").write_bytes(jpk([SEGMENTS, short], index=True, shared=True))
    column = afm.instrument_file(tmp_path / "c.jpk-force-map").columns[0]
    assert column.sizes == (3, 2)
    assert [len(line) for line in column.lines] == [3, 2]
    assert "2 curves of 2 to 3 points" in repr(afm.instrument_file(tmp_path / "c.jpk-force-map"))


def test_a_curve_of_an_ardf_file_has_its_ways(tmp_path):
    numbers = np.array([5.0, 4.0, 3.0, 2.0, 3.0, 4.0]) * 1e-9
    (tmp_path / "c.ardf").write_bytes(ardf([("ZSnsr", "m"), ("Amp", "m")], [[numbers, numbers * 2]] * 2, note=NOTE))
    columns = {one.name: one for one in afm.instrument_file(tmp_path / "c.ardf").columns}
    assert columns["retract: Amp"].lines[1] == pytest.approx([4e-9, 6e-9, 8e-9], rel=1e-6)
    assert columns["approach: ZSnsr"].sizes == (3, 3)
    assert len(columns["ZSnsr"].lines[0]) == 6
    (tmp_path / "c.ardf").write_bytes(ardf([("Amp", "m")], [[numbers]], turn=0))
    assert [one.name for one in afm.instrument_file(tmp_path / "c.ardf").columns] == ["Amp"]


def test_graphs_and_spectra_of_gwyddion_are_columns(tmp_path):
    files(tmp_path)
    found = afm.instrument_file(tmp_path / "c.gwy")
    columns = {one.name: one for one in found.columns}
    assert list(columns) == ["FZ: approach: Z", "FZ: approach", "Point: Z", "Point: F"]
    assert columns["Point: F"].lines[1].tolist() == [3e-9, 4e-9]
    assert columns["Point: Z"].lines[0] == pytest.approx([2.5e-8, 7.5e-8])  # the middles of two pixels of 50 nm
    assert (columns["Point: Z"].unit, columns["FZ: approach"].unit) == ("m", "N")
    assert found.constants == {"Operator": "A. N."}


def test_a_graph_that_gwyfile_wrote_is_read(tmp_path):
    from gwyfile import objects

    x, y = np.linspace(0.0, 1e-7, 5), np.arange(5) * 1e-9
    curve = objects.GwyObject("GwyGraphCurveModel", {"description": "down", "xdata": x, "ydata": y})
    units = {name: objects.GwySIUnit(unitstr="m") for name in ("x_unit", "y_unit")}
    model = objects.GwyObject("GwyGraphModel", {"title": "APD", "curves": [curve], **units}, {"curves": "O"})
    objects.GwyContainer({"/0/graph/graph/1": model}).tofile(str(tmp_path / "c.gwy"))
    table = afm.read_curve(tmp_path / "c.gwy", {"Zc_nm": "APD: down: x", "amplitude_nm": "APD: down"})
    assert table["Zc_nm"].to_numpy() == pytest.approx([0, 25, 50, 75, 100])
    assert table["amplitude_nm"].to_numpy() == pytest.approx(np.arange(5))


def test_groups_with_numbers_of_an_hdf5_file_are_curves(tmp_path):
    column = afm.instrument_file(exported(tmp_path / "c.hdf5")).columns[0]
    assert (column.name, column.unit) == ("force", "nN")
    assert [line.tolist() for line in column.lines] == [[1.0, 2.0, 4.0, 3.0], [2.0, 4.0, 8.0, 6.0]]


def test_the_ways_of_an_export_are_told_by_its_segments(tmp_path):
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["0/force"], file["0/segment"] = [1.0, 2.0, 3.0], np.array([0, 0, 1], dtype="u1")
        file["0/force"].attrs["unit"] = "nN"
    columns = {one.name: one.lines[0].tolist() for one in afm.instrument_file(tmp_path / "c.h5").columns}
    assert (columns["approach: force"], columns["retract: force"]) == ([1.0, 2.0], [3.0])


def test_what_a_file_holds_is_listed_with_units_points_and_constants(tmp_path):
    files(tmp_path)
    told = repr(afm.instrument_file(tmp_path / "c.spm"))
    assert "approach: Height Sensor  " in told
    assert "nm  4 points" in told
    assert "no unit" not in told
    assert "calibration" in told
    assert "k_N_m = 0.0612" in told


def test_a_curve_that_is_not_as_long_as_told_is_an_error():
    column = FileColumn("a", "m", Lines([3], lambda _: np.zeros(2)))
    assert FileContents("a file", (column,)).columns[0].sizes == (3,)
    with pytest.raises(ValueError, match="curve 1 has 2 points, and its header tells 3"):
        column.lines[0]


# refusals


@pytest.mark.parametrize("suffix", [".spm", ".pfc", ".jpk-force", ".ARDF", ".gwy", ".h5"])
@pytest.mark.parametrize(
    "content", [b"", b"Zc_nm,lag_deg\n1,2\n", bytes(range(256)) * 20], ids=["empty", "csv", "noise"]
)
def test_a_foreign_file_is_refused(tmp_path, suffix, content):
    (tmp_path / f"c{suffix}").write_bytes(content)
    with pytest.raises(InputError, match="it is another file, or a part is missing") as told:
        afm.instrument_file(tmp_path / f"c{suffix}")
    assert "\n" not in str(told.value)


def test_a_file_without_curves_is_refused(tmp_path):
    images = nanoscope([], start="File list")
    (tmp_path / "c.spm").write_bytes(images)
    (tmp_path / "c.gwy").write_bytes(gwyddion({}))
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file["image"] = np.zeros((3, 3))
    for name, told in (("c.spm", "images only"), ("c.gwy", "it has none"), ("c.h5", "in one dimension")):
        with pytest.raises(InputError, match=told):
            afm.instrument_file(tmp_path / name)


def test_a_text_file_is_no_file_of_an_instrument(tmp_path):
    with pytest.raises(InputError, match="a file of an instrument: .spm, .pfc.*read_curve reads text files"):
        afm.instrument_file(tmp_path / "c.csv")


def test_an_archive_that_unpacks_to_more_than_it_may_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "c.jpk-force", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("segments/0/segment-header.properties", b"#" * 2**21)
    with pytest.raises(InputError, match="has 2097152 bytes, more than 1048576"):
        afm.instrument_file(tmp_path / "c.jpk-force")


def test_a_dataset_that_is_not_stored_is_refused(tmp_path):
    for options, told in (({}, "stores 0"), ({"chunks": (1000,)}, "file stores 0")):
        with h5py.File(tmp_path / "c.h5", "w") as file:
            file.create_dataset("force", shape=(10**7,), dtype="f8", **options)
        with pytest.raises(InputError, match=told):
            afm.instrument_file(tmp_path / "c.h5")
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file.create_dataset("force", shape=(10**12,), dtype="f8", chunks=(1000,))
    with pytest.raises(InputError, match="8,000,000,000,000 bytes, more than"):
        afm.instrument_file(tmp_path / "c.h5")


def test_a_huge_file_is_refused_before_it_is_read(tmp_path):
    with open(tmp_path / "c.gwy", "wb") as file:
        file.truncate(2**30 + 1)  # a hole, which takes no disk
    tracemalloc.start()
    with pytest.raises(InputError, match="1,073,741,825 bytes, more than 1,073,741,824"):
        afm.instrument_file(tmp_path / "c.gwy")
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()


def _damaged(content, rng):
    """The content with a bit flipped, or with an end cut off."""
    if rng.random() < 0.3:
        return content[: rng.randrange(len(content))]
    place = rng.randrange(8 * len(content))
    bits = bytearray(content)
    bits[place // 8] ^= 1 << place % 8
    return bytes(bits)


def _read_all(path, columns):
    table = afm.read_curve(path, columns)
    assert len(table) > 0
    return table


def _spoilt(folder, count):
    """Read `count` damaged files of each kind; return how many were refused, by kind."""
    wanted, refused = files(folder), {}
    good = {name: _read_all(folder / name, columns) for name, columns in wanted.items()}
    tracemalloc.start()
    for name, columns in wanted.items():
        rng, content = random.Random(name), (folder / name).read_bytes()
        if name == "c.spm":
            content = content[:1200] + content[-64:]  # less padding: most of the bits mean something
            content = content.replace(b"offset: 40960", b"offset: 01200").replace(b"offset: 40976", b"offset: 01216")
            content = content.replace(b"offset: 40992", b"offset: 01232")
        for _ in range(count):
            (folder / f"bad-{name}").write_bytes(_damaged(content, rng))
            try:
                _read_all(folder / f"bad-{name}", columns)
            except InputError as error:
                refused.setdefault(name, []).append(str(error))
    assert tracemalloc.get_traced_memory()[1] < 2**24
    tracemalloc.stop()
    for name, columns in wanted.items():
        assert _read_all(folder / name, columns).equals(good[name])
    assert not any("\n" in told for lines in refused.values() for told in lines)
    return {name: len(lines) for name, lines in refused.items()}


def test_damaged_files_are_refused_in_a_line_and_take_no_memory(tmp_path):
    refused = _spoilt(tmp_path, 12)
    assert all(refused[name] > 2 for name in files(tmp_path))


@pytest.mark.campaign
def test_hundreds_of_damaged_files_of_each_kind_are_refused_or_read(tmp_path):
    usage = pytest.importorskip("resource")
    _spoilt(tmp_path, 1)
    before = usage.getrusage(usage.RUSAGE_SELF).ru_maxrss
    refused = _spoilt(tmp_path, 300)
    assert usage.getrusage(usage.RUSAGE_SELF).ru_maxrss - before < 2**15  # KiB
    least = dict.fromkeys(files(tmp_path), 75) | {
        "c.h5": 50,
        "c.ARDF": 250,
    }  # sums, but in an eighth of its bytes: names, unused entries
    assert {name: count for name, count in refused.items() if count < least[name]} == {}
