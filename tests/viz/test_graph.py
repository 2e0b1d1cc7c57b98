"""Pictures of relation graphs: parts stand above what they were put on, and files are what their names say."""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from pathlib import Path

import pytest

from apo_bench.assembly import Graph, relation_graph
from apo_bench.viz.graph_picture import draw_graph
from apo_bench.viz.graph.layout import Bend, layout_graph
from apo_bench.viz.graph_text import mermaid_text
from tests import rounds, scenes


def graph_of(name: str, step: int | None = None) -> Graph:
    return relation_graph(scenes.ALL[name]().assembly, step)


@pytest.mark.parametrize("name", scenes.ALL)
def test_arrows_lead_down_row_by_row_and_do_not_cross(name: str) -> None:
    for step in range(1, len(scenes.ALL[name]().assembly) + 1):
        graph = graph_of(name, step)
        layout = layout_graph(graph)
        links = [link for route in layout.routes for link in pairwise(route)]
        assert all(layout.row[a] == layout.row[b] + 1 for a, b in links)
        for arc, route in zip(graph.arcs, layout.routes, strict=True):
            assert (route[0], route[-1]) == (arc.manipulated, arc.environment)
            assert all(isinstance(item, Bend) for item in route[1:-1])
        above = [(layout.row[a], layout.column[a], layout.column[b]) for a, b in links if b != layout.ground]
        assert not any(r == s and (a - c) * (b - d) < 0 for (r, a, b), (s, c, d) in combinations(above, 2))
        places = [(layout.row[item], layout.column[item]) for item in layout.row]
        assert len(set(places)) == len(places) >= len(graph.nodes)


@pytest.mark.parametrize(("suffix", "head"), [(".png", b"\x89PNG"), (".svg", b"<?xml")])
def test_a_picture_is_written(suffix: str, head: bytes, tmp_path: Path) -> None:
    graph = graph_of("pockets", 6)
    paths = [tmp_path / f"{name}{suffix}" for name in ("one", "two", "other")]
    some = [None, *([2e-3] * 8)]
    for path, residuals in zip(paths, (some, some, [0.0] * 9), strict=True):
        draw_graph(graph, path, title="Fig. 7", residuals=residuals, gap_m=1e-4)
    one, two, other = (path.read_bytes() for path in paths)
    assert one.startswith(head)
    assert one == two
    assert one != other


@pytest.fixture
def readable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Letters of SVG files are text."""
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParamsDefault, "svg.fonttype", "none")


@pytest.mark.usefixtures("readable")
def test_words_are_in_the_picture(tmp_path: Path) -> None:
    draw_graph(graph_of("pockets", 6), tmp_path / "a.svg", title="Fig. 7", residuals=[None, *([2e-3] * 8)], gap_m=1e-4)
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    for words in ("Fig. 7", "cube3", "R9", "2.00 mm", "not seen", "dashed: disappeared; red: above 0.1 mm"):
        assert words in text
    assert text.count("#c8102e") >= 16


@pytest.mark.usefixtures("readable")
def test_arcs_with_an_axis_are_dash_dot(tmp_path: Path) -> None:
    for scene, said in ((rounds.through(), True), (scenes.stick_in_tower(), False)):
        graph = relation_graph(scene.assembly)
        assert {arc.name for arc in graph.arcs if arc.axial} == ({"R3", "R4"} if said else set())
        draw_graph(graph, tmp_path / "a.svg", title="graph")
        assert ("dash-dot: about an axis" in (tmp_path / "a.svg").read_text(encoding="utf-8")) is said


def test_what_no_longer_stands_is_dashed(tmp_path: Path) -> None:
    """Fig. 7: placements that parts have left, and contacts that are gone, have dashed outlines; nothing else has."""
    graph = graph_of("pockets", 6)
    draw_graph(graph, tmp_path / "a.svg", title="Fig. 7")
    styles = re.findall(
        r'style="(fill: #[0-9a-f]{6};[^"]*stroke: #[0-9a-f]{6}[^"]*)"', (tmp_path / "a.svg").read_text()
    )
    boxes = [style for style in styles if "stroke-linejoin: miter" in style]
    left = [style for style in boxes if "stroke: #8a8a8a" in style and "stroke-dasharray" in style]
    assert len(left) >= sum(not graph.stands(node) for node in graph.nodes) == 3


def test_mermaid_text_has_every_part_and_arc() -> None:
    lines = mermaid_text(graph_of("pockets", 6)).splitlines()
    graph = graph_of("pockets", 6)
    assert lines[0] == "flowchart TD"
    assert len(lines) == 1 + len(graph.nodes) + len(graph.arcs)
    assert sum("-.->" in line for line in lines) == sum(arc.lost is not None for arc in graph.arcs)
    assert any('["cube2<br>T6 T5^-1 T2"]' in line for line in lines)
