"""The free directions of every part, drawn as arrows on the finished assembly, with a sentence for each below."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Observation
from apo_bench.correction.directions import Direction
from apo_bench.correction.explanation import Explanation, OperationExplanation
from apo_bench.geometry import Array, Solid, extent, world_bounds
from apo_bench.io import default_looks, grouped, listed_words, save_figure, with_article
from apo_bench.scenario.scenario import Scenario
from apo_bench.show.axes import axis_marks
from apo_bench.show.explain_text import size
from apo_bench.simulation.scene import Marks, ShiftArrows, TurnRing, pixels

_WIDTH = 900
_HEIGHT = 540
_LINE_PX = 21
_ARROW_M = 0.038
_AWAY_M = 0.006
"""Length of an arrow, and how far from its part it begins."""
_GRAY = (0.45, 0.45, 0.45)
_NEAREST_M = 0.12
_AZIMUTH_DEG = 230.0
_ELEVATION_DEG = -33.0
_LOW = 0.3
"""How high on its part a ring lies, from its lower end along the axis."""
_SHADE = 0.8
"""Arrows are that much darker than their part."""


class _DrawnPart(NamedTuple):
    """A part, where it stands at the end, and what is free of the operation that last put it down by itself."""

    solid: Solid
    pose: Array
    color: tuple[float, float, float]
    operation: OperationExplanation


@default_looks()
def draw_explanation(scenario: Scenario, observation: Observation, explanation: Explanation, out: str | Path) -> None:
    """Write a PNG picture.

    Raises:
        InputError: There is nothing to draw with, or the file cannot be written.
    """
    from matplotlib.patheffects import withStroke

    from apo_bench.simulation.scene.render import camera_view, picture
    from apo_bench.simulation.scene.scene import build_scene

    own = {o.part: o for o in explanation.operations}
    drawn = [
        _DrawnPart(scenario.assembly.solids[of.part], of.pose, scenario.colors.get(of.part, _GRAY), own[of.part])
        for of in explanation.parts
        if of.part in own
    ]
    scene = build_scene(scenario)
    low, high = world_bounds((part.solid, part.pose) for part in drawn)
    azimuth = np.degrees(np.arctan2(explanation.goals[0][1, 0], explanation.goals[0][0, 0])) + _AZIMUTH_DEG
    middle = (low + high) / 2 - [0.0, 0.0, 0.1 * (high - low)[2]]
    camera = camera_view(middle, _NEAREST_M + float(np.linalg.norm(high - low)), azimuth, _ELEVATION_DEG)
    # the horizontal direction towards the camera
    toward = -np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
    marks = [_mark(part, free.direction, toward) for part in drawn for free in part.operation.free]
    poses = {**observation.start, **{part.part: part.pose for part in explanation.parts}}
    lines = axis_marks(
        scenario.assembly,
        [relation.contact for relation in scenario.assembly.relations() if relation.lost is None],
        poses,
    )
    image = picture(scene, poses, _WIDTH, _HEIGHT, camera, Marks([*marks, *lines]))
    fovy = float(scene.shown.model.vis.global_.fovy)
    figure = _captioned(image, scenario, explanation, drawn)
    for mark in marks:
        x, y = max(pixels(mark.tips, camera, fovy, _WIDTH, _HEIGHT), key=lambda tip: (round(tip[1]), tip[0]))
        figure.axes[0].text(
            x, y, mark.name, color=tuple(0.75 * c for c in mark.color), fontsize=13, weight="bold", ha="center",
            va="center", path_effects=[withStroke(linewidth=3.5, foreground="white")],
        )  # fmt: skip
    save_figure(figure, out)


def _mark(part: _DrawnPart, direction: Direction, toward: Array) -> Any:
    """Arrows outside the part; a ring about the point that a turn is about, or the middle where any point will do."""
    R = part.pose[:3, :3]
    middle = part.solid.bounds.mean(axis=0)
    r, g, b = (_SHADE * c for c in part.color)
    axis = R @ direction.axis
    if not direction.turns:
        reach = extent(part.solid.pieces, direction.axis)[1] - direction.axis @ middle
        return ShiftArrows(
            R @ middle + part.pose[:3, 3], axis, reach + _AWAY_M, reach + _AWAY_M + _ARROW_M, (r, g, b), str(direction)
        )
    low, high = extent(part.solid.pieces, direction.axis)
    # on the axis of the turn, at a part of the way from the lower end of the solid along it
    about = direction.point + (_LOW * high + (1 - _LOW) * low - direction.point @ direction.axis) * direction.axis
    # two unit vectors at right angles to the axis: rows of V^T that belong to no singular value
    across = np.linalg.svd(direction.axis[None])[2][1:]
    ends = np.array([extent(part.solid.pieces, v) for v in across]) - (across @ about)[:, None]
    radius = float(np.linalg.norm(np.abs(ends).max(axis=1))) + 2 * _AWAY_M
    return TurnRing(R @ about + part.pose[:3, 3], axis, toward, radius, (r, g, b), str(direction))


def _captioned(image: Any, scenario: Scenario, explanation: Explanation, drawn: list[_DrawnPart]) -> Any:
    """The picture with its title above and a line for each part below."""
    from matplotlib.figure import Figure

    below = _LINE_PX * (len(drawn) + 1)
    height = _HEIGHT + below + 30
    figure = Figure(figsize=(_WIDTH / 100, height / 100))
    axes = figure.add_axes((0.0, below / height, 1.0, _HEIGHT / height))
    axes.imshow(image)
    axes.axis("off")
    title = f"{scenario.name}: what no contact fixes ({explanation.freedom} of {6 * len(explanation.goals)} directions)"
    figure.text(0.5, 1.0 - 15 / height, title, ha="center", va="center", fontsize=12)
    for i, part in enumerate(drawn):
        y = (below - _LINE_PX * (i + 0.8)) / height
        figure.text(0.02, y, "\u25a0", color=part.color, fontsize=14, va="center")
        figure.text(0.045, y, _line(explanation, part.operation), va="center", fontsize=10)
    return figure


def _line(explanation: Explanation, o: OperationExplanation) -> str:
    """`castle1: x 1.00 mm free; y 0.58 mm, yaw 0.58 deg free with castle2 and the stick; the rest fixed`."""
    together = grouped((free.along, f"{free.direction} ({size(free)})") for free in o.free)
    groups = []
    for along, words in together.items():
        others = dict.fromkeys(with_article(explanation.operations[j].part) for j in along)
        groups.append(f"{listed_words(words)} free{f' with {listed_words(others)}' if others else ''}")
    return f"{o.part}: {'; '.join([*groups, f'{listed_words(o.fixed)} fixed'] if o.fixed else groups)}"
