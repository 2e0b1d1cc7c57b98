"""One command: `apo-bench plan`, operations as macros with their motion parameters; no simulator is needed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.errors import InputError
from apo_bench.program import Plan
from apo_bench.scenario import Scenario

ScenarioArgument = Annotated[str, typer.Argument(help="A name out of `apo-bench scenarios`, or a scenario file.")]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(plan)


def plan(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    method: Annotated[
        str | None, typer.Option(help="Who corrects them: none, a corrector, or package.module:name; default: contact.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
) -> None:
    """Say how every operation is done: contact states, macros, from where until where, what is guarded, the grasp."""
    from apo_bench.benchmark.plan_lines import plan_lines
    from apo_bench.benchmark.plan_text import plan_form, plan_text
    from apo_bench.scenario_file import load_scenario

    if observation is None:
        if method is not None:
            raise InputError(f"--method {method} was given without --observation; give both, or neither.")
        loaded = load_scenario(scenario)
        asked, where = Plan(loaded.assembly, loaded.start, loaded.goals), "at the nominal goals"
    else:
        loaded, asked = _planned(scenario, observation, method or "contact")
        where = f"at the goals of {observation}, {_by(method or 'contact')}"
    lines = plan_lines(asked, loaded)
    if as_json:
        typer.echo(json.dumps(plan_form(lines, loaded), allow_nan=False))
        return
    typer.echo(f"{loaded.name} {where}; directions in the frame of the assembly, until: mm and degrees\n")
    typer.echo("\n".join(plan_text(lines)))


def _planned(scenario: str, observation: Path, method: str) -> tuple[Scenario, Plan]:
    """The scenario, and the plan that a method makes of an observation of it."""
    from apo_bench.benchmark.planning import plan as planned
    from apo_bench.observed import observed

    seen, loaded, _ = observed(observation, scenario)
    if method == "oracle":
        raise InputError("--method oracle was given; it knows the truth, which an observation does not tell.")
    found = planned(method, seen, None)
    if found.plan is None:
        why = found.refused.sentence if found.refused is not None else "no plan was made"
        raise RuntimeError(f"{observation} gives no plan: {why.rstrip('.')}.")
    return loaded, found.plan


def _by(method: str) -> str:
    return "as seen" if method == "none" else f"corrected by {method}"
