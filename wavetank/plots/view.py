"""Pictures of a run in three dimensions: stills, films, and a window; drawn by VTK, with or without a display.

The elevation is exaggerated; the factor is chosen from the waves and written on the picture. Without a display VTK
draws by EGL or OSMesa, in software where there is no graphics card.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from ctypes import CDLL
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv
from imageio_ffmpeg import write_frames
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.font_manager import findfont
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track
from vtkmodules.vtkCommonCore import VTK_FONT_FILE, vtkLogger

from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots.figures import draw_surface
from wavetank.plots.style import CM, WATER
from wavetank.plots.tank_scene import COVER, ELEVATION, HEIGHT, Array, Labels, TankView, tank_view

# ---------------------------------------------------------------- films
Pixels = NDArray[np.uint8]

SHORTEST = 4.0  # s; a shorter run is shown slower than it was
QUALITY = 7  # of an MP4, out of 10
PALETTE = 5  # frames of a GIF that its colours are chosen from


class FilmFormat(NamedTuple):
    """A kind of film file.

    Attributes
    ----------
    write
        Writes frames, each of shape (height, width, 3), to a path at a rate.
    size
        The default width and height [pixels].
    rate
        Frames a second.
    longest
        The default length of a film [s], if the run is not shorter.
    """

    write: Callable[[Path, Iterator[Pixels], float], None]
    size: tuple[int, int]
    rate: float
    longest: float

    def frames(self, duration: float) -> int:
        """Return the number of frames for a run of that duration [s], shown in its own time if that fits."""
        return round(self.rate * float(np.clip(duration, SHORTEST, self.longest))) + 1


def write_mp4(path: Path, frames: Iterator[Pixels], rate: float) -> None:
    """Write frames of even height and width as H.264."""
    first = next(frames)
    height, width, _ = first.shape
    file = write_frames(str(path), (width, height), fps=rate, quality=QUALITY, macro_block_size=2)
    file.send(None)
    for frame in chain([first], frames):
        file.send(np.ascontiguousarray(frame))
    file.close()


def write_gif(path: Path, frames: Iterator[Pixels], rate: float) -> None:
    """Write frames as a GIF that repeats, all in the same 256 colours, without which they would flicker."""
    images = list(frames)
    some = np.concatenate(images[:: -(-len(images) // PALETTE)])
    palette = Image.fromarray(some).quantize(256)
    first, *later = (Image.fromarray(image).quantize(palette=palette) for image in images)
    first.save(path, save_all=True, append_images=later, duration=1000 / rate, loop=0, optimize=True)


FORMATS = {
    ".mp4": FilmFormat(write_mp4, size=(1280, 720), rate=20.0, longest=10.0),
    ".gif": FilmFormat(write_gif, size=(800, 450), rate=12.5, longest=8.0),
}


# ---------------------------------------------------------------- pictures
Size = tuple[int, int]

STILL = (1600, 900)  # pixels
SMALLEST, LARGEST = 160, 8000  # pixels
SURFACE = LinearSegmentedColormap.from_list(
    "surface", ["#08204a", "#0f4c8a", "#2f86bd", "#7fc4dc", "#cdebf0", "#f2fbfc"]
)
SKY, HORIZON, INK = "#d5e3ef", "#ffffff", "#1c2b3a"
FONT = findfont("DejaVu Sans")  # of all pictures; a "t" of VTK's own font looks like a dagger
NAMED = 24  # gauges at most that have their names written
SHARP = 2.0  # times the usual largest elevation, at which colours end: one sharp crest must not bleach all other waves
ROD_OVER = 0.4  # of a gauge over the highest crest, over the height of the waves

VIEW_ANGLE = 16.0  # degrees, from low to high
TANK_SIZE = (0.95, 0.74)  # largest width and height of the tank over those of the picture
LOWERED = 0.06  # of half the picture's height: the tank's middle below the picture's, for the title's sake

# A low warm light from behind the paddle, and cool ones in front and above: still water keeps the colour of the bar.
LIGHTS = (((-0.75, 0.2, 0.45), 0.7, "#fff8ec"), ((0.6, -0.7, 0.45), 0.6, "#e2f1ff"), ((0.0, 0.0, 1.0), 0.38, "#ffffff"))
DRY: dict[str, Any] = {"ambient": 0.65, "diffuse": 0.5}
STYLES: dict[str, dict[str, Any]] = {  # of meshes, by the first word of their names
    "surface": {
        "scalars": ELEVATION,
        "cmap": SURFACE,
        "smooth_shading": True,
        "ambient": 0.38,
        "diffuse": 0.62,
        "specular": 0.2,
        "specular_power": 40,
    },
    "sides": {"scalars": HEIGHT, "cmap": WATER, "lighting": False},
    "paddle": {"color": "#d9762b", **DRY},
    "contours": {"color": "#ffc83d", "lighting": False},
    "sponge": {"scalars": COVER, "rgb": True, "lighting": False},
    "bed": {"color": "#cdb990", **DRY},
    "glass": {"color": "#9db4c4", "opacity": 0.22},
    "walls": {"color": "#c3ccd2", "culling": "front", **DRY},
    "island": {"color": "#a9b2b8", "smooth_shading": True, "split_sharp_edges": True, **DRY},
    "rulers": {"color": INK, "lighting": False},
    "gauges": {"color": "#d43d2a", "lighting": False},
}

HIGHEST, DEEPEST, STEEPEST = 0.12, 0.22, 2.0  # waves' height and depth as drawn over the extent, and slope, at most


# ---------------------------------------------------------------- files and windows
def still(run: RunDirectory, path: Path, *, t: float | None = None, size: Size = STILL) -> Path:
    """Draw a run at t [s], by default when its highest crest is there, as a PNG of ``size`` pixels; return ``path``.

    Raises ``InputError`` for a time outside the run, a size or a file that is refused, and as ``tank_view`` does.
    """
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: a still is written as .png alone.")
    tank = tank_view(run)
    shown = tank.waves.crest_time if t is None else t
    if not tank.times[0] <= shown <= tank.times[-1]:
        allowed = f"{tank.times[0]:g} to {tank.times[-1]:g} s, of which the run has snapshots"
        raise InputError(f"{run.path}: time {shown:g} s received; allowed is {allowed}.")
    with writing(path), closing(View(tank, _title(run), size=size)) as view:
        Image.fromarray(view.pixels(shown)).save(path)
    return path


def film(
    run: RunDirectory,
    path: Path,
    *,
    size: Size | None = None,
    frames: int | None = None,
    console: Console | None = None,
) -> Path:
    """Draw a run as a film, MP4 or GIF by the suffix of ``path``; return ``path``.

    Size [pixels] and number of frames are by default the format's: at most ten seconds, less than 10 MB. Progress is
    shown on ``console``.

    Raises ``InputError`` for another suffix, a run of a single snapshot, a size or a file that is refused, and as
    ``tank_view`` does.
    """
    if (suffix := path.suffix.lower()) not in FORMATS:
        raise InputError(f"{path}: a film of suffix {suffix!r} received; allowed are {', '.join(FORMATS)}.")
    form, tank = FORMATS[suffix], tank_view(run)
    if tank.times.size < 2:
        raise InputError(f"{run.path}: has 1 snapshot of the surface; at least 2 are needed for a film.")
    number = frames or form.frames(np.ptp(tank.times))
    times = [float(t) for t in np.linspace(tank.times[0], tank.times[-1], number)]
    progress = track(times, "film", console=console, transient=True, disable=console is None)
    with writing(path), closing(View(tank, _title(run), size=size or form.size)) as view:
        view.note_pace(form.rate * (times[1] - times[0]))
        form.write(path, (view.pixels(t) for t in progress), form.rate)
    return path


def window(run: RunDirectory, *, size: Size = STILL) -> None:
    """Show a run in a window, with a slider for the time, until it is closed.

    Raises ``InputError`` where there is no display, and as ``tank_view`` does.
    """
    tank = tank_view(run)
    with closing(View(tank, _title(run), size=size, off_screen=False)) as view:
        view.plotter.add_slider_widget(
            view.draw,
            (float(tank.times[0]), float(tank.times[-1])),
            value=tank.waves.crest_time,
            pointa=(0.40, 0.06),
            pointb=(0.97, 0.06),
            fmt="",  # the time is written in the picture
            color=INK,
            slider_width=0.02,
            tube_width=0.004,
            interaction_event="always",
        )
        view.plotter.show()


def diagram(run: RunDirectory) -> Path:
    """Draw the space-time diagram, or a basin's maps, into the run directory; return its path.

    Raises ``InputError`` for a run of less than two snapshots, and for a file that cannot be written.
    """
    with writing(run.path / "surface.png"):
        return draw_surface(run)


def _title(run: RunDirectory) -> str:
    return run.title or run.path.resolve().name


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Make sure that a file can be written before work is put into it; raise ``InputError`` if it cannot, or then.

    It replaces a hard link: the file keeps its content under its other name.
    """
    new = not path.exists()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_file() and path.stat().st_nlink > 1:
            path.unlink()
        path.open("ab").close()
        yield
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}).") from None
    finally:
        if new and path.is_file() and not path.stat().st_size:
            path.unlink()


