"""Write a trial as a film with captions: the parts in the large picture, the whole table in the inset."""

import textwrap
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.simulation.film.caption import Caption, Picture, add_caption
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.film.track import FilmMoment, Segment
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.hooks import BY_HAND, TOUCHING
from apo_bench.simulation.scene import aim_camera, make_initial_state, place_for_picture, save_film

_LETTERS = 86  # in one line of a caption
_SIZE = (720, 480)  # of the large picture
_INSET = (192, 128)  # size of the inset
_SPEED = 2.0  # simulated seconds per second of film
_PACE = f"x {_SPEED:g}"
_FPS = 20.0  # of MP4
_GIF_FPS = 8.0  # fewer, for small files
_ENDING_S = 2.5  # duration of the last picture of a segment, with its outcome
_HEADROOM_M = 0.04  # visible space above the assembly
FILM_AZIMUTH_DEG = 128.0
FILM_ELEVATION_DEG = -24.0


def write_film(assembly: Assembly, assembled: Poses, segments: Sequence[Segment], path: str | Path) -> None:
    """Write segments one after the other as MP4 or GIF, by the ending of `path`.

    Args:
        assembled: Final poses of the parts, for the framing of the camera.

    Raises:
        InputError: Another ending, a path that cannot be written, or no graphics driver.
    """
    fps = _GIF_FPS if Path(path).suffix.lower() == ".gif" else _FPS
    timed = frames(assembly, assembled, segments, fps=fps)
    save_film((picture for picture, seconds in timed for _ in range(round(seconds * fps))), path, fps)


def frames(
    assembly: Assembly, assembled: Poses, segments: Sequence[Segment], fps: float = _FPS
) -> Iterator[tuple[Picture, float]]:
    """The pictures of a film in order, each with its duration, [s].

    Args:
        assembled: Final poses of the parts, for the framing of the camera.
    """
    for segment in segments:
        with ExitStack() as stack:
            views = []
            for size, states in ((_SIZE, [assembled]), (_INSET, [assembled, segment.start])):
                framing = frame_parts(assembly, states, headroom_m=_HEADROOM_M)
                camera = aim_camera(*framing, FILM_AZIMUTH_DEG, FILM_ELEVATION_DEG)
                views.append((stack.enter_context(renderer(segment.world.model, *size, shadow_texels=0)), camera))
            data = make_initial_state(segment.world, segment.start)
            for moment, force_n, most_n in sample_moments(segment.moments, _SPEED / fps):
                empty = moment.phase.macro in (BY_HAND, TOUCHING)
                force = "" if empty else f"force {force_n:.1f} N, most {most_n:.1f} N"
                caption = Caption(segment.title, _PACE, _lines(assembly, moment), force)
                yield _draw(segment, data, moment, views, caption), 1.0 / fps
            ending = tuple(textwrap.wrap(segment.ending, _LETTERS, max_lines=2, placeholder=" .."))
            caption = Caption(segment.title, _PACE, ending, good=segment.good)
            yield _draw(segment, data, segment.moments[-1], views, caption), _ENDING_S


def _draw(
    segment: Segment, data: Any, moment: FilmMoment, views: Sequence[tuple[Any, Any]], caption: Caption
) -> Picture:
    """The picture of one moment with inset and caption.

    Args:
        data: State of the segment's world, which is set to the moment.
        views: (renderer, camera) of the large picture and of the inset.
    """
    data.qpos[:] = moment.qpos
    if len(moment.hands):
        data.mocap_pos[:] = moment.hands
    place_for_picture(segment.world.model, data)
    pictures = []
    for draws, camera in views:
        draws.update_scene(data, camera=camera)
        pictures.append(draws.render())
    return add_caption(pictures[0], pictures[1], caption)


def sample_moments(moments: Sequence[FilmMoment], every_s: float) -> Iterator[tuple[FilmMoment, float, float]]:
    """Moments at intervals of `every_s`, always with the last one, each with its greatest forces.

    A guard stops a motion within one tick, so few sampled moments would show its force.

    Yields:
        (moment, greatest force since the moment before, greatest force since its operation began), [N].
    """
    at = -np.inf
    force = 0.0
    most = 0.0
    operation = moments[0].phase.operation
    for moment in moments:
        if moment.phase.operation != operation:
            operation = moment.phase.operation
            most = 0.0
        force = max(force, moment.phase.force_n)
        most = max(most, force)
        if moment.time_s >= at or moment is moments[-1]:
            yield moment, force, most
            at = moment.time_s + every_s - 1e-9
            force = 0.0


def operation_words(assembly: Assembly, moment: FilmMoment) -> str:
    """The operation of a moment in words: `operation 2 of 3, castle2: pick`."""
    k = moment.phase.operation
    if k is None:
        return "the closed hand touches what is fixed" if moment.phase.macro == TOUCHING else "at the start"
    operation = assembly.operations[k]
    carried = f" with {', '.join(operation.carries)}" if operation.carries else ""
    undone = " undone" * moment.phase.undoes  # empty unless true
    return f"operation {k + 1} of {len(assembly)}{undone}, {operation.main}{carried}: {moment.phase.macro}"


def _lines(assembly: Assembly, moment: FilmMoment) -> tuple[str, ...]:
    """The caption of a moment: its operation, and the contacts that this makes."""
    words = operation_words(assembly, moment)
    if moment.phase.operation is None:
        return (words,)
    contacts = "; ".join(map(str, assembly.operations[moment.phase.operation].contacts))
    return (words, textwrap.shorten(contacts, _LETTERS, placeholder=" .."))
