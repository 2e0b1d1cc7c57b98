"""Axes of round contacts: where they are drawn, and which arcs of the graph have one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench.assembly import Contact, placements, relation_graph
from apo_bench.show.axes import axes_of
from apo_bench.show.graph.drawing import draw_graph
from tests import rounds, scenes


def standing(scene: scenes.Scene) -> tuple[list[Contact], dict[str, np.ndarray]]:
    poses = placements(scene.assembly, scene.start, scene.goals)[-1]
    return [relation.contact for relation in scene.assembly.relations()], dict(poses)


def test_axes_are_drawn_once_and_a_little_longer_than_their_faces() -> None:
    """A shaft through two plates is one line, along all of them."""
    scene = rounds.through()
    contacts, poses = standing(scene)
    (line,) = axes_of(scene.assembly, contacts, poses)
    ends = sorted([line.begin.tolist(), line.end.tolist()], key=lambda end: end[1])
    assert ends[0] == pytest.approx([0.0, -0.08, 0.03], abs=1e-9)
    assert ends[1] == pytest.approx([0.0, 0.08, 0.03], abs=1e-9)


def test_parts_that_are_seen_apart_have_an_axis_each() -> None:
    scene = rounds.peg_in_plate()
    contacts, poses = standing(scene)
    assert len(axes_of(scene.assembly, contacts, poses)) == 1
    assert len(axes_of(scene.assembly, contacts, poses | {"peg": scenes.mm(3, 0, 0)})) == 2
    assert len(axes_of(scene.assembly, contacts, poses | {"peg": scenes.mm(0, 0, 0, (3, 0, 0))})) == 2


def test_flat_faces_and_rims() -> None:
    for name, count in (("dovetail", 0), ("on_table", 1), ("on_rim", 1), ("countersink", 1)):
        scene = rounds.ALL[name]()
        found = axes_of(scene.assembly, *standing(scene))
        assert len(found) == count
        assert all(np.linalg.norm(line.end - line.begin) > 0.02 for line in found)


def test_arcs_with_an_axis_are_dash_dot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib

    for scene, said in ((rounds.through(), True), (scenes.stick_in_tower(), False)):
        graph = relation_graph(scene.assembly)
        assert {arc.name for arc in graph.arcs if arc.axial} == ({"R3", "R4"} if said else set())
        monkeypatch.setitem(matplotlib.rcParamsDefault, "svg.fonttype", "none")
        draw_graph(graph, tmp_path / "a.svg", title="graph")
        assert ("dash-dot: about an axis" in (tmp_path / "a.svg").read_text(encoding="utf-8")) is said
