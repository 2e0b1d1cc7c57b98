"""The command `apo-bench view`: a scenario or a finished trial, step by step."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import Port, SecretSeedFile, print_columns
from apo_bench.errors import require


def view_command(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A scenario, by its name or file, or the folder of a sweep.")
    ],
    trial: Annotated[
        int | None, typer.Option(help="Line of trials.jsonl in the folder, from 1; default: the first failure.")
    ] = None,
    port: Port = None,
    secret_seed_file: SecretSeedFile = None,
) -> None:
    """Step through a scenario, or through a finished trial, which runs again for it.

    Examples:
      apo-bench view stick_in_tower
      apo-bench view runs/mine --trial 12 --port 8080
    """
    from apo_bench import build_scene, load_scenario
    from apo_bench.trial.rollout import scenario_story
    from apo_bench.viz.choose_viewer import choose_display, view
    from apo_bench.viz.repeat_trial import repeat_trial
    from apo_bench.viz.trial_text import format_summary

    is_sweep = Path(target).is_dir()
    require(
        is_sweep or (trial, secret_seed_file) == (None, None),
        f"--trial and --secret-seed-file belong to the folder of a sweep, got {target}; leave them out.",
    )
    display = choose_display(port)
    if is_sweep:
        record, rollout = repeat_trial(Path(target), trial, secret_seed_file)
        print_columns(format_summary(record, record["scenario"]))
    else:
        rollout = scenario_story(build_scene(load_scenario(target)))
    view(rollout, display, port, typer.echo)