# ---------------------------------------------------------------- the picture
class View:
    """A picture of a tank.

    Parameters
    ----------
    tank, title
        The meshes, and the title of the picture.
    size
        Width and height of the picture [pixels].
    off_screen
        Whether to draw into memory; else into a window.

    Raises ``InputError`` for a size that is too small or too large, and where nothing can be drawn.
    """

    def __init__(self, tank: TankView, title: str, *, size: Size, off_screen: bool = True):
        if not all(SMALLEST <= side <= LARGEST for side in size):
            raise InputError(f"size {size[0]}x{size[1]} received; allowed are {SMALLEST} to {LARGEST} pixels a side.")
        self.tank = tank
        self.exaggeration = exaggeration(tank)
        self._fixed = tank.fixed()
        self.plotter = _plotter(size, off_screen=off_screen)
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.set_background(HORIZON, top=SKY)
        self._pixel = max(size[1] / 900, 0.6)  # text is sized for 900 of them, and stays legible in small pictures
        self._line = 0.065 * 900 * self._pixel / size[1]
        self._limit = colour_limit(tank)
        self._aim()
        self._corner = self._free_corner()
        self._build(title)
        self.plotter.reset_camera_clipping_range()

    def draw(self, t: float) -> None:
        """Show the tank at t [s]."""
        limits: dict[str, dict[str, Any]] = {
            "surface": {"clim": (-self._limit, self._limit)},
            "sides": {"clim": (-self.tank.depth, self.tank.waves.high)},
            "contours": {"line_width": 2.2 * self._pixel},
        }
        for name, mesh in self.tank.at(t).items():
            self._add(name, mesh, **limits.get(name, {}))
        x, side = self._corner
        self._write("time", f"t = {t:.2f} s", (x, 0.97 - self._line), size=15, corner=(side, "top"))

    def pixels(self, t: float) -> Pixels:
        """Return the picture at t [s], shape (height, width, 3)."""
        self.draw(t)
        self.plotter.render()
        return np.asarray(self.plotter.screenshot(None, return_img=True), np.uint8)

    def place(self, points: Array) -> Array:
        """Return where points [m], shape (N, 3), are in the picture [pixels]: columns and rows, shape (N, 2)."""
        width, height = self.plotter.window_size
        matrix = self.plotter.camera.GetCompositeProjectionTransformMatrix(width / height, -1.0, 1.0)
        composite = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
        x, y, _, w = composite @ np.column_stack([self._drawn(points), np.ones(len(points))]).T
        return np.stack([(1 + x / w) / 2 * width, (1 - y / w) / 2 * height], axis=1)

    def note_pace(self, pace: float) -> None:
        """Write how many times faster than in the tank time passes, if it does not pass as there."""
        text = [f"vertical exaggeration {self.exaggeration:g}"]
        text += [f"{pace:.2g} times as fast"] * (abs(pace - 1) >= 0.02) + [self.tank.note] * bool(self.tank.note)
        self._write("note", ", ".join(text), (0.03, 0.035), size=12)

    def close(self) -> None:
        """Give the memory back."""
        self.plotter.close()

    # ------------------------------------------------------------ how it is built
    def _build(self, title: str) -> None:
        """Set what does not move, and the first snapshot."""
        for place, strength, colour in LIGHTS:
            light = pv.Light(position=place, focal_point=(0, 0, 0), intensity=strength, color=colour)
            self.plotter.add_light(light)
        for name, mesh in self._fixed.items():
            self._add(name, mesh)
        self.draw(float(self.tank.times[0]))
        size = 19 * min(1.0, 60 / max(len(title), 1))
        x, side = self._corner
        self._write("title", title, (x, 0.97), size=size, corner=(side, "top"))
        self.note_pace(1.0)
        self._add_scalar_bar()
        self._add_marks()

    def _add(self, name: str, mesh: Any, **properties: Any) -> None:
        """Draw a mesh [m] in place of the one of that name."""
        drawn = mesh.copy()
        drawn.points = self._drawn(mesh.points)
        style = STYLES[name.split()[0]] | properties
        self.plotter.add_mesh(drawn, name=name, show_scalar_bar=False, reset_camera=False, render=False, **style)

    def _drawn(self, points: Array) -> Array:
        return np.asarray(points * (1.0, 1.0, self.exaggeration))

    def _write(
        self,
        name: str,
        text: str,
        place: tuple[float, float],
        *,
        size: float,
        corner: tuple[str, str] = ("left", "bottom"),
    ) -> None:
        """Write text with that corner at a place, over width and height, in place of the text of that name."""
        actor = self.plotter.add_text(
            text,
            position=place,
            viewport=True,
            font_size=size * self._pixel,
            font_file=FONT,
            color=INK,
            name=name,
            render=False,
        )
        actor.prop.justification_horizontal, actor.prop.justification_vertical = corner

    def _add_scalar_bar(self) -> None:
        waves = self.tank.waves
        highest = CM * max(waves.high, -waves.low)
        beyond = f", largest {highest:.2g}" * (highest > 1.05 * self._limit)
        line = min(self._line, 0.11)  # above the note, and below the tank in small pictures
        self._write("bar", ELEVATION + beyond, (0.03, 0.035 + 1.92 * line), size=12)
        self.plotter.add_scalar_bar(
            "",
            mapper=self.plotter.actors["surface"].mapper,
            n_labels=5,
            fmt="%g",
            color=INK,
            width=0.23,
            height=0.92 * line,
            position_x=0.03,
            position_y=0.035 + 0.92 * line,
            label_font_size=round(17 * self._pixel),
        )
        numbers = self.plotter.scalar_bar.GetLabelTextProperty()
        numbers.SetFontFamily(VTK_FONT_FILE)
        numbers.SetFontFile(FONT)

    def _add_marks(self) -> None:
        ruler = self.tank.ruler()
        self._add("rulers z", ruler.mesh)
        self._label("heights", ruler.labels, ("right", "center"))
        self._label("marks", self.tank.marks(), ("center", "top"))
        if gauges := self.tank.gauges().texts:
            self._add_gauges(gauges)

    def _add_gauges(self, names: Sequence[str]) -> None:
        """Draw each gauge as a rod in the water with its name; rows of very many as thin rods without."""
        rods, many = rods_of(self.tank), len(names) > NAMED
        self._add("gauges", rods, line_width=(1.0 if many else 2.6) * self._pixel)
        if many:
            return
        labels = Labels(rods.points[1::2], list(names))
        self._label("gauge names", labels, ("left", "bottom"), shape="rect", shape_color="white", margin=2)

    def _label(self, name: str, labels: Labels, justified: tuple[str, str], **properties: Any) -> None:
        """Write texts at places, that corner or side of each at its place; none on one written before."""
        across, up = justified
        shown = without_overlaps(
            self.place(labels.places), labels.texts, letter=12 * self._pixel, line=28 * self._pixel
        )
        self.plotter.add_point_labels(
            self._drawn(labels.places[shown]),
            [labels.texts[number] for number in shown],
            name=name,
            show_points=False,
            always_visible=True,
            font_size=round(17 * self._pixel),
            font_file=FONT,
            bold=False,
            text_color=INK,
            justification_horizontal=across,
            justification_vertical=up,
            reset_camera=False,
            render=False,
            **{"shape": None, **properties},
        )

    def _outline(self) -> Array:
        """Return points [m], shape (N, 3), between which the tank is at all times."""
        bed = self._fixed["bed"].points
        return np.concatenate([bed, bed * (1, 1, 0) + (0, 0, self.tank.waves.high)])

    def _aim(self) -> None:
        """Put the camera where the tank just fits into the picture at all times."""
        marks, ruler, rods = self.tank.marks().places, self.tank.ruler().reach, rods_of(self.tank).points
        corners = np.concatenate([self._outline(), marks, ruler, rods])
        azimuth, altitude, half = np.radians([*self.tank.eye, VIEW_ANGLE / 2])
        ahead = np.array([-np.sin(azimuth) * np.cos(altitude), np.cos(azimuth) * np.cos(altitude), -np.sin(altitude)])
        width, height = self.plotter.window_size
        eye, target = fitted(self._drawn(corners), ahead, tangents=(np.tan(half) * width / height, np.tan(half)))
        self.plotter.camera.view_angle = VIEW_ANGLE
        self.plotter.camera_position = [eye, target, (0, 0, 1)]
        self.plotter.camera.SetWindowCenter(0.0, LOWERED)

    def _free_corner(self) -> tuple[float, str]:
        """Return the upper corner with more space above the tank: its x over the picture's width, and its side."""
        width, _ = self.plotter.window_size
        columns, rows = self.place(self._outline()).T
        tops = [rows[side].min(initial=np.inf) for side in (columns < 0.35 * width, columns > 0.65 * width)]
        return (0.03, "left") if tops[0] > tops[1] else (0.97, "right")


