"""Pictures of relation graphs: nothing lies on anything else, and files are what their names say."""

from __future__ import annotations

import re
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from apo_bench import Assembly
from apo_bench.assembly import Graph, Operation, relation_graph
from apo_bench.show.graph.drawing import draw_graph
from apo_bench.show.graph.layout import Links, Rectangle, arrange_layers, layout_graph, links_of, shared_area
from tests import scenes

CASES = [(name, step) for name in scenes.ALL for step in range(1, len(scenes.ALL[name]().assembly) + 1)]


def graph_of(name: str, step: int) -> Graph:
    return relation_graph(scenes.ALL[name]().assembly, step)


def crossings(links: Links, rows: tuple) -> int:
    """Pairs of links between the same rows whose ends stand in opposite order."""
    place = {item: (j, k) for j, row in enumerate(rows) for k, item in enumerate(row)}
    ends = [(place[a], place[b]) for a, b in links]
    return sum(
        a[0] == c[0] and b[0] == d[0] and (a[1] - c[1]) * (b[1] - d[1]) < 0 for (a, b), (c, d) in combinations(ends, 2)
    )


@pytest.mark.parametrize(("name", "step"), CASES)
def test_arrows_lead_down_and_do_not_cross(name: str, step: int) -> None:
    layers = arrange_layers(graph_of(name, step))
    row = {item: j for j, items in enumerate(layers.rows) for item in items}
    assert all(row[a] == row[b] + 1 for chain in layers.chains for a, b in pairwise(chain))
    assert crossings(links_of(layers.chains), layers.rows) == 0


@pytest.mark.parametrize(("name", "step"), CASES)
def test_nothing_lies_on_anything(name: str, step: int) -> None:
    graph = graph_of(name, step)
    layout = layout_graph(graph, [f"{arc.name}\n10.00 mm" for arc in graph.arcs])
    for a, b in combinations((*layout.boxes.values(), *layout.labels), 2):
        assert shared_area(a, b) == 0
    for i, route in enumerate(layout.routes):
        points = np.concatenate([a + np.linspace(0, 1, 100)[:, None] * (b - a) for a, b in pairwise(route)])
        for box in layout.boxes.values():
            assert not inside(box, points)
        for j, label in enumerate(layout.labels):
            assert inside(label, points) == (i == j)


def inside(box: Rectangle, points: np.ndarray) -> bool:
    half = np.array([box.width, box.height]) / 2 - 1e-6
    return bool((np.abs(points - [box.x, box.y]) < half).all(axis=1).any())


@pytest.mark.parametrize(("name", "step"), CASES)
def test_arrows_begin_and_end_at_their_parts(name: str, step: int) -> None:
    graph = graph_of(name, step)
    layout = layout_graph(graph, [arc.name for arc in graph.arcs])
    for arc, route in zip(graph.arcs, layout.routes, strict=True):
        above = layout.boxes[arc.manipulated]
        below = layout.boxes[arc.environment]
        assert abs(route[0, 0] - above.x) < above.width / 2
        assert abs(route[-1, 0] - below.x) < below.width / 2
        assert route[0, 1] == pytest.approx(above.y - above.height / 2)
        assert route[-1, 1] == pytest.approx(below.y + below.height / 2)


def test_many_parts_need_no_patience() -> None:
    """Ten sticks criss-cross on ten blocks: too many orders to try them all."""
    operations = [Operation(f"b{i}", scenes.touch(f"b{i}", "table", "nz-top")) for i in range(10)]
    operations += [
        Operation(f"s{i}", sum((scenes.touch(f"s{i}", f"b{j}", "nz-pz") for j in ((3 * i) % 10, (3 * i + 3) % 10)), ()))
        for i in range(9)
    ]
    parts = [scenes.table(), *(scenes.block(f"b{i}") for i in range(10)), *(scenes.stick(f"s{i}") for i in range(9))]
    assembly = Assembly({part.name: part for part in parts}, tuple(operations), frozenset({"table"}))
    layers = arrange_layers(relation_graph(assembly))
    assert crossings(links_of(layers.chains), layers.rows) == 0


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


def test_words_are_in_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib

    graph = graph_of("pockets", 6)
    monkeypatch.setitem(matplotlib.rcParamsDefault, "svg.fonttype", "none")
    draw_graph(graph, tmp_path / "a.svg", title="Fig. 7", residuals=[None, *([2e-3] * 8)], gap_m=1e-4)
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    for words in ("Fig. 7", "cube3", "R9", "2.00 mm", "not seen", "dashed: disappeared; red: above 0.1 mm"):
        assert words in text
    assert text.count("#c8102e") >= 16


def test_what_no_longer_stands_is_dashed(tmp_path: Path) -> None:
    """Fig. 7: placements that parts have left, and contacts that are gone, have dashed outlines; nothing else has."""
    graph = graph_of("pockets", 6)
    draw_graph(graph, tmp_path / "a.svg", title="Fig. 7")
    styles = re.findall(
        r'style="(fill: #[0-9a-f]{6};[^"]*stroke: #[0-9a-f]{6}[^"]*)"', (tmp_path / "a.svg").read_text()
    )
    boxes = [style for style in styles if "stroke-linejoin: miter" in style]
    left = [style for style in boxes if "stroke: #8a8a8a" in style]
    assert len(boxes) == len(graph.nodes)
    assert len(left) == sum(not graph.stands(node) for node in graph.nodes) == 3
    assert all(("stroke-dasharray" in style) == (style in left) for style in boxes)
