"""The command `apo-bench inspect graph`: the relation graph of a scenario. It needs no simulator."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.assembly import observed_residuals, relation_graph
from apo_bench.cli.arguments import AsJson, ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import print_answer, say
from apo_bench.formats.observation import read_observation
from apo_bench.io import write_file
from apo_bench.scenario.file import load_scenario


def graph_command(
    scenario: ScenarioArgument,
    step: Annotated[int | None, typer.Option(help="After this operation, from 1; default: the last.")] = None,
    observation: Annotated[Path | None, typer.Option(help="Show the residuals of this observation file.")] = None,
    out: Annotated[Path | None, typer.Option(help="Draw it into this file: .svg, .png, or .mmd, Mermaid text.")] = None,
    as_json: AsJson = False,
) -> None:
    """Print the relation graph: parts at their placements with their ODLs, contacts made and lost."""
    from apo_bench.viz.graph.drawing import draw_graph
    from apo_bench.viz.graph.text import graph_form, graph_lines, graph_title, mermaid_text

    check_outputs([(out, "--out", (".svg", ".png", ".mmd"))])
    loaded = load_scenario(scenario)
    graph = relation_graph(loaded.assembly, step)
    seen = None if observation is None else read_observation(observation, loaded)
    residuals = None if seen is None else observed_residuals(seen, graph)
    gap_m = loaded.gap_mm * 1e-3 if seen is None else seen.gap_m
    if out is not None and out.suffix.lower() == ".mmd":
        write_file(out, mermaid_text(graph))
    elif out is not None:
        title = graph_title(loaded.name, graph)
        draw_graph(graph, out, title=title, residuals=residuals, gap_m=gap_m, colors=loaded.colors)
    lines = graph_lines(loaded.name, graph, residuals, gap_m)
    print_answer(graph_form(loaded.name, graph, residuals), lines, as_json)
    if out is not None:
        say(f"\nWrote {out}", as_json)
