"""Two commands that need no simulator: `apo-bench explain | correct`. Only the picture of `explain` draws with one."""

import json
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Observation, Plan
from apo_bench.cli.arguments import NO_RESULT, check_writable
from apo_bench.cli.setting_options import ScenarioArgument
from apo_bench.errors import InputError
from apo_bench.io.output import redirect_output
from apo_bench.records.short_names import CORRECTOR
from apo_bench.scenario.scenario import Scenario

_EXACT_M = 1e-9
"""Contacts that hold this well are a solution, at which a rank can be read off."""
_DOUBTS = ("apply", "warn", "refuse", "drop")

_DeviationMm = Annotated[float, typer.Option(help="Standard deviation of what was seen, mm, where none is stated.")]
_DeviationDeg = Annotated[float, typer.Option(help="The same in degrees.")]
_AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command()(explain)
    app.command()(correct)


def explain(
    scenario: ScenarioArgument,
    observation: Annotated[
        Path | None, typer.Option(help="At the corrected goals of this .json or .csv; default: the nominal ones.")
    ] = None,
    deviation_mm: _DeviationMm = 1.0,
    deviation_deg: _DeviationDeg = 1.0,
    out: Annotated[Path | None, typer.Option(help="Draw the free directions into this file: .png.")] = None,
    as_json: _AsJson = False,
) -> None:
    """Say what the contacts determine: what is fixed by which relations, what is free, how well poses are known."""
    from apo_bench.correction.correctors import correct as corrected
    from apo_bench.correction.explanation import explain as explained
    from apo_bench.files.observation import as_planned, read_observation_file
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.explain_text import explanation_form, explanation_tables, sentences, total

    if out is not None:
        check_writable(out, "--out", (".png",))
    if observation is None:
        loaded = load_scenario(scenario)
        seen = as_planned(loaded, deviation_mm, deviation_deg)
        goals = seen.goals
        where = f"at the nominal goals, {_stated(deviation_mm, deviation_deg)}"
    else:
        seen, loaded, assumed = read_observation_file(
            observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
        )
        made = corrected(seen, "contact")
        if not made.ok:
            raise RuntimeError(f"{observation} cannot be corrected, so nothing is explained: {made.sentence}.")
        goals = made.goals
        where = f"at the corrected goals of {observation}"
        where += f", {_stated(deviation_mm, deviation_deg)} where it states none" * assumed
    found = explained(seen, goals)
    if as_json:
        typer.echo(json.dumps(explanation_form(loaded.name, found), allow_nan=False))
    else:
        typer.echo("\n".join([f"{loaded.name}: {total(found)}", where, "", *sentences(found)]))
        _print_tables(explanation_tables(found))
    if out is not None:
        from apo_bench.show.explain_picture import draw_explanation

        draw_explanation(loaded, seen, found, out)
        if not as_json:
            typer.echo(f"\nWrote {out}")


