"""The command `apo-bench show`: a picture of what is believed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.arguments import check_writable
from apo_bench.errors import InputError

ScenarioArgument = Annotated[str, typer.Argument(help="A name out of `apo-bench scenarios`, or a scenario file.")]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(show)


def show(
    scenario: ScenarioArgument,
    out: Annotated[Path, typer.Option(help="Draw it into this file: .png.")] = Path("believed.png"),
    seen: Annotated[bool, typer.Option("--seen", help="Only what was seen.")] = False,
    corrected: Annotated[bool, typer.Option("--corrected", help="Only what the method makes of it.")] = False,
    step: Annotated[int | None, typer.Option(help="After this operation, from 1; default: the last.")] = None,
    method: Annotated[str, typer.Option(help="A corrector, or package.module:name.")] = "contact",
    level: Annotated[float | None, typer.Option(help="Noise: mm and degrees; default 1.")] = None,
    careless: Annotated[float | None, typer.Option(help="0 is a careful human; default 1.")] = None,
    seed: Annotated[int | None, typer.Option(help="Number of the trial; default 0.")] = None,
    noise: Annotated[str | None, typer.Option(help="A noise model; default: isotropic.")] = None,
    eye: Annotated[str | None, typer.Option(help="noise or range; default: noise.")] = None,
    observation: Annotated[Path | None, typer.Option(help="Show this observation file instead.")] = None,
) -> None:
    """Draw the believed state: parts where they were seen, and where the corrected motion parameters put them."""
    from apo_bench.benchmark.believed_picture import belief, belief_lines, draw_beliefs
    from apo_bench.benchmark.one import Request, watched
    from apo_bench.correction.correct import correct
    from apo_bench.scenario_file import load_scenario

    check_writable(out, "--out", (".png",))
    loaded = load_scenario(scenario)
    k = _step(len(loaded.assembly), step)
    asked: dict[str, Any] = {"level": level, "careless": careless, "seed": seed, "noise": noise, "eye": eye}
    looked = watched(Request(scenario=scenario, observation=observation, **asked))
    if not looked.seen.all():
        missed = int(looked.seen.argmin()) + 1
        raise RuntimeError(f"operation {missed} was not seen, so there is nothing to show after it; try another seed.")
    panels = [] if corrected and not seen else [belief("as seen", looked, looked.goals, k)]
    if corrected or not seen:
        made = correct(looked, method)
        if not made.ok:
            raise RuntimeError(f"{method} did not correct what was seen: {made.sentence}.")
        panels.append(belief(f"corrected by {method}", looked, made.goals, k))
    draw_beliefs(loaded, k, panels, out)
    typer.echo("\n".join([*belief_lines(panels), f"Wrote {out}"]))


def _step(operations: int, step: int | None) -> int:
    if step is None:
        return operations
    if not 1 <= step <= operations:
        raise InputError(f"step {step} was given; the scenario has operations 1 to {operations}.")
    return step
