"""A picture of the finished assembly with arrows along the directions in which each part is still free."""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.correction.directions import Direction
from apo_bench.correction.explanation import Explanation, OperationExplanation
from apo_bench.geometry import Array, Solid, measure_extent
from apo_bench.io import add_the, group_by, join_words, save_figure, use_figure_style
from apo_bench.scenario import Scenario
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.scene import (
    Marks,
    ShiftArrows,
    TurnRing,
    aim_camera,
    build_scene,
    draw_picture,
    project_to_pixels,
)
from apo_bench.viz.dof_text import format_deviation
from apo_bench.viz.panels import Color, Panel, PanelLine, draw_panels

_SIZE = (900, 540)  # width and height, in pixels
_ARROW_M = 0.038  # length of an arrow
_AWAY_M = 0.006  # gap between a part and its arrows
_GRAY = (0.45, 0.45, 0.45)  # colour of parts for which the scenario states none
_AZIMUTH_DEG = 230.0  # of the camera, relative to the x axis of the first part
_ELEVATION_DEG = -33.0
_LOW = 0.3  # height of a ring on its part, as a share of the part's length along the axis
_SHADE = 0.8  # brightness of an arrow relative to the colour of its part


@use_figure_style()
def draw_dof(scenario: Scenario, observation: Observation, explanation: Explanation, out: str | Path) -> None:
    """Write a PNG picture, with a sentence for each part below it.

    Raises:
        InputError: This machine cannot render, or the file cannot be written.
    """
    own = {operation.part: operation for operation in explanation.operations}  # the last operation of each part
    poses = {**observation.start, **{part.part: part.pose for part in explanation.parts}}
    first = explanation.poses[0]
    azimuth = float(np.degrees(np.arctan2(first[1, 0], first[0, 0]))) + _AZIMUTH_DEG
    camera = aim_camera(*frame_parts(scenario.assembly, [poses], own), azimuth, _ELEVATION_DEG)
    # the horizontal direction towards the camera
    toward = -np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
    marks = []
    lines = []
    for part in explanation.parts:
        if part.part in own:
            solid = scenario.assembly.solids[part.part]
            color = scenario.colors.get(part.part, _GRAY)
            marks += [_make_mark(solid, part.pose, color, free.direction, toward) for free in own[part.part].free]
            lines.append(PanelLine(_describe_part(explanation, own[part.part]), color))
    scene = build_scene(scenario)
    image = draw_picture(scene, poses, *_SIZE, camera, Marks(marks))
    title = f"{scenario.name}: directions that no contact fixes: {explanation.freedom} of {6 * len(explanation.poses)}"
    figure = draw_panels(title, [Panel(image, lines)])
    for mark in marks:
        _write_name(
            figure.axes[0],
            mark,
            project_to_pixels(mark.tips, camera, float(scene.shown.model.vis.global_.fovy), *_SIZE),
        )
    save_figure(figure, out)


def _make_mark(solid: Solid, T: Array, color: Color, direction: Direction, toward: Array) -> Any:
    """Return the mark of a free direction: arrows outside the part for a shift, a ring for a turn.

    Args:
        T: Pose of the part, (4, 4), world, [m].
        direction: A shift or a turn, in the frame of the part.
        toward: Horizontal unit vector towards the camera, (3,), world.
    """
    R = T[:3, :3]
    at = T[:3, 3]
    r, g, b = (_SHADE * c for c in color)
    axis = R @ direction.axis
    low, high = measure_extent(solid.pieces, direction.axis)
    if not direction.turns:
        middle = solid.bounds.mean(axis=0)
        reach = high - direction.axis @ middle + _AWAY_M  # from the middle of the part to the tail of the arrow
        return ShiftArrows(R @ middle + at, axis, reach, reach + _ARROW_M, (r, g, b), str(direction))
    # the centre of the ring: on the axis of the turn, at the share _LOW of the part's extent along it
    about = direction.point + (_LOW * high + (1 - _LOW) * low - direction.point @ direction.axis) * direction.axis
    # two unit vectors perpendicular to the axis: the rows of V^T that span its null space
    across = np.linalg.svd(direction.axis[None])[2][1:]
    ends = np.array([measure_extent(solid.pieces, v) for v in across]) - (across @ about)[:, None]
    # outside the corner of the bounding box around the axis
    radius = float(np.linalg.norm(np.abs(ends).max(axis=1))) + 2 * _AWAY_M
    return TurnRing(R @ about + at, axis, toward, radius, (r, g, b), str(direction))


def _write_name(axes: Any, mark: Any, tips: Array) -> None:
    """Write the name of a mark at the lowest of its tips, (k, 2), pixels; the rightmost of equally low ones."""
    from matplotlib.patheffects import withStroke

    x, y = max(tips, key=lambda tip: (round(tip[1]), tip[0]))
    white = [withStroke(linewidth=3.5, foreground="white")]  # outline that keeps the letters legible
    look = {"color": tuple(0.75 * c for c in mark.color), "fontsize": 13, "weight": "bold", "path_effects": white}
    axes.text(x, y, mark.name, ha="center", va="center", **look)


def _describe_part(explanation: Explanation, o: OperationExplanation) -> str:
    """`castle1: x 1.00 mm free; y 0.58 mm, yaw 0.58 deg free with castle2 and the stick; z fixed`."""
    groups = []
    for along, words in group_by(
        (free.along, f"{free.direction} ({format_deviation(free)})") for free in o.free
    ).items():
        others = dict.fromkeys(add_the(explanation.operations[j].part) for j in along)
        groups.append(f"{join_words(words)} free{f' with {join_words(others)}' if others else ''}")
    if o.fixed:
        groups.append(f"{join_words(o.fixed)} fixed")
    return f"{o.part}: {'; '.join(groups)}"
