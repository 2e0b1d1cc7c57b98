"""The commands `apo-bench dataset make | estimate`: trials as data sets, and a pose estimator for images."""

import shlex
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import msgspec
import typer

from apo_bench.cli.shared import (
    Command,
    ScenarioArgument,
    add_options,
    check_output,
    make_group,
    make_path_argument,
    make_path_option,
    make_trial_options,
    name_write_errors,
)
from apo_bench.errors import require, require_known
from apo_bench.formats.bop_images import ImageConfig
from apo_bench.io import convert_typed, format_count
from apo_bench.records import FIRST_TRAINING_TRIAL, TrialConfig, open_secret_seed

_IMAGES = "bop"
"""The format of images."""
_HELP = """
Data sets to learn from, and images for pose estimators.

Examples:
  apo-bench dataset make stick_in_tower --episodes 100 --out data
  apo-bench dataset make stick_in_tower --format bop --episodes 20 --out images
"""
commands = make_group("dataset", _HELP)
_WITHOUT_EFFECT = ("noise_level", "noise", "method", "robot_error", "arm", "episode_type", "policy", "pixels")
"""Options without a meaning for images."""
_SPLITS = ("test", "val")
"""Splits of images; the seeds of the second are those of trials for training."""


def _make_image_options() -> Iterator[Parameter]:
    """Yield an option for each field of `ImageConfig`; None stands for its default."""
    hints = get_type_hints(ImageConfig, include_extras=True)
    for each in msgspec.structs.fields(ImageConfig):
        kind: Any = type(each.default)
        default = "" if kind is bool else f" Default: {each.default:g}."
        words = f"With --format bop: {hints[each.name].__metadata__[-1].description}{default}"
        option = Annotated[kind | None, typer.Option(f"--{each.name.replace('_', '-')}", help=words)]
        yield Parameter(each.name, Parameter.KEYWORD_ONLY, default=None, annotation=option)


@commands.command("make", cls=Command)
@add_options(
    [
        *make_trial_options(
            *("noise_level", "human_error_scale", "noise", "method", "clearance_mm", "robot_error", "arm"),
            "secret_seed",
        ),
        *_make_image_options(),
    ]
)
def dataset_make(
    scenario: ScenarioArgument,
    more: Annotated[list[str] | None, typer.Argument(metavar="SCENARIO", help="More scenarios.")] = None,
    *,
    out: Annotated[Path, make_path_option("Folder of the data set; it must not exist. Images are continued in it.")],
    episodes: Annotated[int, typer.Option(min=1, help="Trials of each scenario.")] = 10,
    seed: Annotated[
        int | None,
        typer.Option(help=f"First seed; default: {FIRST_TRAINING_TRIAL}, or 0 for test images."),
    ] = None,
    format: Annotated[str, typer.Option(help="parquet, lerobot, minari, or bop (images).")] = "parquet",
    episode_type: Annotated[
        str | None, typer.Option(help="replays (default), or insertions (APOInsert-v0 with a policy).")
    ] = None,
    policy: Annotated[
        str | None,
        typer.Option(help="Policy of insertions: expert (default), straight, spiral, searcher, probe, or module:name."),
    ] = None,
    pixels: Annotated[
        list[str] | None,
        typer.Option(help="Camera of videos of insertions, with --format lerobot: scene or wrist; may be repeated."),
    ] = None,
    split: Annotated[
        str, typer.Option(help="With --format bop: test, or val (images to fit noise to; other seeds).")
    ] = "test",
    workers: Annotated[int, typer.Option(min=1, help="With --format bop: number of processes.")] = 1,
    **options: Any,
) -> None:
    """Run trials and write observations, plans, true poses and frames, or images, as a data set.

    Examples:
      apo-bench dataset make dovetail --format lerobot --episode-type insertions --policy expert --out inserted
      apo-bench dataset make stick_in_tower --format bop --episodes 20 --out images
    """
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    images = {name: value for name in ImageConfig.__struct_fields__ if (value := options.pop(name)) is not None}
    secret = options["secret_seed_file"]
    if format != _IMAGES:
        only = [*images, *["secret_seed_file"] * (secret is not None)]
        require(not only, f"--{''.join(only[:1]).replace('_', '-')} needs --format bop.")
        trials = _list_trials(
            (scenario, *(more or ())), options, FIRST_TRAINING_TRIAL if seed is None else seed, episodes
        )
        _make_episodes(trials, out, command, format, episode_type or "replays", policy, pixels or ())
        return
    for name, value in (options | {"episode_type": episode_type, "policy": policy, "pixels": pixels}).items():
        flag = f"--{name.replace('_', '-')}"
        require(value is None or name not in _WITHOUT_EFFECT, f"{flag} has no effect on images; leave it out.")
    if secret is not None:
        open_secret_seed(secret, out)  # makes it if it does not exist
    require_known("split", split, _SPLITS)
    first = FIRST_TRAINING_TRIAL * _SPLITS.index(split) if seed is None else seed
    trials = _list_trials((scenario, *(more or ())), options, first, episodes)
    _make_images(trials, out, convert_typed(images, ImageConfig, "--format bop"), split, command, workers)


