"""A trial as a film: demonstration, then replay, with captions; near the parts, and the whole table beside it."""

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from apo_bench.assembly import Assembly, Poses
from apo_bench.geometry import Array, world_bounds
from apo_bench.io import load_matplotlib
from apo_bench.simulation.film.still import Chapter, FilmMoment
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.hooks import BY_HAND, TOUCHING
from apo_bench.simulation.scene import camera_view, initial_state, place_for_picture, save_film

_Picture = NDArray[np.uint8]
ABOVE_PX = 32
BELOW_PX = 56
_EDGE_PX = 10
_LINE_PX = 22
_TEXT_PX = 15
_LETTERS = 86
"""In a line of the usual width; what is longer goes on in the next."""
_PAPER = (250, 250, 248)
_INK = (30, 30, 32)
_FAINT = (110, 110, 115)
_COLORS = {True: (20, 120, 50), False: (180, 30, 25), None: _INK}
_WIDTH = 720
_HEIGHT = 480
_INSET = (192, 128)
_SPEED = 2.0
_FPS = 20.0
_GIF_FPS = 8.0
_ENDING_S = 2.5
"""So long the end of a chapter stands still, with what came of it."""
FILM_AZIMUTH_DEG = 128.0
FILM_ELEVATION_DEG = -24.0
_NEAREST_M = 0.12
_FARTHER = 1.1
_ROOM_M = 0.04
"""How far the camera stands off: this and so many diagonals of what it looks at; room above it for what comes down."""


class Caption(NamedTuple):
    """What is written around one picture."""

    title: str
    pace: str
    """How fast it is shown: `real time`, `x 2`."""
    lines: tuple[str, ...]
    """Two below the picture at most."""
    force: str
    """Written at the right of the first of them."""
    good: bool | None = None
    """Colours the lines: a success, a failure, or neither."""


def ending_lines(sentence: str) -> tuple[str, ...]:
    """A sentence in two lines at most."""
    return tuple(textwrap.wrap(sentence, _LETTERS, max_lines=2, placeholder=" .."))


def shortened(words: str) -> str:
    """As many words as a line holds."""
    return textwrap.shorten(words, _LETTERS, placeholder=" ..")


def captioned(picture: _Picture, inset: _Picture, caption: Caption) -> _Picture:
    """A picture with a small one in its upper right corner, and words above and below."""
    height, width = picture.shape[:2]
    page = Image.new("RGB", (width, height + ABOVE_PX + BELOW_PX), _PAPER)
    page.paste(Image.fromarray(picture), (0, ABOVE_PX))
    framed = Image.new("RGB", (inset.shape[1] + 2, inset.shape[0] + 2), _INK)
    framed.paste(Image.fromarray(inset), (1, 1))
    page.paste(framed, (width - framed.width, ABOVE_PX))
    draw = ImageDraw.Draw(page)
    _write(draw, width, ABOVE_PX / 2, caption.title, caption.pace, _INK)
    for i, line in enumerate(caption.lines):
        color = _COLORS[caption.good] if i == 0 or caption.good is not None else _FAINT
        at = height + ABOVE_PX + BELOW_PX / 2 + _LINE_PX * (i - (len(caption.lines) - 1) / 2)
        _write(draw, width, at, line, "" if i else caption.force, color)
    return np.asarray(page)


def _write(draw: Any, width: int, at: float, left: str, right: str, color: tuple[int, int, int]) -> None:
    draw.text((_EDGE_PX, at), left, fill=color, font=_font(), anchor="lm")
    draw.text((width - _EDGE_PX, at), right, fill=color, font=_font(), anchor="rm")


@cache
def _font() -> Any:
    """The letters that come with matplotlib."""
    fonts = Path(load_matplotlib().get_data_path()) / "fonts" / "ttf"
    return ImageFont.truetype(str(fonts / "DejaVuSans.ttf"), _TEXT_PX)


def write_film(assembly: Assembly, assembled: Poses, chapters: Sequence[Chapter], path: str | Path) -> None:
    """Write chapters one after the other as MP4 or GIF, by the ending of `path`.

    Args:
        assembled: Where the parts are when all is done: the camera looks at them.

    Raises:
        InputError: Another ending, a place that cannot be written, or there is nothing to draw with.
    """
    fps = _GIF_FPS if Path(path).suffix.lower() == ".gif" else _FPS
    timed = frames(assembly, assembled, chapters, fps=fps)
    save_film((picture for picture, seconds in timed for _ in range(round(seconds * fps))), path, fps)


