"""Files of instruments, written byte by byte after what is published of their formats, for tests of their readers."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib

import numpy as np


def nanoscope(channels, counts=(4, 4), *, depth=2, start="Force file list", scanner=(), force=("Ramp size: 100",)):
    r"""A force file of NanoScope: `channels` are (name, soft scale, hard scale, hard value, integers)."""
    lines = [f"\\*{start}", "\\Version: 0x09400202", "\\*Scanner list", *(f"\\{one}" for one in scanner)]
    lines += ["\\*Ciao force list", *(f"\\{one}" for one in force)]
    content, place = b"", 40960
    for name, soft, scale, value, stored in channels:
        data = np.asarray(stored, dtype=f"<i{depth}").tobytes()
        lines += ["\\*Ciao force image list", f"\\Data offset: {place + len(content)}", f"\\Data length: {len(data)}"]
        lines += [f"\\Bytes/pixel: {depth}", f"\\Samps/line: {' '.join(map(str, counts))}"]
        lines += [f'\\@4:Image Data: S [{name}] "{name}"', f"\\@4:Z scale: V [{soft}] ({scale} V/LSB) {value} V"]
        content += data
    head = ("\r\n".join([*lines, "\\*File list end", ""])).encode("latin-1") + b"\x1a"
    return head.ljust(place, b"\0") + content


def jpk(curves, *, channels=None, index=False, shared=False, extra=""):
    """An archive of JPK: `curves` are lists of segments, each a style and the integers of its channels."""
    channels = channels or {
        "vDeflection": (1e-4, 0.5, (("distance", 5e-8, "m"), ("force", 0.04, "N")), "force"),
        "height": (1e-3, 1.0, (("nominal", -1e-6, "m"),), "nominal"),
        "lockInAmplitude": (2e-4, 0.0, (), "volts"),
    }
    names = list(channels)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.properties", f"#a date\nfile-format-version=2.0\n{extra}")
        if shared:
            text = [_channel(f"lcd-info.{k}", *channels[name]) for k, name in enumerate(names)]
            archive.writestr("shared-data/header.properties", "\n".join(text))
        for i, segments in enumerate(curves):
            for j, (style, numbers) in enumerate(segments):
                folder = (f"index/{i}/" if index else "") + f"segments/{j}/"
                lines = [f"force-segment-header.settings.segment-settings.style={style}"]
                lines += [
                    f"channels.list={' '.join(names)}",
                    f"force-segment-header.num-points={len(numbers[names[0]])}",
                ]
                for k, name in enumerate(names):
                    lines.append(f"channel.{name}.data.file.name=channels/{name}.dat")
                    lines.append(
                        f"channel.{name}.lcd-info.*={k}" if shared else _channel(f"channel.{name}", *channels[name])
                    )
                    kind = ">i4" if shared else ">i2"
                    archive.writestr(f"{folder}channels/{name}.dat", np.asarray(numbers[name], dtype=kind).tobytes())
                archive.writestr(f"{folder}segment-header.properties", "\n".join(lines))
    return stream.getvalue()


def _channel(start, factor, offset, conversions, shown):
    """Properties of a channel: V by its encoder, then conversions that follow each other."""
    encoder = f"{start}.encoder" if start.startswith("lcd") else f"{start}.data.encoder"
    lines = [f"{encoder}.type={'signedinteger' if start.startswith('lcd') else 'signedshort'}"]
    lines += [f"{encoder}.scaling.type=linear", f"{encoder}.scaling.multiplier={factor}"]
    lines += [f"{encoder}.scaling.offset={offset}", f"{encoder}.scaling.unit.unit=V"]
    lines += [f"{start}.conversion-set.conversions.base=volts", f"{start}.conversion-set.conversions.default={shown}"]
    lines.append(f"{start}.conversion-set.conversions.list={' '.join(name for name, _, _ in conversions)}")
    before = "volts"
    for name, multiplier, unit in conversions:
        one = f"{start}.conversion-set.conversion.{name}"
        lines += [f"{one}.defined=true", f"{one}.base-calibration-slot={before}", f"{one}.scaling.offset=0.0"]
        lines += [
            f"{one}.scaling.type=linear",
            f"{one}.scaling.multiplier={multiplier}",
            f"{one}.scaling.unit.unit={unit}",
        ]
        before = name
    return "\n".join(lines)


def _element(kind, content=b""):
    tail = struct.pack("<I4sI", 16 + len(content), kind, 0) + content
    return struct.pack("<I", zlib.crc32(tail)) + tail


def _table(kind, entries, size):
    """A table of contents with an entry that is not used."""
    return _element(kind, struct.pack("<QII", 0, len(entries) + 1, size)) + b"".join(entries) + bytes(size)


def ardf(channels, curves, *, note="", turn=None):
    """An .ARDF file: names and units of channels, and of each curve the numbers of each channel."""
    texts_at = 16 + 32 + 2 * 24 + 32 + 2 * 32
    text = _element(b"TEXT", struct.pack("<II", 0, len(note)) + note.encode("latin-1"))
    volume_at = texts_at + len(text)
    begin = _table(b"VOLM", [], 24) + _table(b"TTOC", [], 32)
    begin += _element(b"VDEF", struct.pack("<II", len(curves), 1) + bytes(188))
    begin += b"".join(_element(b"VCHN", struct.pack("<32s32s", *map(str.encode, one))) for one in channels)
    begin += _element(b"XDEF", struct.pack("<II", 0, 0))
    curves_at = volume_at + len(begin) + 32 + 2 * 40
    begin += _table(b"VTOC", [_element(b"VOFF", struct.pack("<IIQQ", 0, 0, 0, curves_at))], 40)
    body = b""
    for point, numbers in enumerate(curves):
        where = struct.pack("<III", point, 0, point)
        body += _element(b"VSET", where + struct.pack("<IQQ", 0, 0, 0))
        body += _element(b"VNAM", where + struct.pack("<I4s", 4, b"Line"))
        for k, values in enumerate(numbers):
            values = np.asarray(values, dtype="<f4")
            ways = (0, len(values) // 2 if turn is None else turn, len(values) - 1, 0, 0)
            head = where + struct.pack("<II5I", len(values), k, *ways)
            body += _element(b"VDAT", head + values.tobytes())
        body += _element(b"XDAT", where + struct.pack("<I", 0))
    first = _table(b"FTOC", [_element(b"VOLM", struct.pack("<Q", volume_at))], 24)
    first += _table(b"TTOC", [_element(b"TOFF", struct.pack("<QQ", 0, texts_at))], 32)
    return _element(b"ARDF") + first + text + begin + body + _element(b"MLOV")


def _word(text):
    return text.encode() + b"\0"


def _object(kind, **parts):
    """An object of Gwyddion: components by their names, in the type that the value has."""
    body = b""
    for name, value in parts.items():
        body += _word(name)
        if isinstance(value, bytes):
            body += b"o" + value
        elif isinstance(value, str):
            body += b"s" + _word(value)
        elif isinstance(value, int):
            body += b"i" + struct.pack("<i", value)
        elif isinstance(value, float):
            body += b"d" + struct.pack("<d", value)
        elif isinstance(value, list):
            body += b"O" + struct.pack("<I", len(value)) + b"".join(value)
        else:
            body += b"D" + struct.pack("<I", len(value)) + np.asarray(value, dtype="<f8").tobytes()
    return _word(kind) + struct.pack("<I", len(body)) + body


def gwyddion(curves, spectra=(), *, units=("m", "N")):
    """A file of Gwyddion: a graph with `curves`, as name: (x, y), and `spectra` of one range, 1e-7 m."""
    unit = {name: _object("GwySIUnit", unitstr=text) for name, text in zip("xy", units, strict=True)}
    drawn = [_object("GwyGraphCurveModel", description=name, xdata=np.asarray(x, float), ydata=np.asarray(y, float))
             for name, (x, y) in curves.items()]  # fmt: skip
    parts = {"/0/graph/graph/1": _object("GwyGraphModel", title="FZ", bottom_label="Z", x_unit=unit["x"],
                                         y_unit=unit["y"], curves=drawn)}  # fmt: skip
    if len(spectra):
        lines = [_object("GwyDataLine", res=len(one), real=1e-7, off=0.0, data=np.asarray(one, float),
                         si_unit_x=unit["x"], si_unit_y=unit["y"]) for one in spectra]  # fmt: skip
        parts["/sps/0"] = _object("GwySpectra", title="Point", spec_xlabel="Z", spec_ylabel="F", data=lines)
    parts["/0/meta"] = _object("GwyContainer", Operator="A. N.")
    return b"GWYP" + _object("GwyContainer", **parts)
