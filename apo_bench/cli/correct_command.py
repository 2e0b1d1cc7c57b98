"""The command `apo-bench correct`: observed poses, corrected by their face contacts. It needs no simulator."""

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.cli.arguments import NO_RESULT, AsJson, DeviationDeg, DeviationMm, ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.planned import plan_correction
from apo_bench.cli.printing import print_json, print_lines, print_tables, say
from apo_bench.errors import require
from apo_bench.formats.deviations import assumed_deviations
from apo_bench.formats.observation import read_observation_file
from apo_bench.io import redirect_output, write_file
from apo_bench.records import CORRECTOR, with_simulated

_EXACT_M = 1e-9  # contacts that hold this well are a solution, at which a rank can be read off
_DOUBTS = ("apply", "warn", "refuse", "drop")


def correct_command(
    scenario: ScenarioArgument,
    observation: Annotated[Path, typer.Option(help="What was seen: .csv, or .json of `replay --save-observation`.")],
    method: Annotated[
        str | None,
        typer.Option(help=f"A corrector, or package.module:name; default: {CORRECTOR}, contact with --if-doubtful."),
    ] = None,
    if_doubtful: Annotated[
        str | None,
        typer.Option(help="What contact does if its test fails: apply, warn, refuse or drop; else warn."),
    ] = None,
    deviation_mm: DeviationMm = 1.0,
    deviation_deg: DeviationDeg = 1.0,
    camera_noise: Annotated[
        Path | None,
        typer.Option(help="Take the noise of this file, as `noise fit` writes it, for what the camera states."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the corrected goals: a plan .json, or .csv, moved so that it fits."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Correct observed poses by their face contacts; no simulator is needed."""
    from apo_bench.correction.correctors import correct
    from apo_bench.trial.predicted_success import predicted_success_sentence
    from apo_bench.viz.correct_text import correction_form, correction_lines, correction_tables

    check_outputs([(out, "--out", (".json", ".csv"))], [observation])
    method = method or (CORRECTOR if if_doubtful is None else "contact")
    corrector = _corrector(method, if_doubtful)
    seen, loaded, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    if camera_noise is not None:
        from apo_bench.perception.observation.models.fitted import restate
        from apo_bench.perception.observation.noise_file import read_noise

        seen = restate(seen, *read_noise(camera_noise))
        assumed = False
    with redirect_output(as_json):
        correction = correct(seen, corrector)
    explanation = _explained(seen, correction)
    planned = plan_correction(loaded, seen, correction) if correction.ok else None
    if out is not None and planned is not None:
        _write_plan(out, scenario, loaded.name, planned.plan)
    form = correction_form(loaded.name, method, seen, correction, explanation, assumed)
    if as_json:
        moved = None if out is None or planned is None else planned.moved or None
        print_json(form | {"moved": moved, "predicted_success": planned and planned.predicted_success})
    else:
        typer.echo(f"{loaded.name} from {observation}, corrected by {method}\n")
        lines = correction_lines(correction, explanation)
        if planned is not None:
            lines.append(("predicted_success", predicted_success_sentence(planned.predicted_success)))
        if assumed:
            lines.append(("noise", assumed_deviations(deviation_mm, deviation_deg)))
        print_lines(lines)
        print_tables(*correction_tables(form))
    if out is not None and planned is not None:
        say(f"Wrote {out}{planned.moved and f': {planned.moved}'}", as_json)
    elif out is not None:
        typer.echo(f"apo-bench: nothing was corrected, so {out} was not written.", err=True)
    if not correction.ok:
        raise typer.Exit(NO_RESULT)


def _explained(observation: Observation, correction: Correction) -> Any:
    """What the contacts determine at corrected goals; None of corrections that leave contacts open, or of too many."""
    from apo_bench.correction.checks.as_given import gap_of
    from apo_bench.correction.explanation import explain
    from apo_bench.correction.solvers.posterior import LARGEST_POSTERIOR

    if (
        not correction.ok
        or 6 * len(correction.poses) > LARGEST_POSTERIOR
        or gap_of(observation, correction.poses, correction.dropped) > _EXACT_M
    ):
        return None
    return explain(observation, correction)


def _corrector(method: str, doubt: str | None) -> Any:
    """The corrector `contact` with what it is to do in doubt, or any other as a trial knows it."""
    from apo_bench.correction.contact.contact import ContactCorrector, Doubt

    require(
        doubt is None or doubt in _DOUBTS,
        f"--if-doubtful {doubt} was given; {', '.join(_DOUBTS[:-1])} or {_DOUBTS[-1]} is allowed.",
    )
    if method == "contact":
        return ContactCorrector(cast(Doubt, doubt or "warn"))
    require(doubt is None, f"--if-doubtful was given with --method {method}; only contact can be told what to do.")
    return with_simulated(method)


def _write_plan(out: Path, scenario: str, name: str, plan: Plan) -> None:
    from apo_bench.formats.csv_form import table
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.plan_json import plan_form

    if out.suffix.lower() == ".json":
        write_form(plan_form(plan, name if scenario == name else str(Path(scenario).resolve())), out)
        return
    write_file(out, table(plan.assembly, plan.target_poses))