def _list_trials(names: Sequence[str], options: dict[str, Any], seed: int, episodes: int) -> list[TrialConfig]:
    """The trials of all scenarios with consecutive seeds."""
    from apo_bench import load_scenario
    from apo_bench.trial.request import Request, requested_settings

    require(len({*names}) == len(names), "each scenario may be named once; remove the second one.")
    trials = []
    for name in names:
        request = Request(name, options | {"seed": seed})
        config = requested_settings(request, load_scenario(name).clearance_mm)
        trials += [replace(config, seed=seed + k) for k in range(episodes)]
    return trials


def _make_episodes(
    trials: Sequence[TrialConfig],
    out: Path,
    command: str,
    format: str,
    episode_type: str,
    policy: str | None,
    pixels: Sequence[str],
) -> None:
    """Run trials and write a data set to learn from."""
    from apo_bench.benchmark.datasets.trial_dataset import make_dataset

    require(
        episode_type in ("replays", "insertions"), f"--episode-type must be replays or insertions, got {episode_type}."
    )
    seed = trials[0].seed
    require(
        seed >= FIRST_TRAINING_TRIAL,
        f"--seed must be at least {FIRST_TRAINING_TRIAL}, since smaller seeds are for evaluation, got {seed}.",
    )
    insertions = episode_type == "insertions"
    require(policy is None or insertions, f"--policy {policy} belongs to insertions; add --episode-type insertions.")
    led_by = (policy or "expert") if insertions else None
    with name_write_errors():
        made, right = make_dataset(trials, out, command, format, led_by, partial(typer.echo, err=True), pixels)
    typer.echo(f"{format_count(made, 'trial')}, {right} successful; {out / 'README.md'} describes them")


def _make_images(
    trials: Sequence[TrialConfig], out: Path, config: ImageConfig, split: str, command: str, workers: int
) -> None:
    """Write the images of trials."""
    from apo_bench.benchmark.datasets.images.make import make_images

    for trial in (trials[0], trials[-1]):
        is_test = trial.seed < FIRST_TRAINING_TRIAL
        require(
            is_test == (split == "test"),
            f"seeds of test images are below {FIRST_TRAINING_TRIAL}, those of val images are not; {trial.seed} was "
            f"given for {split}.",
        )
    with name_write_errors():
        made = make_images(
            trials,
            out,
            config,
            split=split,
            command=command,
            workers=workers,
            say=partial(typer.echo, err=True),
        )
    typer.echo(f"Images of {format_count(made, 'trial')} in {out}; {out / 'README.md'} describes them")


@commands.command("estimate", cls=Command)
def dataset_estimate(
    images: Annotated[Path, make_path_argument("IMAGES", "Folder of `dataset make --format bop`.")],
    *,
    out: Annotated[Path, make_path_option("Results file (BOP format) in the folder of the images: .csv.")],
) -> None:
    """Estimate the poses of parts in images: models are fitted to the depth of each detection, without weights.

    Examples:
      apo-bench dataset estimate images --out images/icp.csv
      apo-bench score contact --poses images/icp.csv --out icp.json
    """
    from apo_bench.benchmark.datasets.images.estimate import estimate_images

    check_output(out, "--out", ".csv")
    made = estimate_images(images, out)
    typer.echo(f"{format_count(made, 'estimate')} in {out}")