def correct(
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
        typer.Option(help="Take the noise of this file, of `noise learn` or `noise fit`, for what the camera states."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Write the corrected goals: a plan .json, or .csv, moved so that it fits."),
    ] = None,
    as_json: _AsJson = False,
) -> None:
    """Correct observed poses by their face contacts; no simulator is needed."""
    from apo_bench.correction.own_code.own import correct_named
    from apo_bench.files.observation import read_observation_file
    from apo_bench.show.correct_text import correction_form, correction_lines, pose_table, suspect_table
    from apo_bench.trial.methods import with_simulated

    if out is not None:
        check_writable(out, "--out", (".json", ".csv"))
        if out.exists() and observation.exists() and out.samefile(observation):
            raise InputError(
                f"--out {out} is the file of the observation; name another, so that what was seen is kept."
            )
    method = method or (CORRECTOR if if_doubtful is None else "contact")
    corrector = _corrector(method, if_doubtful)
    seen, loaded, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    if camera_noise is not None:
        from apo_bench.observation.noise_file import read_noise
        from apo_bench.observation.restated import restated

        seen = restated(seen, *read_noise(camera_noise))
        assumed = False
    with redirect_output(as_json):
        correction = correct_named(seen, with_simulated(corrector))
    found = _explained(seen, correction)
    plan, moved = _planned(loaded, seen, correction) if out is not None and correction.ok else (None, "")
    if as_json:
        form = correction_form(loaded.name, method, seen, correction, found, assumed) | {"moved": moved or None}
        typer.echo(json.dumps(form, allow_nan=False))
    else:
        typer.echo(f"{loaded.name} from {observation}, corrected by {method}\n")
        lines = correction_lines(seen, correction, found)
        if assumed:
            lines.append(("noise", f"{_stated(deviation_mm, deviation_deg)}, assumed where the file states none"))
        width = max(len(name) for name, _ in lines)
        typer.echo("\n".join(f"{name:{width}}  {text}" for name, text in lines))
        _print_tables([pose_table(seen, correction)] if correction.ok else [])
        if correction.test is not None and correction.test.suspects:
            _print_tables([suspect_table(correction.test)])
    if not correction.ok:
        if out is not None:
            typer.echo(f"apo-bench: nothing was corrected, so {out} was not written.", err=True)
        raise typer.Exit(NO_RESULT)
    if out is not None and plan is not None:
        _write(out, scenario, loaded.name, plan)
        if not as_json:
            typer.echo(f"Wrote {out}{moved and f': {moved}'}")


def _explained(observation: Observation, correction: Correction) -> Any:
    """What the contacts determine at corrected goals; None of corrections that leave contacts open, or of too many."""
    from apo_bench.correction.baselines.measured import gap_of
    from apo_bench.correction.explanation import explain as explained
    from apo_bench.correction.posterior import LARGEST_POSTERIOR

    if (
        not correction.ok
        or 6 * len(correction.goals) > LARGEST_POSTERIOR
        or gap_of(observation, correction.goals, correction.dropped) > _EXACT_M
    ):
        return None
    return explained(observation, correction.goals, correction.dropped)


def _corrector(method: str, doubt: str | None) -> Any:
    """The corrector `contact` with what it is to do in doubt, or any other by its name."""
    from apo_bench.correction.contact import ContactCorrector, Doubt

    if doubt is not None and doubt not in _DOUBTS:
        raise InputError(f"--if-doubtful {doubt} was given; {', '.join(_DOUBTS[:-1])} or {_DOUBTS[-1]} is allowed.")
    if method == "contact":
        return ContactCorrector(cast(Doubt, doubt or "warn"))
    if doubt is not None:
        raise InputError(f"--if-doubtful was given with --method {method}; only contact can be told what to do.")
    return method


def _planned(scenario: Scenario, observation: Observation, correction: Correction) -> tuple[Plan, str]:
    """The plan, and what of it is not as corrected, so that it fits; a simulator is asked only where it would not."""
    from apo_bench.prediction.failure import predict

    plan = correction.plan(observation)
    if not predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach).fails:
        return plan, ""
    from apo_bench.trial.fitting import fitting_plan

    found = fitting_plan(correction, observation, scenario)
    return found.plan, found.sentence


def _write(out: Path, scenario: str, name: str, plan: Plan) -> None:
    from apo_bench.files.csv_form import table
    from apo_bench.files.json_forms import plan_form, write_form

    if out.suffix.lower() == ".json":
        write_form(plan_form(plan, name if scenario == name else str(Path(scenario).resolve())), out)
        return
    try:
        out.write_text(table(plan.assembly, plan.goals), encoding="utf-8")
    except OSError as error:
        raise InputError(f"--out {out} cannot be written ({error.strerror}); choose another place.") from error


def _stated(deviation_mm: float, deviation_deg: float) -> str:
    return f"seen with a standard deviation of {deviation_mm:g} mm and {deviation_deg:g} deg per axis"


def _print_tables(tables: list[Any]) -> None:
    """Print tables as wide as the terminal, or wide enough to keep lines whole where there is none."""
    import sys

    from rich.console import Console

    console = Console(width=max(110 if sys.stdout.isatty() else 160, Console().width), highlight=False, markup=False)
    for table in tables:
        console.print()
        console.print(table)
