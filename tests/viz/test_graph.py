"""Relation graphs: each part above the parts it lies on, and files are what their names say."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench.assembly import Graph, build_relation_graph
from apo_bench.viz.graph_picture import draw_graph, place_nodes
from apo_bench.viz.graph_text import format_graph, make_graph_form
from tests import rounds, scenes

SOME = [None, *([2e-3] * 8)]
"""Residuals of the graph of Fig. 7: one unknown, the others too large."""


def graph_of(name: str, step: int | None = None) -> Graph:
    return build_relation_graph(scenes.ALL[name]().assembly, step)


@pytest.mark.parametrize("name", scenes.ALL)
def test_every_part_is_above_what_it_lies_on_and_no_two_share_a_place(name: str) -> None:
    for step in range(1, len(scenes.ALL[name]().assembly) + 1):
        graph = graph_of(name, step)
        places = place_nodes(graph)
        assert set(places) == set(graph.nodes)
        assert len(set(places.values())) == len(places)
        assert all(places[arc.manipulated][1] > places[arc.environment][1] for arc in graph.arcs)


def test_words_dashes_and_colours_are_in_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Placements that parts have left, and contacts that disappeared, are dashed."""
    import matplotlib

    monkeypatch.setitem(matplotlib.rcParamsDefault, "svg.fonttype", "none")
    draw_graph(graph_of("pockets", 6), tmp_path / "a.svg", "Fig. 7", residuals=SOME, gap_m=1e-4, colors={})
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    for words in ("Fig. 7", "cube3", "R9", "2.00 mm", "dashed: disappeared", "red: above 0.1 mm"):
        assert words in text
    assert text.lower().count("#c8102e") >= 16
    draw_graph(graph_of("stick_in_tower"), tmp_path / "b.svg", "whole", colors={})
    draw_graph(build_relation_graph(rounds.through().assembly), tmp_path / "c.svg", "axial", colors={})
    dashes = [(tmp_path / f"{name}.svg").read_text().count("stroke-dasharray") for name in "abc"]
    assert dashes[0] >= 3
    assert dashes[1] == 0
    assert dashes[2] >= 2


def test_residuals_are_shown_with_the_gap_that_they_exceed() -> None:
    graph = graph_of("pockets", 6)
    residuals = [None, *([2e-3] * 7), 5e-5]
    lines = format_graph(graph, residuals, 1e-4)
    arcs = [line for line in lines if line.startswith("R")]
    assert arcs[0].endswith("]")
    assert all(line.endswith("2.000 mm, above 0.1") for line in arcs[1:8])
    assert arcs[8].endswith("0.050 mm")
    assert "made 1, lost at 4" in arcs[0]
    assert [line.split("  ")[0] for line in lines if line.endswith("moved on")] == [
        "cube1 (1): T1",
        "cube2 (2): T2",
        "cube3 (3): T3",
    ]
    form = make_graph_form("pockets", graph, residuals)
    assert [arc["residual_mm"] for arc in form["arcs"]] == [None, *([2.0] * 7), 0.05]
    assert [node["stands"] for node in form["nodes"]] == [True, False, False, False, True, True, True, True]
