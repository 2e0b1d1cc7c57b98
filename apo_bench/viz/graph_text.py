"""A relation graph as lines of text, as one JSON object, and as Mermaid text."""

from typing import Any

from apo_bench.assembly import ArcResiduals, Graph, Node, spell
from apo_bench.io import align_columns

_SCHEMA = "apo-bench/graph/1"


def format_graph(graph: Graph, residuals: ArcResiduals, gap_m: float) -> list[str]:
    """Return the lines of a graph: nodes with their ODL, then arcs with operations, faces and residuals.

    Args:
        residuals: Residual of each arc, [m]; None where it is unknown.
        gap_m: Largest residual of a contact that holds, [m].
    """
    nodes = [(str(node), "" if graph.is_current(node) else "moved on") for node in graph.nodes]
    arcs = []
    for arc, residual in zip(graph.arcs, residuals, strict=True):
        lost = "" if arc.lost is None else f", lost at {arc.lost + 1}"
        above = f", above {gap_m * 1e3:g}" if residual is not None and residual > gap_m else ""
        size = "" if residual is None else f"{residual * 1e3:.3f} mm{above}"
        arcs.append((str(arc), f"made {arc.made + 1}{lost}", f"[{' '.join(arc.pairs)}]", size))
    return [*align_columns(nodes), "", *align_columns(arcs)]


def make_graph_form(scenario: str, graph: Graph, residuals: ArcResiduals) -> dict[str, Any]:
    """Return a graph as a JSON object: operations from 1, residuals in mm (null where unknown)."""
    return {
        "schema": _SCHEMA,
        "scenario": scenario,
        "step": graph.step,
        "nodes": [_make_node_form(node) | {"stands": graph.is_current(node)} for node in graph.nodes],
        "arcs": [
            {
                "name": arc.name,
                "manipulated": _make_node_form(arc.manipulated),
                "environment": _make_node_form(arc.environment),
                "made": arc.made + 1,
                "lost": None if arc.lost is None else arc.lost + 1,
                "faces": [[contact.manipulated.face, contact.environment.face] for contact in arc.contacts],
                "residual_mm": None if residual is None else residual * 1e3,
            }
            for arc, residual in zip(graph.arcs, residuals, strict=True)
        ],
    }


def format_mermaid(graph: Graph) -> str:
    """Return a Mermaid flow chart, which GitHub renders; contacts that disappeared are dotted."""
    number = {node: i for i, node in enumerate(graph.nodes)}
    lines = ["flowchart TD"]
    lines += [f'  n{i}["{node.part}<br>{_make_odl_form(node)}"]' for node, i in number.items()]
    for arc in graph.arcs:
        arrow = "-->" if arc.lost is None else "-.->"
        lines.append(f"  n{number[arc.manipulated]} {arrow}|{arc.name}| n{number[arc.environment]}")
    return "\n".join(lines) + "\n"


def _make_node_form(node: Node) -> dict[str, Any]:
    return {"part": node.part, "placed": None if node.placed is None else node.placed + 1, "odl": _make_odl_form(node)}


def _make_odl_form(node: Node) -> str:
    return "T0" if node.placed is None else spell(node.odl)
