"""The command `apo-bench inspect dof`: what the contacts determine. Only its picture needs a simulator."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import AsJson, DeviationDeg, DeviationMm, ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.planned import plan_correction
from apo_bench.cli.printing import print_json, print_tables, say
from apo_bench.formats.observation import as_planned, read_observation_file
from apo_bench.scenario.file import load_scenario


def dof_command(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the corrected goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    deviation_mm: DeviationMm = 1.0,
    deviation_deg: DeviationDeg = 1.0,
    out: Annotated[Path | None, typer.Option(help="Draw the free directions into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what the contacts determine: what is fixed by which relations, what is free, how well poses are known."""
    from apo_bench.correction.correctors import correct
    from apo_bench.correction.explanation import explain
    from apo_bench.trial.predicted_success import predicted_success_sentence
    from apo_bench.viz.explain_text import (
        explanation_form,
        hypothesis_forms,
        hypothesis_lines,
        part_table,
        sentences,
        total,
    )

    check_outputs([(out, "--out", (".png",))])
    stated = f"seen with a standard deviation of {deviation_mm:g} mm and {deviation_deg:g} deg per axis"
    predicted_success = None
    if observation is None:
        loaded = load_scenario(scenario)
        seen = as_planned(loaded, deviation_mm, deviation_deg)
        at: Any = seen.poses
        where = f"at the nominal goals, {stated}"
    else:
        seen, loaded, assumed = read_observation_file(
            observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
        )
        at = correct(seen)
        if not at.ok:
            raise RuntimeError(f"{observation} cannot be corrected, so nothing is explained: {at.sentence}.")
        predicted_success = plan_correction(loaded, seen, at).predicted_success
        where = f"at the corrected goals of {observation}" + f", {stated} where it states none" * assumed
    explanation = explain(seen, at)
    if out is not None:
        from apo_bench.viz.explain_picture import draw_explanation

        draw_explanation(loaded, seen, explanation, out)
    form = explanation_form(loaded.name, explanation)
    if as_json:
        known = {"predicted_success": predicted_success, "hypotheses": hypothesis_forms(explanation.hypotheses)}
        print_json(form | known)
    else:
        lines = [f"{loaded.name}: {total(explanation)}", where]
        if predicted_success is not None:
            lines.append(f"promised: {predicted_success_sentence(predicted_success)}")
        lines += [f"may be {line}" for line in hypothesis_lines(explanation.hypotheses)]
        typer.echo("\n".join([*lines, "", *sentences(explanation)]))
        print_tables(part_table(form))
    if out is not None:
        say(f"\nWrote {out}", as_json)