def fitted(points: Array, ahead: Array, *, tangents: tuple[float, float]) -> tuple[Array, Array]:
    """Return the eye that looks along ``ahead`` and just sees all points, shape (N, 3), and the middle of its view.

    ``tangents`` are those of half the view's angles, across and up, of which the points fill ``TANK_SIZE``.
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


def without_overlaps(places: Array, texts: Sequence[str], *, letter: float, line: float) -> list[int]:
    """Return which of the texts at places [pixels], shape (K, 2), overlap none of those returned before."""
    shown: list[int] = []
    for number, (place, text) in enumerate(zip(places, texts, strict=True)):
        widths = (letter * (len(text) + len(texts[one])) / 2 for one in shown)
        if all((np.abs(place - places[one]) > (width, line)).any() for one, width in zip(shown, widths, strict=True)):
            shown.append(number)
    return shown


def rods_of(tank: TankView) -> pv.PolyData:
    """Return a vertical line [m] through the surface at each gauge, bottom and top by turns.

    Up to the highest crest, or, if they are to be named, above it.
    """
    places, waves = tank.gauges().places, tank.waves
    top = waves.high + (ROD_OVER if len(places) <= NAMED else 0.0) * (waves.high - waves.low)
    ends = np.stack([places + (0.0, 0.0, waves.low), places + (0.0, 0.0, top)], axis=1)
    return pv.line_segments_from_points(ends.reshape(-1, 3))


def exaggeration(tank: TankView) -> float:
    """Return how many times the elevation is drawn as high as it is, to one digit; never less than 1.

    Waves are to be seen, but neither as spikes nor on a block of water higher than it is long.
    """
    waves, tiny = tank.waves, np.finfo(float).tiny
    highest = HIGHEST * tank.extent / max(waves.high - waves.low, tiny)
    steepest = STEEPEST / max(waves.slope, tiny)
    return max(1.0, float(f"{min(highest, steepest, DEEPEST * tank.extent / tank.depth):.1g}"))


def colour_limit(tank: TankView) -> float:
    """Return the elevation [cm] at which colours end, to two digits: the largest, or twice the usual one if lower."""
    waves = tank.waves
    return float(f"{CM * min(max(waves.high, -waves.low, waves.usual), SHARP * waves.usual):.2g}")


# ---------------------------------------------------------------- where there is no display
WITHOUT_DISPLAY = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")


def _plotter(size: Size, *, off_screen: bool) -> pv.Plotter:
    """Return an empty picture, or window; raise ``InputError`` where there can be none."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # that VTK finds no display and goes on is no warning
    displays = not sys.platform.startswith("linux") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if not (displays or any(map(_loads, ("libEGL.so.1", "libOSMesa.so.8", "libOSMesa.so")))):
        # VTK would answer with a crash
        raise InputError(
            "to draw without a display EGL or OSMesa is needed; neither is here (Debian: package libegl1)."
        )
    plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), lighting="none")
    if not off_screen and plotter.render_window.GetClassName() in WITHOUT_DISPLAY:
        plotter.close()
        raise InputError("a window needs a display, and none can be reached; stills and films need none.")
    return plotter


def _loads(library: str) -> bool:
    with suppress(OSError):
        return bool(CDLL(library))
    return False
