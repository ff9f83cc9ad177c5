"""Pictures of a run in three dimensions: stills and films, drawn by VTK, with or without a display.

The elevation is exaggerated by a factor that follows from the waves and is written on the picture. Without a display
VTK uses EGL or OSMesa, in software if there is no graphics card.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from ctypes.util import find_library
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyvista as pv
from imageio_ffmpeg import write_frames
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.font_manager import findfont
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track
from vtkmodules.vtkCommonCore import vtkLogger

from wavetank.base.errors import InputError, write_errors
from wavetank.output.directory import GAUGES, RunDirectory
from wavetank.output.files import atomic_file
from wavetank.plots.figures import draw_surface
from wavetank.plots.style import CM, WATER
from wavetank.plots.surfaces import Array, Indices, tank_surface, wave_history

Size = tuple[int, int]
Pixels = NDArray[np.uint8]

SHORTEST, LONGEST = 4.0, 10.0  # least and largest duration of a film [s]; shorter and longer runs change speed
FILMS = {".mp4": (20.0, (1280, 720)), ".gif": (12.5, (800, 450))}  # frames a second and size by suffix
QUALITY = 7  # quality of an MP4 film, at most 10
STILL = (1600, 900)  # pixels
SMALLEST, LARGEST = 160, 8000  # pixels
SURFACE = LinearSegmentedColormap.from_list(
    "surface", ["#08204a", "#0f4c8a", "#2f86bd", "#7fc4dc", "#cdebf0", "#f2fbfc"]
)
ELEVATION, HEIGHT = "elevation [cm]", "z [m]"  # names of point data
SKY, HORIZON, INK = "#d5e3ef", "#ffffff", "#1c2b3a"
FONT = findfont("DejaVu Sans")  # a "t" of VTK's own font looks like a dagger
MAX_LABELS = 24  # largest number of labelled gauges
COLOUR_RANGE = 2.0  # end of the colours over the usual largest elevation, against single sharp crests
SLAB, CONTOUR_HEIGHT = 0.1, 0.01  # thickness of the bed over the depth, contours over the wave height
SPONGE_COLOUR, OPACITY = (126, 87, 160), 150  # opacity of the strongest sponge, of 255
CAMERA_ANGLES = {True: (28.0, 36.0), False: (24.0, 27.0)}  # azimuth from the y axis, elevation [deg]: basin, flume
VIEW_ANGLE = 16.0  # vertical view angle [deg]
TANK_SIZE = (0.88, 0.70)  # largest width and height of the tank over those of the picture
HIGHEST, DEEPEST, STEEPEST = 0.12, 0.22, 2.0  # largest drawn wave height and depth over the extent, and largest slope
LOWEST, LOW, MOST = 0.008, 0.03, 1e6  # waves' height over the extent: raised below it, to it, at most so many times
# A low warm light from behind the paddle, and cool ones in front and above: still water keeps the colour of the bar.
LIGHTS = (((-0.75, 0.2, 0.45), 0.7, "#fff8ec"), ((0.6, -0.7, 0.45), 0.6, "#e2f1ff"), ((0.0, 0.0, 1.0), 0.38, "#ffffff"))
DRY: dict[str, Any] = {"ambient": 0.65, "diffuse": 0.5}
WATER_SURFACE: dict[str, Any] = {"smooth_shading": True, "ambient": 0.38, "diffuse": 0.62, "specular": 0.2}


# ---------------------------------------------------------------- files
def still(run: RunDirectory, path: Path, *, t: float | None = None, size: Size = STILL) -> Path:
    """Draw a run at t [s], by default the time of its highest crest, as a PNG of ``size`` pixels; return ``path``.

    Raises ``InputError`` for a time outside the run, an invalid size or file, and as ``tank_surface`` does.
    """
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: a still is written as .png alone.")
    with writing(path) as file, closing(View(run, size=size)) as view:
        times, shown = view.surface.times, view.history.crest_time if t is None else t
        if not times[0] <= shown <= times[-1]:
            allowed = f"{times[0]:g} to {times[-1]:g} s, of which the run has snapshots"
            raise InputError(f"{run.path}: time {shown:g} s received; allowed is {allowed}.")
        Image.fromarray(view.pixels(shown)).save(file, "png")
    return path


def film(run: RunDirectory, path: Path, *, size: Size | None = None, console: Console | None = None) -> Path:
    """Draw a run as a film, MP4 or GIF by the suffix of ``path``; return ``path``. Progress is shown on ``console``.

    Raises ``InputError`` for another suffix, a run of a single snapshot, an invalid size or file, and as
    ``tank_surface`` does.
    """
    if (suffix := path.suffix.lower()) not in FILMS:
        raise InputError(f"{path}: a film of suffix {suffix!r} received; allowed are {', '.join(FILMS)}.")
    rate, usual_size = FILMS[suffix]
    width, height = size or usual_size
    with writing(path) as file, closing(View(run, size=(width, height))) as view:
        begin, end = view.surface.times[[0, -1]]
        if begin == end:
            raise InputError(f"{run.path}: has 1 snapshot of the surface; at least 2 are needed for a film.")
        times = np.linspace(begin, end, round(rate * float(np.clip(end - begin, SHORTEST, LONGEST))) + 1)
        view.write_note(pace=rate * (times[1] - times[0]))
        progress = track(times, "film", console=console, transient=True, disable=console is None)
        frames = (view.pixels(float(t)) for t in progress)
        if suffix == ".gif":
            first, *later = map(Image.fromarray, frames)
            first.save(file, "gif", save_all=True, append_images=later, duration=1000 / rate, loop=0, optimize=True)
        else:
            stream = write_frames(file.name, (width, height), fps=rate, quality=QUALITY, macro_block_size=2)
            stream.send(None)
            for frame in frames:
                stream.send(np.ascontiguousarray(frame))
            stream.close()
    return path


def diagram(run: RunDirectory) -> Path:
    """Draw the space-time diagram, or the maps of a basin, into the run directory; return its path.

    Raises ``InputError`` for a run of fewer than two snapshots, and for a file that cannot be written.
    """
    with write_errors(run.path / "surface.png"):
        return draw_surface(run)


@contextmanager
def writing(path: Path) -> Iterator[BinaryIO]:
    """Yield a file that replaces the one at a path when complete; raise ``InputError`` if it cannot be written."""
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as file:
            yield file


# ---------------------------------------------------------------- the picture
class View:
    """A picture of a tank; raises ``InputError`` for a size [pixels] that is too small or too large.

    Attributes
    ----------
    surface, history
        The moving surface, and the sizes of its waves.
    plotter
        The picture.
    exaggeration
        Vertical exaggeration of the depth.
    of_elevation
        Vertical exaggeration of the elevation; larger for low waves.
    """

    def __init__(self, run: RunDirectory, *, size: Size):
        if not all(SMALLEST <= side <= LARGEST for side in size):
            raise InputError(f"size {size[0]}x{size[1]} received; allowed are {SMALLEST} to {LARGEST} pixels a side.")
        self.surface = surface = tank_surface(run)
        self.history = history = wave_history(surface)
        self._high, low = float(history.high.max()), float(history.low.min())
        self._waves_height = self._high - low
        self._top = self._high + 0.3 * self._waves_height  # of walls
        extent, depth = float(np.ptp(surface.first[:, :2], axis=0).max()), float(surface.depth.max())
        self.exaggeration = exaggeration(history, extent=extent, depth=depth)
        self.of_elevation = of_elevation(history, self.exaggeration, extent=extent)
        self._moving = surface.rim[surface.moving(history.displacement)]
        displays = sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
        if not (displays or find_library("EGL") or find_library("OSMesa")):  # VTK would crash
            raise InputError("to draw without a display EGL or OSMesa is needed (Debian: package libegl1).")
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # no warning if VTK finds no display and continues
        self.plotter = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.set_background(HORIZON, top=SKY)
        self._text_scale = max(size[1] / 900, 0.6)  # text stays legible in small pictures
        for place, strength, colour in LIGHTS:
            light = pv.Light(position=place, focal_point=(0, 0, 0), intensity=strength, color=colour)
            self.plotter.add_light(light)
        self._add_fixed(depth)
        self._add_gauges(run)
        self._limit = colour_limit(history)
        self._add_colours()
        self._write("title", run.title or run.path.resolve().name, "upper_left", 13)
        self.write_note()
        self.draw(float(surface.times[0]))
        self._add_axes(depth)
        self._place_camera(CAMERA_ANGLES[surface.basin])

    def draw(self, t: float) -> None:
        """Show the tank at t [s]."""
        points, surface = self.surface.at(t), self.surface
        water = pv.PolyData.from_regular_faces(points, surface.pieces)
        water[ELEVATION] = CM * points[:, 2]
        scale = {"clim": (-self._limit, self._limit), "cmap": SURFACE, "scalars": ELEVATION}
        self._add("surface", water, show_scalar_bar=False, **scale, **WATER_SURFACE)
        sides = curtain(points, surface.rim, -surface.depth, points[:, 2])
        sides[HEIGHT] = sides.points[:, 2]
        limits = (-float(surface.depth.max()), self._high)
        self._add("sides", sides, scalars=HEIGHT, cmap=WATER, clim=limits, lighting=False, show_scalar_bar=False)
        if len(self._moving):
            top = np.full(len(points), self._top)
            self._add("paddle", curtain(points, self._moving, -surface.depth, top), color="#d9762b", **DRY)
        above = (0.0, 0.0, CONTOUR_HEIGHT * self._waves_height)
        if surface.contours.size:
            water["depth"] = surface.depth
            lines = water.contour(surface.contours, scalars="depth")
            lines.points += above
            width = 2.2 * self._text_scale
            self._add("contours", lines, color="#ffc83d", lighting=False, line_width=width, show_scalar_bar=False)
        if surface.damping is not None:
            cover = pv.PolyData(water.points + above, water.faces)
            colour = np.tile(np.array([*SPONGE_COLOUR, 0], np.uint8), (cover.n_points, 1))
            colour[:, 3] = np.round(OPACITY * np.sqrt(surface.damping / surface.damping.max()))
            cover["colour"] = colour
            self._add("sponge", cover, scalars="colour", rgb=True, lighting=False)
        self._write("time", f"t = {t:.2f} s", "upper_right", 12)

    def pixels(self, t: float) -> Pixels:
        """Return the picture at t [s], shape (height, width, 3)."""
        self.draw(t)
        self.plotter.render()
        return np.asarray(self.plotter.screenshot(None, return_img=True), np.uint8)

    def write_note(self, pace: float = 1.0) -> None:
        """Write the exaggeration, depths of contours, and the time-lapse factor."""
        notes = [f"vertical exaggeration {self.exaggeration:g}"]
        if self.of_elevation > self.exaggeration:
            notes.append(f"of the elevation {self.of_elevation:g}")
        if abs(pace - 1) >= 0.02:
            notes.append(f"{pace:.2g} times as fast")
        if self.surface.contours.size:
            notes.append(f"lines of still-water depth {', '.join(f'{one:g}' for one in self.surface.contours)} m")
        if self.surface.damping is not None:
            notes.append("sponge: violet")
        self._write("note", ", ".join(notes), "lower_left", 9)

    def close(self) -> None:
        """Release the memory."""
        self.plotter.close()

    # ------------------------------------------------------------ how it is built
    def _drawn(self, z: Any) -> Any:
        """Return the drawn height of z [m]: the exaggeration of the elevation may exceed that of the depth."""
        low = min(float(self.history.low.min()), 0.0)
        return self.exaggeration * np.minimum(z - low, 0.0) + self.of_elevation * np.maximum(z, low)

    def _add(self, name: str, mesh: Any, **properties: Any) -> None:
        """Draw a mesh [m], exaggerated; it replaces the mesh of that name."""
        drawn = mesh.copy()
        drawn.points[:, 2] = self._drawn(mesh.points[:, 2])
        self.plotter.add_mesh(drawn, name=name, reset_camera=False, render=False, **properties)

    def _write(self, name: str, text: str, corner: str, size: float) -> None:
        size = round(size * self._text_scale)
        self.plotter.add_text(text, position=corner, font_size=size, font_file=FONT, color=INK, name=name, render=False)

    def _add_fixed(self, depth: float) -> None:
        """Draw the slab of the bed, and the fixed walls."""
        surface, rest = self.surface, self.surface.first
        low, top = np.full(len(rest), -(1 + SLAB) * depth), np.full(len(rest), self._top)
        bed = pv.PolyData.from_regular_faces(rest * (1, 1, 0) - np.outer(surface.depth, (0, 0, 1)), surface.pieces)
        self._add("bed", pv.merge([bed, curtain(rest, surface.rim, low, -surface.depth)]), color="#cdb990", **DRY)
        still_walls = surface.rim[~surface.moving(self.history.displacement)]
        walls = curtain(rest, still_walls, -surface.depth, top)
        self._add("walls", walls, color="#c3ccd2", culling="front", **DRY)

    def _add_gauges(self, run: RunDirectory) -> None:
        """Draw each gauge as a rod in the water, and a few labels."""
        if not (run.path / GAUGES).exists() or not run.gauges.sizes["gauge"]:
            return
        places = np.column_stack([run.gauges.x, run.gauges.y, 0.0 * run.gauges.x])
        few = len(places) <= MAX_LABELS
        foot, head = (0.0, 0.0, float(self.history.low.min())), (0.0, 0.0, self._high + 0.4 * few * self._waves_height)
        rods = pv.line_segments_from_points(np.stack([places + foot, places + head], axis=1).reshape(-1, 3))
        width = (2.6 if few else 1.0) * self._text_scale
        self._add("gauges", rods, color="#d43d2a", lighting=False, line_width=width)
        if few:
            style: dict[str, Any] = {"font_size": round(17 * self._text_scale), "font_file": FONT, "bold": False}
            style |= {"show_points": False, "always_visible": True, "text_color": INK, "shape_color": "white"}
            heads = (places + head) * (1, 1, self.of_elevation)
            self.plotter.add_point_labels(heads, list(run.gauges.gauge.values), reset_camera=False, **style)

    def _add_colours(self) -> None:
        """Draw the colour bar with its title above and numbers below, for any size of the picture."""
        scale, limit = self._text_scale, self._limit
        names = {"title": "", "n_labels": 0, "width": 0.25, "height": 0.05, "position_x": 0.03, "position_y": 0.11}
        table = pv.LookupTable(SURFACE, scalar_range=(-limit, limit))
        mapper = pv.DataSetMapper()
        mapper.lookup_table = table
        self.plotter.add_scalar_bar(mapper=mapper, render=False, **names)
        width, height = self.plotter.window_size
        for name, text, x, y in (
            ("title of colours", ELEVATION, 0.03, 0.17),
            ("least colour", f"{-limit:g}", 0.03, 0.065),
            ("largest colour", f"{limit:g}", 0.25, 0.065),
        ):
            place = (x * width, y * height)
            self.plotter.add_text(
                text, position=place, font_size=round(9 * scale), font_file=FONT, color=INK, name=name, render=False
            )

    def _add_axes(self, depth: float) -> None:
        """Draw axes with lengths [m] around the tank."""
        plan = np.round(self.surface.first[:, :2], 9)
        ends = np.column_stack([plan.min(axis=0), plan.max(axis=0)]).ravel()
        self.plotter.show_bounds(
            bounds=[*ends, self._drawn(-depth), 0.0],
            axes_ranges=[*ends, -depth, 0.0],
            show_yaxis=self.surface.basin,
            xtitle="x [m]",
            ytitle="y [m]",
            ztitle=HEIGHT,
            location="outer",
            ticks="outside",
            fmt="%.3g",
            bold=False,
            color=INK,
            font_size=round(14 * self._text_scale),
            n_zlabels=3,
            render=False,
        )

    def _place_camera(self, angles: tuple[float, float]) -> None:
        """Place the camera so that the tank fits into the picture."""
        azimuth, altitude, half = np.radians([*angles, VIEW_ANGLE / 2])
        ahead = np.array([-np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), -np.sin(altitude)])
        width, height = self.plotter.window_size
        corners = pv.Box(self.plotter.bounds).points
        eye, target = fitted(corners, ahead, tangents=(np.tan(half) * width / height, np.tan(half)))
        self.plotter.camera.view_angle = VIEW_ANGLE
        self.plotter.camera_position = [eye, target, (0, 0, 1)]
        self.plotter.reset_camera_clipping_range()


def curtain(points: Array, edges: Indices, low: Array, high: Array) -> pv.PolyData:
    """Return the vertical sheet along edges, shape (E, 2), of points [m], shape (N, 3), from z = low to high [m]."""
    foot, head = points.copy(), points.copy()
    foot[:, 2], head[:, 2] = low, high
    start, end = edges.T
    corners = np.stack([foot[start], foot[end], head[end], head[start]], axis=1)
    return pv.PolyData.from_regular_faces(corners.reshape(-1, 3), np.arange(4 * len(edges)).reshape(-1, 4))


def fitted(points: Array, ahead: Array, *, tangents: tuple[float, float]) -> tuple[Array, Array]:
    """Return the camera position for a direction ``ahead`` at which all points, shape (N, 3), fit, and its focal point.

    ``tangents`` are those of half the view angles, horizontal and vertical; the points fill ``TANK_SIZE`` of the view.
    """
    across = np.cross(ahead, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    axes, along, eye, back = (across, np.cross(across, ahead)), points @ ahead, np.zeros(3), []
    for axis, tangent in zip(axes, np.multiply(TANK_SIZE, tangents), strict=True):
        # each point within two planes through the eye: |axis.(point - eye)| <= tangent ahead.(point - eye)
        high, low = np.max(points @ axis - tangent * along), np.max(-points @ axis - tangent * along)
        eye += (high - low) / 2 * axis
        back.append(-(high + low) / (2 * tangent))
    eye += min(back) * ahead
    return eye, eye + (along.mean() - min(back)) * ahead


def exaggeration(history: Any, *, extent: float, depth: float) -> float:
    """Return the vertical exaggeration, one digit, at least 1.

    Waves are visible, but not spikes, and the water is not drawn higher than it is long; ``extent`` [m] is the larger
    horizontal size of the water.
    """
    tiny = np.finfo(float).tiny
    highest = HIGHEST * extent / max(float(np.max(history.high) - np.min(history.low)), tiny)
    steepest = STEEPEST / max(history.slope, tiny)
    return max(1.0, float(f"{min(highest, steepest, DEEPEST * extent / depth):.1g}"))


def of_elevation(history: Any, usual: float, *, extent: float) -> float:
    """Return how many times the elevation is drawn as high as it is: as usual, but more of waves too low to see."""
    height = max(float(np.max(history.high) - np.min(history.low)), np.finfo(float).tiny)
    if usual * height > LOWEST * extent:
        return usual
    return max(usual, float(f"{min(LOW * extent / height, STEEPEST / max(history.slope, 1e-300), MOST):.1g}"))


def colour_limit(history: Any) -> float:
    """Return the elevation [cm] at the ends of the colours, two digits: the largest, at most twice the usual one."""
    largest = max(float(np.max(history.high)), -float(np.min(history.low)), history.usual)
    return float(f"{CM * min(largest, COLOUR_RANGE * history.usual):.2g}")
