"""The command `apo-bench correct`: correct observed poses without a simulator."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.cli.planned import plan_correction
from apo_bench.cli.shared import (
    NO_RESULT,
    AsJson,
    DeviationDeg,
    DeviationMm,
    ScenarioArgument,
    check_output,
    make_path_option,
    print_columns,
    print_json,
    print_table,
    print_text,
)
from apo_bench.io import redirect_output, write_file
from apo_bench.records import CORRECTOR, resolve_simulated

_EXACT_M = 1e-9  # contacts that hold this well are a solution, at which a rank can be computed


def correct_command(
    scenario: ScenarioArgument,
    observation: Annotated[Path, make_path_option("Observed poses: .csv, or .json of `run --save-observation`.")],
    method: Annotated[str, typer.Option(help="Corrector by name, or package.module:name.")] = CORRECTOR,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    camera_noise: Annotated[
        Path | None, make_path_option("Use the noise of this file of `noise fit` in place of the stated one.")
    ] = None,
    out: Annotated[Path | None, make_path_option("Write the corrected poses: a plan (.json), or .csv.")] = None,
    as_json: AsJson = False,
) -> None:
    """Correct observed poses by their face contacts.

    Examples:
      apo-bench correct stick_in_tower --observation docs/seen.csv
      apo-bench correct stick_in_tower --observation docs/seen.csv --method contact-drop --out plan.json
    """
    from apo_bench import correct
    from apo_bench.formats.deviations import note_assumed_deviations
    from apo_bench.formats.observation import read_observation_file
    from apo_bench.viz.correct_text import POSE_COLUMNS, SUSPECT_COLUMNS, format_correction, make_correction_form
    from apo_bench.viz.dof_text import DOF_COLUMNS, list_dof_rows
    from apo_bench.viz.form_text import make_table

    check_output(out, "--out", ".json", ".csv", inputs=(observation,))
    observed, task, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    if camera_noise is not None:
        from apo_bench.perception.observation.models.fitted import restate_covariance
        from apo_bench.perception.observation.noise_file import read_noise

        observed = restate_covariance(observed, *read_noise(camera_noise))
        assumed = False
    with redirect_output(as_json):
        correction = correct(observed, resolve_simulated(method))
    explanation = _explain_solution(observed, correction)
    form = make_correction_form(task.name, method, observed, correction, explanation, assumed)
    lines = format_correction(form, correction)
    moved, predicted_success = "", None
    if correction.ok:
        plan, moved, predicted_success = plan_correction(task, observed, correction)
        lines.append(("predicted success", f"{predicted_success:.2f}"))
        if out is not None:
            _write_plan(out, scenario, task.name, plan)
    if assumed:
        lines.append(("noise", note_assumed_deviations(deviation_mm, deviation_deg)))
    if as_json:
        print_json(form | {"moved": moved or None, "predicted_success": predicted_success})
    else:
        print_columns([("observation", str(observation)), *lines])
        free = explanation and list_dof_rows(explanation)
        suspects = form["test"] and form["test"]["suspects"]
        tables = ((form["operations"], POSE_COLUMNS), (free, DOF_COLUMNS), (suspects, SUSPECT_COLUMNS))
        for rows, columns in tables:
            if rows:
                print_table(make_table(rows, columns))
    if out is not None and correction.ok:
        print_text(f"Wrote {out}{moved and f': {moved}'}", as_json)
    if not correction.ok:
        raise typer.Exit(NO_RESULT)


def _explain_solution(observation: Observation, correction: Correction) -> Any:
    """What the contacts determine at corrected poses; None where contacts stay open, or of too many operations."""
    from apo_bench import explain
    from apo_bench.correction.checks.as_given import gap_of
    from apo_bench.correction.solvers.posterior import LARGEST_POSTERIOR

    if not correction.ok or 6 * len(correction.poses) > LARGEST_POSTERIOR:
        return None
    exact = gap_of(observation, correction.poses, correction.dropped) <= _EXACT_M
    return explain(observation, correction) if exact else None


def _write_plan(out: Path, scenario: str, name: str, plan: Plan) -> None:
    from apo_bench.formats.csv_form import write_csv_table
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.plan_json import make_plan_form

    if out.suffix.lower() == ".json":
        write_form(make_plan_form(plan, name if scenario == name else str(Path(scenario).resolve())), out)
    else:
        write_file(out, write_csv_table(plan.assembly, plan.target_poses))