def frames(
    assembly: Assembly, assembled: Poses, chapters: Sequence[Chapter], speed: float = _SPEED, fps: float = _FPS
) -> Iterator[tuple[NDArray[np.uint8], float]]:
    """The pictures of a film one after the other, and how long each is shown, [s].

    Args:
        assembled: Where the parts are when all is done: the camera looks at them.
        speed: How many times as fast as it was it is shown; stated in the picture.
    """
    near = _looks_at(assembly, [assembled])
    for chapter in chapters:
        yield from _chapter(assembly, chapter, near, _looks_at(assembly, [assembled, chapter.start]), speed, fps)


def _chapter(
    assembly: Assembly, chapter: Chapter, near: Any, wide: Any, speed: float, fps: float
) -> Iterator[tuple[NDArray[np.uint8], float]]:
    data = initial_state(chapter.world, chapter.start)
    model = chapter.world.model
    pace = "real time" if speed == 1.0 else f"x {speed:g}"
    with ExitStack() as stack:
        large = stack.enter_context(renderer(model, _WIDTH, _HEIGHT))
        small = stack.enter_context(renderer(model, *_INSET))

        def drawn(moment: FilmMoment, caption: Caption) -> NDArray[np.uint8]:
            data.qpos[:] = moment.qpos
            if len(moment.hands):
                data.mocap_pos[:] = moment.hands
            place_for_picture(model, data)
            pictures = []
            for draws, camera in ((large, near), (small, wide)):
                draws.update_scene(data, camera=camera)
                draws.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False
                pictures.append(draws.render())
            return captioned(pictures[0], pictures[1], caption)

        for moment, force_n, most_n in sampled(chapter.moments, speed / fps):
            force = "" if moment.doing.macro in (BY_HAND, TOUCHING) else f"force {force_n:.1f} N, most {most_n:.1f} N"
            yield drawn(moment, Caption(chapter.title, pace, _lines(assembly, moment), force)), 1.0 / fps
        yield (
            drawn(chapter.moments[-1], Caption(chapter.title, pace, ending_lines(chapter.ending), "", chapter.good)),
            _ENDING_S,
        )


def sampled(moments: Sequence[FilmMoment], every_s: float) -> Iterator[tuple[FilmMoment, float, float]]:
    """Moments about so far apart in time, the last among them; each with the greatest force since the one before it and
    since its operation began, [N]: a guard stops a motion within a tick, which few pictures would meet."""
    at = -np.inf
    force = 0.0
    most = 0.0
    operation = moments[0].doing.operation
    for moment in moments:
        if moment.doing.operation != operation:
            operation = moment.doing.operation
            most = 0.0
        force = max(force, moment.doing.force_n)
        most = max(most, force)
        if moment.time_s >= at or moment is moments[-1]:
            yield moment, force, most
            at = moment.time_s + every_s - 1e-9
            force = 0.0


def operation_words(assembly: Assembly, moment: FilmMoment) -> str:
    """`operation 2 of 3, castle2: pick`."""
    k = moment.doing.operation
    if k is None:
        return "the closed hand touches what is fixed" if moment.doing.macro == TOUCHING else "at the start"
    operation = assembly.operations[k]
    carried = f" with {', '.join(operation.carries)}" if operation.carries else ""
    undone = " undone" * moment.doing.undoes
    return f"operation {k + 1} of {len(assembly)}{undone}, {operation.main}{carried}: {moment.doing.macro}"


def _lines(assembly: Assembly, moment: FilmMoment) -> tuple[str, ...]:
    words = operation_words(assembly, moment)
    if moment.doing.operation is None:
        return (words,)
    return (words, shortened("; ".join(map(str, assembly.operations[moment.doing.operation].contacts))))


def framing(assembly: Assembly, states: Sequence[Poses]) -> tuple[Array, float]:
    """What to look at, (3,), and from how far, [m], to see all parts that are ever moved, in these states."""
    posed = [(assembly.solids[p], poses[p]) for poses in states for p in assembly.solids if p not in assembly.fixed]
    low, high = world_bounds(posed)
    high = high + np.array([0.0, 0.0, _ROOM_M])
    return (low + high) / 2, _NEAREST_M + _FARTHER * float(np.linalg.norm(high - low))


def _looks_at(assembly: Assembly, states: Sequence[Poses]) -> Any:
    return camera_view(*framing(assembly, states), FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG)
