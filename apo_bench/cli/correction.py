"""Two commands that need no simulator: `apo-bench explain | correct`. Only the picture of `explain` draws with one."""

from pathlib import Path
from typing import Annotated, Any, cast

import typer

from apo_bench.assembly import Correction, Observation, Plan
from apo_bench.cli.printing import print_json, print_lines, print_tables, say
from apo_bench.cli.setting_options import NO_RESULT, AsJson, ScenarioArgument, check_outputs
from apo_bench.errors import require
from apo_bench.files.observation import as_planned, read_observation_file
from apo_bench.io import redirect_output, write_file
from apo_bench.records import CORRECTOR, with_simulated
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario

_EXACT_M = 1e-9
"""Contacts that hold this well are a solution, at which a rank can be read off."""
_DOUBTS = ("apply", "warn", "refuse", "drop")

_DeviationMm = Annotated[float, typer.Option(help="Standard deviation of what was seen, mm, where none is stated.")]
_DeviationDeg = Annotated[float, typer.Option(help="The same in degrees.")]


def explain_command(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the corrected goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    deviation_mm: _DeviationMm = 1.0,
    deviation_deg: _DeviationDeg = 1.0,
    out: Annotated[Path | None, typer.Option(help="Draw the free directions into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Say what the contacts determine: what is fixed by which relations, what is free, how well poses are known."""
    from apo_bench.correction.correctors import correct
    from apo_bench.correction.explanation import explain
    from apo_bench.show.explain_text import (
        explanation_form,
        explanation_tables,
        hypothesis_forms,
        hypothesis_lines,
        sentences,
        total,
    )
    from apo_bench.trial.promise import promise_sentence

    check_outputs([(out, "--out", (".png",))])
    if observation is None:
        loaded = load_scenario(scenario)
        seen = as_planned(loaded, deviation_mm, deviation_deg)
        at: Any = seen.goals
        promised = None
        where = f"at the nominal goals, {_stated(deviation_mm, deviation_deg)}"
    else:
        seen, loaded, assumed = read_observation_file(
            observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
        )
        at = correct(seen)
        if not at.ok:
            raise RuntimeError(f"{observation} cannot be corrected, so nothing is explained: {at.sentence}.")
        promised = _promised(_planned(loaded, seen, at)[0], seen, at, loaded)
        where = f"at the corrected goals of {observation}"
        where += f", {_stated(deviation_mm, deviation_deg)} where it states none" * assumed
    explanation = explain(seen, at)
    if out is not None:
        from apo_bench.show.explain_picture import draw_explanation

        draw_explanation(loaded, seen, explanation, out)
    if as_json:
        known = {"promised": promised, "hypotheses": hypothesis_forms(explanation.hypotheses)}
        print_json(explanation_form(loaded.name, explanation) | known)
    else:
        said = [] if promised is None else [f"promised: {promise_sentence(promised)}"]
        said += [f"may be {line}" for line in hypothesis_lines(explanation.hypotheses)]
        typer.echo("\n".join([f"{loaded.name}: {total(explanation)}", where, *said, "", *sentences(explanation)]))
        print_tables(*explanation_tables(explanation))
    if out is not None:
        say(f"\nWrote {out}", as_json)


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
    deviation_mm: _DeviationMm = 1.0,
    deviation_deg: _DeviationDeg = 1.0,
    camera_noise: Annotated[
        Path | None,
        typer.Option(help="Take the noise of this file, of `noise fit` or `noise still`, for what the camera states."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the corrected goals: a plan .json, or .csv, moved so that it fits."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Correct observed poses by their face contacts; no simulator is needed."""
    from apo_bench.correction.correctors import correct
    from apo_bench.show.correct_text import correction_form, correction_lines, pose_table, suspect_table
    from apo_bench.trial.promise import promise_sentence

    check_outputs([(out, "--out", (".json", ".csv"))])
    require(
        out is None or not out.exists() or not observation.exists() or not out.samefile(observation),
        f"--out {out} is the file of the observation; name another, so that what was seen is kept.",
    )
    method = method or (CORRECTOR if if_doubtful is None else "contact")
    corrector = _corrector(method, if_doubtful)
    seen, loaded, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    if camera_noise is not None:
        from apo_bench.observation.models.fitted import restated
        from apo_bench.observation.noise_file import read_noise

        seen = restated(seen, *read_noise(camera_noise))
        assumed = False
    with redirect_output(as_json):
        correction = correct(seen, corrector)
    explanation = _explained(seen, correction)
    plan, moved = _planned(loaded, seen, correction) if correction.ok else (None, "")
    promised = None if plan is None else _promised(plan, seen, correction, loaded)
    if out is not None and plan is not None:
        _write_plan(out, scenario, loaded.name, plan)
    if as_json:
        form = correction_form(loaded.name, method, seen, correction, explanation, assumed)
        print_json(form | {"moved": (out is not None and moved) or None, "promised": promised})
    else:
        typer.echo(f"{loaded.name} from {observation}, corrected by {method}\n")
        lines = correction_lines(seen, correction, explanation)
        if promised is not None:
            lines.append(("promised", promise_sentence(promised)))
        if assumed:
            lines.append(("noise", f"{_stated(deviation_mm, deviation_deg)}, assumed where the file states none"))
        print_lines(lines)
        if correction.ok:
            print_tables(pose_table(seen, correction))
        if correction.test is not None and correction.test.suspects:
            print_tables(suspect_table(correction.test))
    if not correction.ok:
        if out is not None:
            typer.echo(f"apo-bench: nothing was corrected, so {out} was not written.", err=True)
        raise typer.Exit(NO_RESULT)
    if out is not None:
        say(f"Wrote {out}{moved and f': {moved}'}", as_json)


def _explained(observation: Observation, correction: Correction) -> Any:
    """What the contacts determine at corrected goals; None of corrections that leave contacts open, or of too many."""
    from apo_bench.correction.checks.status import gap_of
    from apo_bench.correction.explanation import explain
    from apo_bench.correction.solvers.posterior import LARGEST_POSTERIOR

    if (
        not correction.ok
        or 6 * len(correction.goals) > LARGEST_POSTERIOR
        or gap_of(observation, correction.goals, correction.dropped) > _EXACT_M
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


def _planned(scenario: Scenario, observation: Observation, correction: Correction) -> tuple[Plan, str]:
    """The plan, and what of it is not as corrected, so that it fits; a simulator is asked only where it would not."""
    from apo_bench.prediction.failure import predict

    plan = correction.plan(observation)
    if not predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach).fails:
        return plan, ""
    from apo_bench.trial.fitting import fitting_plan

    fitting = fitting_plan(correction, observation, scenario)
    return fitting.plan, fitting.sentence


def _promised(plan: Plan, observation: Observation, correction: Correction, scenario: Scenario) -> float:
    """The probability of success of a plan, whichever arm carries it out."""
    from apo_bench.trial.promise import promised_success

    return promised_success(plan, observation, correction, scenario)


def _write_plan(out: Path, scenario: str, name: str, plan: Plan) -> None:
    from apo_bench.files.csv_form import table
    from apo_bench.files.json_forms import plan_form, write_form

    if out.suffix.lower() == ".json":
        write_form(plan_form(plan, name if scenario == name else str(Path(scenario).resolve())), out)
        return
    write_file(out, table(plan.assembly, plan.goals))


def _stated(deviation_mm: float, deviation_deg: float) -> str:
    return f"seen with a standard deviation of {deviation_mm:g} mm and {deviation_deg:g} deg per axis"
