"""The command `apo-bench inspect graph`: the relation graph of a scenario."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import (
    AsJson,
    ScenarioArgument,
    check_output,
    make_path_option,
    print_json,
    print_text,
    print_written,
)


def graph_command(
    scenario: ScenarioArgument,
    operation: Annotated[
        int | None, typer.Option(help="Show the state after this operation; default: the last.")
    ] = None,
    observation: Annotated[Path | None, make_path_option("Show the residuals of this observation.")] = None,
    out: Annotated[Path | None, make_path_option("Draw it into this file: .svg, .png, or .mmd (Mermaid text).")] = None,
    as_json: AsJson = False,
) -> None:
    """Print the relation graph: parts at their placements with their ODLs, contacts made and lost.

    Examples:
      apo-bench inspect graph pocket_table --out graph.svg
      apo-bench inspect graph stick_in_tower --operation 2 --observation docs/seen.csv
    """
    from apo_bench import load_scenario, read_observation
    from apo_bench.assembly import build_relation_graph, compute_observed_residuals
    from apo_bench.io import write_file
    from apo_bench.viz.graph_picture import draw_graph
    from apo_bench.viz.graph_text import format_graph, format_mermaid, make_graph_form

    check_output(out, "--out", ".svg", ".png", ".mmd")
    task = load_scenario(scenario)
    graph = build_relation_graph(task.assembly, operation)
    observed = None if observation is None else read_observation(observation, task)
    residuals = [None] * len(graph.arcs) if observed is None else compute_observed_residuals(observed, graph)
    gap_m = task.gap_mm * 1e-3 if observed is None else observed.gap_m
    title = f"{task.name} after operation {graph.step}"
    if out is not None and out.suffix.lower() == ".mmd":
        write_file(out, format_mermaid(graph))
    elif out is not None:
        draw_graph(graph, out, title, residuals=residuals, gap_m=gap_m, colors=task.colors)
    if as_json:
        print_json(make_graph_form(task.name, graph, residuals))
    print_text("\n".join([title, "", *format_graph(graph, residuals, gap_m)]), as_json)
    print_written(out, as_json=as_json)
