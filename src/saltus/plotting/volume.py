"""Pictures of basins in space: one basin as a solid body, rendered by PyVista, with axes by matplotlib."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import InputError, SaltusError, nearest
from saltus.plotting import style
from saltus.plotting.basin import colours_of, labelled_image, places_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.basins.map.basins import Basins

__all__ = ["Volume", "check_renderer"]

_BLOCKS = 200  # most blocks along an axis; the body of a finer grid is made of means over blocks of cells
_SMOOTHING = 0.7  # standard deviation of the Gaussian that smooths the body, in blocks
_CREASE = 40.0  # angle of an edge of the body, in degrees, from which on the edge is drawn sharp
_SLAB = 64  # cells along the first axis that are in memory at once

# Lengths in the units of the box [-1, 1]^3, or of the picture [-1, 1]^2.
_DISTANCE = 9.0  # distance of the camera from the middle of the box
_VIEW_ANGLE = 21.5  # opening angle of the camera, in degrees
_SPHERE = 0.045  # radius of the spheres at an attractor's points
_IN_FRONT = -1e7  # offset of a sphere's depth, in the renderer's least steps: in front of everything
_DARKER = 0.6  # share of the brightness of a basin's colour that its attractor keeps
_EDGE = 1.002  # half the side of the box whose edges are drawn, just outside the body's faces
_TICK = 0.045  # length of a tick outside the box
_TICK_LABEL = 0.16  # distance of a tick's label from the box
_NAME = 0.42  # distance of a coordinate's name from the box
_SHORT = 0.4  # length in the picture up to which an edge, seen nearly end on, has no ticks
_MARGIN = 0.06  # white margin of the picture

# Places of the lights as seen by the camera at azimuth 0 (to the right, away, upwards), each with its intensity.
_LIGHTS = (((0.3, -1.0, 2.0), 0.65), ((2.0, -1.0, 0.3), 0.25), ((-1.5, -2.0, 0.5), 0.5))


def check_renderer() -> None:
    """Raise an error where pictures in space cannot be rendered; call it before long work.

    Raises
    ------
    SaltusError
        PyVista is not installed, or on Linux there is neither a display nor EGL.
    """
    try:
        _pyvista()
    except ImportError:
        raise SaltusError('pictures in space need PyVista: pip install "saltus[3d]"') from None
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        from ctypes.util import find_library

        if find_library("EGL") is None:
            raise SaltusError(
                "pictures in space need EGL where there is no display: apt install libegl1 libgl1-mesa-dri"
            )
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")


def _pyvista() -> Any:
    return import_module("pyvista")


class Volume:
    """One basin of three free coordinates as a solid body, with the attractors and perhaps a section of all labels.

    The basin's share of the cells is averaged over blocks of cells and smoothed. The body's surface is where the share
    is a half. Threads and grains of the basin thinner than a block are lost. The section shows every cell.

    Parameters
    ----------
    basins : Basins
        Basins with three free coordinates.
    name : str
        Label of the basin that is drawn.
    cut : (str, float), optional
        A coordinate and a value at which the body is cut off. The section there shows all labels.
    hollow : bool, optional
        Whether the body is open at the sides of the box.
    colours : mapping of str to colour, optional
        Colours of labels by name, in place of the usual ones.
    marks : mapping of str to colour, optional
        Colours of the spheres at the attractors' points, by name; by default those of the basins, darker. Spheres are
        drawn in front of everything.

    Raises
    ------
    InputError
        Not three free coordinates, no label of the name, or no free coordinate and value to cut at.
    SaltusError
        Pictures in space cannot be rendered: see `check_renderer`.
    """

    def __init__(
        self,
        basins: Basins,
        name: str,
        *,
        cut: tuple[str, float] | None = None,
        hollow: bool = False,
        colours: Mapping[str, Any] | None = None,
        marks: Mapping[str, Any] | None = None,
    ) -> None:
        if len(basins.grid.names) != 3:
            names = ", ".join(basins.grid.names)
            raise InputError("free coordinates", names, "three for a picture in space", "basins.section fixes others")
        if name not in basins.attractors.labels:
            known = tuple(basins.attractors.labels)
            raise InputError("basin", name, f"one of {', '.join(known)}", nearest(name, known))
        check_renderer()
        self.basins, self.name, self.cut, self.hollow = basins, name, cut, hollow
        self.colours = colours_of(basins, colours)
        self.marks = {name: _darker(self.colours[name]) for name in basins.attractors.points} | dict(marks or {})
        self._section = None if cut is None else basins.section(**{cut[0]: cut[1]})

    @cached_property
    def body(self) -> Any:
        """The body as a mesh of PyVista in the box [-1, 1]."""
        from scipy.ndimage import gaussian_filter

        part = gaussian_filter(self._means(), _SMOOTHING, mode="nearest")
        part = np.pad(part, 1, mode="edge" if self.hollow else "constant")
        grid = _pyvista().ImageData(dimensions=part.shape)
        grid["part"] = part.ravel(order="F")
        mesh = grid.contour([0.5], "part", method="flying_edges", compute_normals=False, compute_scalars=False)
        for axis, count in enumerate(part.shape):
            ticks = np.arange(count, dtype=np.float64)
            mesh.points[:, axis] = np.interp(mesh.points[:, axis], ticks, self._nodes(axis))
        if self.cut is not None:
            normal = np.zeros(3)
            normal[self._cut_axis] = 1.0
            mesh = mesh.clip(normal, origin=normal * self._height)
        return mesh.compute_normals(feature_angle=_CREASE, split_vertices=True) if mesh.n_cells else mesh

    def _means(self) -> NDArray[np.float32]:
        """Return the basin's share of the cells of each block; labels are read slab by slab."""
        labels, byte = self.basins.labels, self.basins.attractors.labels[self.name]
        shape = self.basins.grid.shape
        side = self._side
        starts = [np.arange(0, count, side) for count in shape]
        sums = np.empty(tuple(map(len, starts)), np.float32)
        rows = side * max(_SLAB // side, 1)
        for first in range(0, shape[0], rows):
            slab = (np.asarray(labels[first : first + rows]) == byte).astype(np.float32)
            for axis in range(3):
                slab = np.add.reduceat(slab, np.arange(0, slab.shape[axis], side), axis=axis)
            sums[first // side : first // side + len(slab)] = slab
        sizes = [np.diff([*begin.tolist(), count]) for begin, count in zip(starts, shape, strict=True)]
        means: NDArray[np.float32] = sums / np.einsum("i,j,k->ijk", *sizes).astype(np.float32)
        return means

    @property
    def _side(self) -> int:
        return -(-max(self.basins.grid.shape) // _BLOCKS)

    def _nodes(self, axis: int) -> NDArray[np.float64]:
        """Return the middles of the blocks along an axis, with one mirrored at each end of the box."""
        count = self.basins.grid.shape[axis]
        edges = np.append(np.arange(0, count, self._side), count) * (2.0 / count) - 1.0
        middles = 0.5 * (edges[1:] + edges[:-1])
        return np.array([-2.0 - middles[0], *middles, 2.0 - middles[-1]])

    def _scaled(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return places, shape (place, 3), in coordinates of the box [-1, 1]."""
        low, high, _ = np.array(self.basins.grid.ranges).T
        scaled: NDArray[np.float64] = 2.0 * (places - low) / (high - low) - 1.0
        return scaled

    @property
    def _cut_axis(self) -> int:
        return self.basins.grid.names.index(self.cut[0]) if self.cut is not None else -1

    @property
    def _height(self) -> float:
        """Coordinate of the section in the box [-1, 1], at the middle of its cells."""
        if self.cut is None:
            return 1.0
        count = self.basins.grid.shape[self._cut_axis]
        index = self.basins.grid.nearest({self.cut[0]: self.cut[1]})[self.cut[0]]
        return 2.0 * (index + 0.5) / count - 1.0

    @cached_property
    def _plotter(self) -> Any:
        pyvista = _pyvista()
        plotter = pyvista.Plotter(off_screen=True, lighting="none")
        plotter.set_background("white")
        if self.body.n_cells:
            plotter.add_mesh(
                self.body,
                color=_rgb(self.colours[self.name]),
                smooth_shading=True,
                ambient=0.3,
                diffuse=0.75,
                specular=0.1,
            )
        if self._section is not None:
            self._add_section(plotter, self._section)
        for name in self.basins.attractors.points:
            for place in self._scaled(places_of(self.basins, name)[0]):
                self._add_sphere(plotter, name, place)
        box = pyvista.Box((-_EDGE, _EDGE) * 3).extract_all_edges()
        plotter.add_mesh(box, color="#404040", line_width=1.5, lighting=False)
        plotter.enable_anti_aliasing("ssaa")
        return plotter

    def _add_sphere(self, plotter: Any, name: str, place: NDArray[np.float64]) -> None:
        pyvista = _pyvista()
        sphere = pyvista.Sphere(radius=_SPHERE, center=tuple(place), theta_resolution=48, phi_resolution=48)
        actor = plotter.add_mesh(sphere, color=_rgb(self.marks[name]), smooth_shading=True, ambient=0.4, specular=0.4)
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, _IN_FRONT)

    def _add_section(self, plotter: Any, section: Basins) -> None:
        pyvista = _pyvista()
        image = labelled_image(np.asarray(section.labels[...], np.uint8).T, self.basins, self.colours)
        across = [axis for axis in range(3) if axis != self._cut_axis]
        corners = np.full((4, 3), self._height)
        for axis, values in zip(across, ((-1.0, 1.0, 1.0, -1.0), (-1.0, -1.0, 1.0, 1.0)), strict=True):
            corners[:, axis] = values
        plane = pyvista.PolyData(corners, faces=[4, 0, 1, 2, 3])
        plane.active_texture_coordinates = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], np.float32)
        texture = pyvista.Texture(np.ascontiguousarray(image[::-1]))
        texture.interpolate = False
        plotter.add_mesh(plane, texture=texture, lighting=False)
        plotter.add_mesh(pyvista.lines_from_points(corners[[0, 1, 2, 3, 0]]), color="black", line_width=4)

    def render(self, azimuth: float, elevation: float, pixels: int) -> NDArray[np.uint8]:
        """Return the picture without ticks and names, shape (pixels, pixels, 3).

        Parameters
        ----------
        azimuth, elevation : float, in degrees
            Direction of the camera.
        pixels : int
            Width and height of the picture.
        """
        pyvista = _pyvista()
        plotter = self._plotter
        plotter.window_size = [pixels, pixels]
        right, _, towards = _camera(azimuth, elevation)
        plotter.camera_position = [tuple(_DISTANCE * towards), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
        plotter.camera.view_angle = _VIEW_ANGLE
        plotter.renderer.reset_camera_clipping_range()
        plotter.remove_all_lights()
        away = np.cross(np.array([0.0, 0.0, 1.0]), right)
        for (x, y, z), intensity in _LIGHTS:
            place = x * right + y * away + z * np.array([0.0, 0.0, 1.0])
            plotter.add_light(pyvista.Light(position=tuple(place), intensity=intensity, light_type="scene light"))
        plotter.render()
        return np.asarray(plotter.screenshot(return_img=True))[..., :3]

    def draw(
        self,
        ax: Axes | None = None,
        *,
        azimuth: float = -58.0,
        elevation: float = 26.0,
        pixels: int = 1400,
        turning: bool = False,
        names: Mapping[str, str] | None = None,
    ) -> Axes:
        """Draw the body in its box with ticks and names of the coordinates, and return the matplotlib Axes.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; its previous content is removed. By default in a new figure.
        azimuth, elevation : float, in degrees
            Direction of the camera.
        pixels : int, optional
            Width and height of the rendered picture.
        turning : bool, optional
            Whether the picture has room for the box at every azimuth, as a film needs.
        names : mapping of str to str, optional
            Texts for the coordinates' names.
        """
        ax = style.axes(ax)
        ax.clear()
        picture = self.render(azimuth, elevation, pixels)
        ax.imshow(picture, extent=(-1.0, 1.0, -1.0, 1.0), interpolation="antialiased")
        ax.set_axis_off()
        for axis, name in enumerate(self.basins.grid.names):
            low, high, _ = self.basins.grid.ranges[axis]
            text = (names or {}).get(name, style.label_of(name))
            _draw_ticks(ax, _View(azimuth, elevation), axis, (low, high), text)
        views = [_View(turned, elevation) for turned in (np.arange(0.0, 360.0, 5.0) if turning else [azimuth])]
        reach = np.concatenate([view.reach() for view in views])
        (left, bottom), (right, top) = reach.min(axis=0) - _MARGIN, reach.max(axis=0) + _MARGIN
        ax.set(xlim=(left, right), ylim=(bottom, top), aspect="equal")
        return ax


def _rgb(colour: Any) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)


def _darker(colour: Any) -> tuple[float, ...]:
    return tuple(_DARKER * part for part in _rgb(colour))


def _camera(azimuth: float, elevation: float) -> tuple[NDArray[np.float64], ...]:
    """Return the unit vectors to the right and upwards in the picture, and from the box towards the camera."""
    a, e = np.radians([azimuth, elevation])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    return right, np.cross(towards, right), towards


@dataclass(frozen=True)
class _View:
    """Places in the picture of points of the box [-1, 1], and the edges of the box that have ticks."""

    azimuth: float
    elevation: float

    def of(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return places of points in the picture [-1, 1], to the right and upwards, shape (point, 2)."""
        right, up, towards = _camera(self.azimuth, self.elevation)
        depth = (_DISTANCE - points @ towards) * np.tan(np.radians(0.5 * _VIEW_ANGLE))
        places: NDArray[np.float64] = np.column_stack([points @ right, points @ up]) / depth[:, None]
        return places

    def edge(self, axis: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the middle of the edge that has an axis' ticks, and the direction out of the box there.

        Ticks are on the two lower edges next to the camera and on the leftmost upright edge.
        """
        near = np.where(_camera(self.azimuth, self.elevation)[2][:2] >= 0.0, 1.0, -1.0)
        if axis == 0:
            return np.array([0.0, near[1], -1.0]), np.array([0.0, near[1], 0.0])
        if axis == 1:
            return np.array([near[0], 0.0, -1.0]), np.array([near[0], 0.0, 0.0])
        corners = np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
        upright = corners[np.argmin(self.of(corners)[:, 0])]
        ways = np.array([[upright[0], 0.0, 0.0], [0.0, upright[1], 0.0]])
        return upright, ways[np.argmin(self.of(upright + ways)[:, 0])]

    def reach(self) -> NDArray[np.float64]:
        """Return places in the picture whose bounding rectangle holds the whole drawing."""
        places = [np.array(list(product((-1.0, 1.0), repeat=3)))]
        places += [(edge + _NAME * outward)[None] for edge, outward in map(self.edge, range(3))]
        return self.of(np.concatenate(places))


def _draw_ticks(ax: Axes, view: _View, axis: int, span: tuple[float, float], name: str) -> None:
    """Draw a coordinate's name at an edge of the box and, if the edge is long enough, ticks with their values."""
    from matplotlib.ticker import MaxNLocator

    low, high = span
    edge, outward = view.edge(axis)
    ((x, y),) = view.of((edge + _NAME * outward)[None])
    ax.text(x, y, name, ha="center", va="center")
    along = np.eye(3)[axis]
    if np.linalg.norm(np.diff(view.of(np.array([edge - along, edge + along])), axis=0)) < _SHORT:
        return
    values = [v for v in MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high) if low <= v <= high]
    for value in values:
        place = edge + along * (2.0 * (value - low) / (high - low) - 1.0)
        ends = view.of(np.array([place, place + _TICK * outward, place + _TICK_LABEL * outward]))
        ax.plot(*ends[:2].T, color="black", linewidth=0.7, solid_capstyle="butt")
        ax.text(
            ends[2, 0],
            ends[2, 1],
            f"{value:g}".replace("-", "\N{MINUS SIGN}"),
            ha="center",
            va="center",
            fontsize="small",
        )
