"""The command `apo-bench inspect dof`: degrees of freedom that contacts fix or leave free."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.planned import plan_correction
from apo_bench.cli.shared import (
    AsJson,
    DeviationDeg,
    DeviationMm,
    ScenarioArgument,
    check_output,
    make_path_option,
    print_json,
    print_table,
    print_written,
)


def dof_command(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, make_path_option("Use the corrected poses of this observation; default: the nominal poses.")
    ] = None,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    out: Annotated[Path | None, make_path_option("Draw the free directions into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Explain the degrees of freedom: what each relation fixes, what is free, and how well poses are known.

    Examples:
      apo-bench inspect dof stick_in_tower --out free.png
      apo-bench inspect dof stick_in_tower --observation docs/seen.csv
    """
    from apo_bench import correct, explain, load_scenario
    from apo_bench.formats.deviations import DEVIATION_DEG, DEVIATION_MM, note_assumed_deviations
    from apo_bench.formats.observation import make_nominal_observation, read_observation_file
    from apo_bench.viz.dof_text import (
        DOF_COLUMNS,
        PART_COLUMNS,
        count_directions,
        format_hypotheses,
        format_shared_errors,
        list_dof_rows,
        make_dof_form,
        make_hypothesis_forms,
    )
    from apo_bench.viz.form_text import make_table

    check_output(out, "--out", ".png")
    predicted_success = None
    if observation is None:
        task, assumed = load_scenario(scenario), True
        mm = DEVIATION_MM if deviation_mm is None else deviation_mm
        deg = DEVIATION_DEG if deviation_deg is None else deviation_deg
        observed = make_nominal_observation(task, mm, deg)
        explanation = explain(observed, observed.poses)
    else:
        observed, task, assumed = read_observation_file(
            observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
        )
        correction = correct(observed)
        if not correction.ok:
            raise RuntimeError(f"{observation} has no correction to explain: {correction.sentence}.")
        predicted_success = plan_correction(task, observed, correction)[2]
        explanation = explain(observed, correction)
    if out is not None:
        from apo_bench.viz.dof_picture import draw_dof

        draw_dof(task, observed, explanation, out)
    form = make_dof_form(task.name, explanation)
    if as_json:
        more = {"predicted_success": predicted_success, "hypotheses": make_hypothesis_forms(explanation.hypotheses)}
        print_json(form | more)
        return
    lines = [
        f"{task.name}: {count_directions(explanation)}",
        f"at the {'nominal poses' if observation is None else f'corrected poses of {observation}'}",
        *([note_assumed_deviations(deviation_mm, deviation_deg)] if assumed else []),
        *([] if predicted_success is None else [f"predicted success {predicted_success:.2f}"]),
        *(f"hypothesis {line}" for line in format_hypotheses(explanation.hypotheses)),
        *format_shared_errors(explanation),
    ]
    typer.echo("\n".join(lines))
    print_table(make_table(list_dof_rows(explanation), DOF_COLUMNS))
    print_table(make_table(form["parts"], PART_COLUMNS))
    print_written(out)
