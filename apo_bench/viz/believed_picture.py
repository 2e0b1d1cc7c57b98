"""What is believed after a step, drawn: the parts where the motion parameters put them (Fig. 9, 13 and 16)."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Observation, Operation, Poses, arc_residuals, placements, relation_graph
from apo_bench.geometry import Array
from apo_bench.io import default_looks, save_figure
from apo_bench.judging.contacts import face_overlap
from apo_bench.scenario.scenario import Scenario
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.scene import build_scene, camera_view, picture
from apo_bench.viz.panels import Panel, PanelLine, draw_panels

_SIZE = (620, 480)
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
    assembly = observation.assembly
    graph = relation_graph(assembly, step)
    residuals = arc_residuals(assembly, observation.start, goals, graph)
    poses = placements(assembly.first(step), observation.start, goals[:step])[-1]
    wrong = [
        f"{arc}: {1e3 * e:.2f} mm{' (disappeared)' * (arc.lost is not None)}"
        for e, arc in sorted(zip(residuals, graph.arcs, strict=True), key=lambda pair: -pair[0])
        if e > observation.gap_m
    ]
    standing = [arc for arc in graph.arcs if arc.lost is None]
    wrong += [
        f"{arc}: beside it"
        for arc in standing
        if any(face_overlap(assembly, contact, poses).area <= 0.0 for contact in arc.contacts)
    ]
    return BeliefPanel(title, poses, max(residuals, default=0.0), tuple(wrong), warning)


def belief_lines(beliefs: Sequence[BeliefPanel]) -> list[str]:
    """A sentence for each: `as seen: largest gap 4.71 mm; open: R3 stick -> castle1: 4.71 mm, ..`."""
    lines = []
    for belief in beliefs:
        held = f"open: {', '.join(belief.open)}" if belief.open else "all hold"
        parts = (f"{belief.title}: largest gap {1e3 * belief.gap_m:.3f} mm", held, belief.warning)
        lines.append("; ".join(filter(None, parts)))
    return lines


@default_looks()
def draw_beliefs(scenario: Scenario, step: int, beliefs: Sequence[BeliefPanel], out: str | Path) -> None:
    """Write the panels beside each other, from one point of view, as PNG.

    Raises:
        InputError: There is nothing to draw with, or the file cannot be written.
    """
    scene = build_scene(scenario)
    last = scenario.assembly.operations[step - 1]
    camera = _camera(scenario, beliefs[0].poses, last)
    panels = [Panel(picture(scene, b.poses, *_SIZE, camera), _below(b), b.title) for b in beliefs]
    save_figure(draw_panels(f"{scenario.name}, believed after operation {step}", panels), out)


def _below(belief: BeliefPanel) -> list[PanelLine]:
    """The lines below a panel."""
    lines = [f"every contact holds: largest gap {1e3 * belief.gap_m:.3f} mm"]
    if belief.open:
        lines = [f"contacts that do not hold: {belief.open[0]}", *belief.open[1 : _MOST_LINES - 1]]
    if len(belief.open) > len(lines):
        lines.append(f"and {len(belief.open) - len(lines)} more")
    return [PanelLine(text) for text in (*lines, *textwrap.wrap(belief.warning, _LETTERS))]


def _camera(scenario: Scenario, poses: Poses, last: Operation) -> Any:
    """One that sees what the last operation was about, obliquely to the assembly."""
    near = {*last.moves, *(contact.environment.part for contact in last.contacts)} - set(scenario.assembly.fixed)
    first = poses[scenario.assembly.operations[0].main]
    azimuth = np.degrees(np.arctan2(first[1, 0], first[0, 0])) + _AZIMUTH_DEG
    return camera_view(*frame_parts(scenario.assembly, [poses], near), azimuth, _ELEVATION_DEG)
