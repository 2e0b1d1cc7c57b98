"""The parts at observed or corrected poses after an operation, as text and as a picture (Fig. 9, 13 and 16)."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import (
    ContactMeasurements,
    Observation,
    Poses,
    build_relation_graph,
    compute_arc_residuals,
    compute_placements,
)
from apo_bench.geometry import Array
from apo_bench.io import save_figure, use_figure_style
from apo_bench.scenario import Scenario
from apo_bench.simulation.film.framing import frame_parts
from apo_bench.simulation.scene import aim_camera, build_scene, draw_picture
from apo_bench.viz.panels import Panel, PanelLine, draw_panels

_SIZE = (620, 480)  # width and height of each picture, in pixels
_AZIMUTH_DEG = 28.0
_ELEVATION_DEG = -20.0
_MOST_LINES = 6  # most lines about open contacts below a picture
_LETTERS = 86  # most letters in a line of a warning


class PosesPanel(NamedTuple):
    """The poses of parts after a step, and the contacts that do not hold there."""

    title: str
    poses: Poses
    gap_m: float
    """The largest residual |e| of all contacts, [m]."""
    open: tuple[str, ...]
    """Open contacts: `R4 stick -> castle2: 1.31 mm`, worst first, then `R1 castle1 -> table: no overlap`."""
    warning: str = ""
    """Result of the consistency test and the failure prediction; empty if there is none."""


def make_poses_panel(title: str, observation: Observation, poses: Array, step: int, warning: str = "") -> PosesPanel:
    """Place the parts and measure their contacts.

    Args:
        poses: Poses of the operations, (n, 4, 4), world, [m].
        step: Number of operations that are done.
    """
    assembly = observation.assembly
    graph = build_relation_graph(assembly, step)
    residuals = compute_arc_residuals(assembly, observation.start, poses, graph)
    placed = compute_placements(assembly.first(step), observation.start, poses[:step])[-1]
    wrong = []
    for e, arc in sorted(zip(residuals, graph.arcs, strict=True), key=lambda pair: -pair[0]):
        if e > observation.gap_m:
            wrong.append(f"{arc}: {1e3 * e:.2f} mm{' (disappeared)' * (arc.lost is not None)}")
    for arc in graph.arcs:
        common = ContactMeasurements(assembly).measure_overlaps((contact, placed) for contact in arc.contacts)
        if arc.lost is None and not all(common):
            wrong.append(f"{arc}: no overlap")
    return PosesPanel(title, placed, max(residuals, default=0.0), tuple(wrong), warning)


def format_poses(panels: Sequence[PosesPanel]) -> list[str]:
    """Return a sentence for each panel: `observed: largest gap 4.71 mm; open: R3 stick -> castle1: 4.71 mm, ..`."""
    lines = []
    for panel in panels:
        holds = f"open: {', '.join(panel.open)}" if panel.open else "all contacts hold"
        parts = (f"{panel.title}: largest gap {1e3 * panel.gap_m:.3f} mm", holds, panel.warning)
        lines.append("; ".join(filter(None, parts)))
    return lines


@use_figure_style()
def draw_poses(scenario: Scenario, step: int, panels: Sequence[PosesPanel], out: str | Path) -> None:
    """Write the panels side by side, from one point of view, as PNG.

    Raises:
        InputError: This machine cannot render, or the file cannot be written.
    """
    scene = build_scene(scenario)
    assembly = scenario.assembly
    # the camera looks obliquely at the parts of the last operation
    last = assembly.operations[step - 1]
    near = {*last.moves, *(contact.environment.part for contact in last.contacts)} - set(assembly.fixed)
    first = panels[0].poses[assembly.operations[0].main]
    azimuth = np.degrees(np.arctan2(first[1, 0], first[0, 0])) + _AZIMUTH_DEG
    camera = aim_camera(*frame_parts(assembly, [panels[0].poses], near), azimuth, _ELEVATION_DEG)
    drawn = [Panel(draw_picture(scene, p.poses, *_SIZE, camera), _list_lines_below(p), p.title) for p in panels]
    save_figure(draw_panels(f"{scenario.name} after operation {step}", drawn), out)


def _list_lines_below(panel: PosesPanel) -> list[PanelLine]:
    """Return the lines below a picture: at most `_MOST_LINES` open contacts, then the warning."""
    lines = [f"all contacts hold: largest gap {1e3 * panel.gap_m:.3f} mm"]
    if panel.open:
        lines = [f"contacts that do not hold: {panel.open[0]}", *panel.open[1 : _MOST_LINES - 1]]
    if len(panel.open) > len(lines):
        lines.append(f"and {len(panel.open) - len(lines)} more")
    return [PanelLine(text) for text in (*lines, *textwrap.wrap(panel.warning, _LETTERS))]
