"""Writers of films: GIF with one palette for all frames, and MP4 where its encoder is installed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError, SaltusError
from saltus.extras import check_installed
from saltus.files import whole_file
from saltus.plotting.style import check_matplotlib
from saltus.progress import Reporter

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure
    from numpy.typing import NDArray
    from PIL import Image

__all__ = ["checked_movie", "write_movie"]

_KINDS = (".gif", ".mp4")  # endings of a film's file

# Frames a second of a GIF, which counts hundredths of a second; browsers slow frames shorter than two of them.
_GIF_RATES = (1, 2, 4, 5, 10, 20, 25, 50)
_MP4_FASTEST = 120  # frames a second of an MP4, at most

_KEPT = 64  # colours of a GIF's palette that are kept exactly, the most frequent
_MIXED = 192  # colours of a GIF's palette that are mixed from all
_NEIGHBOURS = 8  # levels of a channel within which two colours are one
_SAMPLED = 8  # frames whose colours make the palette, about

_QUALITY = ["-crf", "18"]  # encoder's constant rate factor for H.264: 18 is visually lossless


def checked_movie(path: str | os.PathLike[str], fps: int) -> Path:
    """Return the checked path of a film; missing requirements raise before any work.

    Parameters
    ----------
    path : path-like
        A file that ends in ``.gif`` or ``.mp4``, in an existing folder.
    fps : int
        Frames a second.

    Raises
    ------
    InputError
        The path or the number of frames a second cannot be used.
    SaltusError
        An MP4 is asked for and its encoder is not installed.

    Examples
    --------
    >>> checked_movie("tap.gif", 25).name
    'tap.gif'
    >>> checked_movie("tap.png", 25)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: path = 'tap.png': must be a file whose name ends in .gif or .mp4
    """
    path = checks.path("path", path)
    check_matplotlib()
    check_installed("PIL")
    if path.suffix.lower() not in _KINDS:
        raise InputError("path", str(path), f"a file whose name ends in {' or '.join(_KINDS)}")
    if not path.parent.is_dir():
        raise InputError("path", str(path), "a file in a folder that exists")
    if path.is_dir():
        raise InputError("path", str(path), "a file", "it is a folder")
    rate = checks.count("fps", fps, 1, _MP4_FASTEST)
    if path.suffix.lower() == ".mp4":
        _ffmpeg()
    elif rate not in _GIF_RATES:
        raise InputError("fps", fps, f"one of {', '.join(map(str, _GIF_RATES))} for a GIF")
    return path


def write_movie(
    figure: Figure,
    path: Path,
    frames: Sequence[Callable[[], None]],
    *,
    fps: int,
    dpi: float,
    reporter: Reporter,
) -> None:
    """Write a film, frame by frame; an interrupt or an error leaves the folder as it was.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        What is filmed.
    path : Path
        As `checked_movie` returns it.
    frames : sequence of callable
        Each changes the figure to a frame; some are called twice, to choose a GIF's colours.
    fps : int
        Frames a second.
    dpi : float
        Pixels an inch of the figure.
    reporter : Reporter
        Reports each frame.
    """
    film = _Film(figure, frames, fps, dpi, reporter)
    with whole_file(path) as draft:
        film.write_mp4(draft) if path.suffix.lower() == ".mp4" else film.write_gif(draft)


@dataclass(frozen=True)
class _Film:
    """A film to be written, as `write_movie` takes it."""

    figure: Figure
    frames: Sequence[Callable[[], None]]
    fps: int
    dpi: float
    reporter: Reporter

    def write_mp4(self, path: Path) -> None:
        import matplotlib
        from matplotlib.animation import FFMpegWriter

        settings: dict[Any, Any] = {"animation.ffmpeg_path": _ffmpeg(), "savefig.bbox": None}
        with matplotlib.rc_context(settings):
            writer = FFMpegWriter(fps=self.fps, codec="h264", extra_args=_QUALITY)
            with writer.saving(self.figure, str(path), self.dpi):
                for show in self.frames:
                    show()
                    writer.grab_frame()
                    self.reporter.step(1, "frames")

    def write_gif(self, path: Path) -> None:
        """Write a GIF with one palette and no dithering: a third of the size, and no flicker of still parts."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from PIL import Image

        self.figure.set_dpi(self.dpi)
        canvas: Any = FigureCanvasAgg(self.figure)

        def picture(show: Callable[[], None]) -> Image.Image:
            show()
            canvas.draw()
            return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")

        palette = _palette([picture(show) for show in self.frames[:: math.ceil(len(self.frames) / _SAMPLED)]])
        pictures = []
        for show in self.frames:
            pictures.append(picture(show).quantize(palette=palette, dither=Image.Dither.NONE))
            self.reporter.step(1, "frames")
        first, *others = pictures
        first.save(path, save_all=True, append_images=others, duration=1000 // self.fps, loop=0, optimize=False)


def _palette(frames: Sequence[Image.Image]) -> Image.Image:
    """Return a picture whose palette serves all frames; frequent colours, like white, are kept exactly."""
    from PIL import Image

    pixels = np.concatenate([np.asarray(frame).reshape(-1, 3) for frame in frames])
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    mixed = Image.fromarray(pixels[None]).quantize(_MIXED).getpalette() or []
    found: list[NDArray[np.int64]] = []
    for colour in [*colours[np.argsort(-counts)[:_KEPT]].astype(int), *np.array(mixed).reshape(-1, 3)]:
        # Pillow takes neighbours for equal, and then not the nearest one
        if all(np.abs(colour - other).max() > _NEIGHBOURS for other in found):
            found.append(colour)
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate(found).tolist())
    return palette


def _ffmpeg() -> str:
    """Return the path of the encoder that imageio-ffmpeg brings."""
    try:
        found: str = import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except ImportError:
        raise SaltusError('MP4 needs an encoder: pip install "saltus[video]", or write a .gif') from None
    return found
