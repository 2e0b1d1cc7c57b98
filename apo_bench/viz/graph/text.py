"""A relation graph in words for people, as one JSON object, and as Mermaid text."""

from typing import Any

from apo_bench.assembly import ArcResiduals, Graph, Node, spell
from apo_bench.io import columns

_GRAPH = "apo-bench/graph/1"


def graph_title(scenario: str, graph: Graph) -> str:
    """`pocket_table after operation 6`."""
    return f"{scenario} after operation {graph.step}"


def graph_lines(scenario: str, graph: Graph, residuals: ArcResiduals | None = None, gap_m: float = 0.0) -> list[str]:
    """Every part at its placements with the ODL, then every arc: when it was made and lost, the faces, the residual."""
    nodes = [(str(node), "" if graph.stands(node) else "moved on") for node in graph.nodes]
    sizes = [()] * len(graph.arcs) if residuals is None else [(_size(r, gap_m),) for r in residuals]
    arcs = []
    for arc, size in zip(graph.arcs, sizes, strict=True):
        lost = "" if arc.lost is None else f", lost at {arc.lost + 1}"
        arcs.append((str(arc), f"made {arc.made + 1}{lost}", f"[{' '.join(arc.pairs)}]", *size))
    return [graph_title(scenario, graph), "", *columns(nodes), "", *columns(arcs)]


def graph_form(scenario: str, graph: Graph, residuals: ArcResiduals | None = None) -> dict[str, Any]:
    """What `json` can write: operations numbered from 1, residuals in mm (null where unknown)."""
    measured: ArcResiduals = [None] * len(graph.arcs) if residuals is None else residuals
    return {
        "schema": _GRAPH,
        "scenario": scenario,
        "step": graph.step,
        "nodes": [_node_form(node) | {"stands": graph.stands(node)} for node in graph.nodes],
        "arcs": [
            {
                "name": arc.name,
                "manipulated": _node_form(arc.manipulated),
                "environment": _node_form(arc.environment),
                "made": arc.made + 1,
                "lost": None if arc.lost is None else arc.lost + 1,
                "faces": [[contact.manipulated.face, contact.environment.face] for contact in arc.contacts],
                "residual_mm": None if residual is None else residual * 1e3,
            }
            for arc, residual in zip(graph.arcs, measured, strict=True)
        ],
    }


def mermaid_text(graph: Graph) -> str:
    """A flow chart that GitHub and other readers of Markdown draw; dotted is what disappeared."""
    number = {node: i for i, node in enumerate(graph.nodes)}
    nodes = [f'  n{i}["{node.part}<br>{_odl(node)}"]' for node, i in number.items()]
    arcs = [
        f"  n{number[arc.manipulated]} {'-->' if arc.lost is None else '-.->'}|{arc.name}| n{number[arc.environment]}"
        for arc in graph.arcs
    ]
    return "\n".join(["flowchart TD", *nodes, *arcs]) + "\n"


def _size(residual: float | None, gap_m: float) -> str:
    if residual is None:
        return "not seen"
    above = f", above {gap_m * 1e3:g}" if residual > gap_m else ""
    return f"{residual * 1e3:.3f} mm{above}"


def _node_form(node: Node) -> dict[str, Any]:
    return {"part": node.part, "placed": None if node.placed is None else node.placed + 1, "odl": _odl(node)}


def _odl(node: Node) -> str:
    return "T0" if node.placed is None else spell(node.odl)
