"""What is believed after a step, drawn: the parts where the motion parameters put them (Fig. 9, 13 and 16)."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Observation, Operation, Poses, arc_residuals, placements, relation_graph
from apo_bench.geometry import Array, world_bounds
from apo_bench.io import default_looks, listed_words, save_figure
from apo_bench.judging.contacts import face_overlap
from apo_bench.scenario.scenario import Scenario
from apo_bench.show.axes import axis_marks
from apo_bench.simulation.scene import camera_view, picture

_WIDTH = 620
_HEIGHT = 480
_LINE_PX = 20
_NEAREST_M = 0.08
_FARTHER = 0.95
_AZIMUTH_DEG = 28.0
_ELEVATION_DEG = -20.0
_MOST_LINES = 6
_LETTERS = 86


class BeliefPanel(NamedTuple):
    """A panel: where the motion parameters put the parts, and which contacts are not right then."""

    title: str
    poses: Poses
    gap_m: float
    """The largest |e| of all contacts."""
    open: tuple[str, ...]
    """`R4 stick -> castle2: 1.31 mm`, the worst first; then `R1 castle1 -> table: beside it`, of faces that stand and
    cover nothing of each other."""
    warning: str = ""
    """What else is wrong with it: what the test says, and the failure that is foretold."""


def belief_panel(title: str, observation: Observation, goals: Array, step: int, warning: str = "") -> BeliefPanel:
    """What goals (n, 4, 4), world frame, [m], mean after so many operations."""
    graph = relation_graph(observation.assembly, step)
    residuals = arc_residuals(observation.assembly, observation.start, goals, graph)
    wrong = tuple(
        f"{arc}: {1e3 * e:.2f} mm{' (disappeared)' * (arc.lost is not None)}"
        for e, arc in sorted(zip(residuals, graph.arcs, strict=True), key=lambda pair: -pair[0])
        if e > observation.gap_m
    )
    poses = placements(observation.assembly.first(step), observation.start, goals[:step])[-1]
    beside = tuple(
        f"{arc}: beside it"
        for arc in [arc for arc in graph.arcs if arc.lost is None]
        if any(face_overlap(observation.assembly, contact, poses).area <= 0.0 for contact in arc.contacts)
    )
    return BeliefPanel(title, poses, max(residuals, default=0.0), (*wrong, *beside), warning)


def belief_lines(beliefs: Sequence[BeliefPanel]) -> list[str]:
    """A sentence for each: `as seen: largest gap 4.71 mm; open: R3 stick -> castle1: 4.71 mm, ..`."""
    return [
        f"{b.title}: largest gap {1e3 * b.gap_m:.3f} mm; "
        + (f"open: {', '.join(b.open)}" if b.open else "all hold")
        + (f"; {b.warning}" if b.warning else "")
        for b in beliefs
    ]


@default_looks()
def draw_beliefs(scenario: Scenario, step: int, beliefs: Sequence[BeliefPanel], out: str | Path) -> None:
    """Write the panels beside each other, from one point of view, as PNG.

    Raises:
        InputError: There is nothing to draw with, or the file cannot be written.
    """
    from matplotlib.figure import Figure

    from apo_bench.simulation.scene.marks import Marks
    from apo_bench.simulation.scene.scene import build_scene

    scene = build_scene(scenario)
    last = scenario.assembly.operations[step - 1]
    camera = _camera(scenario, beliefs[0].poses, last)
    below = _LINE_PX * (max(len(_below(b)) for b in beliefs) + 1) + 8
    width = _WIDTH * len(beliefs)
    height = _HEIGHT + below + 56
    figure = Figure(figsize=(width / 100, height / 100))
    what = listed_words([str(k) for k in range(1, step + 1)]) if step < 3 else f"1 to {step}"
    figure.text(0.5, 1 - 16 / height, f"{scenario.name}, believed after {'operation' if step == 1 else 'operations'} "
                f"{what}", ha="center", va="center", fontsize=12)  # fmt: skip
    for i, belief in enumerate(beliefs):
        axes = figure.add_axes((i / len(beliefs), below / height, 1 / len(beliefs), _HEIGHT / height))
        marks = Marks(axis_marks(scenario.assembly, last.contacts, belief.poses))
        axes.imshow(picture(scene, belief.poses, _WIDTH, _HEIGHT, camera, marks))
        axes.axis("off")
        figure.text((i + 0.5) / len(beliefs), 1 - 42 / height, belief.title, ha="center", va="center", fontsize=11)
        for j, line in enumerate(_below(belief)):
            figure.text(
                (i + 0.03) / len(beliefs), (below - _LINE_PX * (j + 0.8)) / height, line, va="center", fontsize=9.5
            )
    save_figure(figure, out)


def _below(belief: BeliefPanel) -> list[str]:
    """The lines below a panel."""
    lines = [f"every contact holds: largest gap {1e3 * belief.gap_m:.3f} mm"]
    if belief.open:
        lines = [f"contacts that do not hold: {belief.open[0]}", *belief.open[1 : _MOST_LINES - 1]]
    left = len(belief.open) - len(lines)
    return [*lines, *[f"and {left} more"] * (left > 0), *textwrap.wrap(belief.warning, _LETTERS)]


def _camera(scenario: Scenario, poses: Poses, last: Operation) -> Any:
    """One that sees what the last operation was about, obliquely to the assembly."""
    near = {*last.moves, *(c.environment.part for c in last.contacts)} - set(scenario.assembly.fixed)
    low, high = world_bounds((scenario.assembly.solids[part], poses[part]) for part in near)
    first = poses[scenario.assembly.operations[0].main]
    azimuth = np.degrees(np.arctan2(first[1, 0], first[0, 0])) + _AZIMUTH_DEG
    return camera_view(
        (low + high) / 2, _NEAREST_M + _FARTHER * float(np.linalg.norm(high - low)), azimuth, _ELEVATION_DEG
    )
