"""Film files: what a format holds, how frames are written into it, and how far that is."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np
from imageio_ffmpeg import write_frames
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.progress import track

from wavetank.errors import InputError

Pixels = NDArray[np.uint8]

SHORTEST = 4.0  # s; a shorter run is shown slower than it was
QUALITY = 7  # of an MP4, out of 10
PALETTE = 5  # frames of a GIF that its colours are chosen from
LINES = 10  # of progress where there is no terminal
Frame = TypeVar("Frame")


@dataclass(frozen=True)
class FilmFormat:
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
    """Write frames as a GIF that repeats, all in the same 256 colours: others from frame to frame would flicker."""
    images = list(frames)
    some = np.concatenate(images[:: -(-len(images) // PALETTE)])
    palette = Image.fromarray(some).quantize(256)
    first, *others = (Image.fromarray(image).quantize(palette=palette) for image in images)
    first.save(path, save_all=True, append_images=others, duration=1000 / rate, loop=0, optimize=True)


FORMATS = {
    ".mp4": FilmFormat(write_mp4, size=(1280, 720), rate=20.0, longest=10.0),
    ".gif": FilmFormat(write_gif, size=(800, 450), rate=12.5, longest=8.0),
}


def film_format(path: Path) -> FilmFormat:
    """Return the format of a film file; raise ``InputError`` for a suffix that is none of ``FORMATS``."""
    if (suffix := path.suffix.lower()) not in FORMATS:
        raise InputError(f"{path}: a film of suffix {suffix!r} received; allowed are {', '.join(FORMATS)}.")
    return FORMATS[suffix]


def followed(frames: Sequence[Frame], console: Console) -> Iterable[Frame]:
    """Yield frames one by one, and show how far that is: a bar in a terminal, plain lines elsewhere."""
    if console.is_terminal:
        yield from track(frames, description="film", console=console, transient=True)
        return
    began, some = time.monotonic(), -(-len(frames) // LINES)
    for done, frame in enumerate(frames):
        if done % some == 0:
            left = f", {(time.monotonic() - began) * (len(frames) / done - 1):.0f} s left" if done else ""
            console.print(f"film: {done} of {len(frames)} frames{left}", highlight=False)
        yield frame
