"""A finished trial of a sweep, run again to be looked at."""

from dataclasses import replace
from pathlib import Path

from apo_bench.errors import InputError
from apo_bench.io import each_line
from apo_bench.records import TrialRecord, read_secret_seed, settings_of
from apo_bench.records.own_code import own_code
from apo_bench.records.run.run_file import read_run, scenario_files
from apo_bench.records.run.validation import record_of
from apo_bench.trial.rollout import Rollout
from apo_bench.viz.again import run_again, why_not_again


def trial_again(folder: Path, number: int | None, secret_seed_file: Path | None = None) -> tuple[TrialRecord, Rollout]:
    """A trial of a sweep and its row.

    Args:
        number: Of its line in `trials.jsonl`, from 1; None: the first failure, or the first trial.
        salt_file: Of a salted sweep.

    Raises:
        InputError: No such trial.
        RuntimeError: It cannot be run again, or had nothing to see.
    """
    number, row = _chosen(folder, number)
    if named := own_code(row):
        raise RuntimeError(
            f"trial {number} names code that does not come with the package ({', '.join(named)}), which no file makes "
            "run; give it to `apo-bench run .. --view` yourself."
        )
    name = row["scenario"]
    spec = settings_of(row, scenario_files(read_run(folder)).get(name, name))
    if secret_seed_file is not None:
        spec = replace(spec, secret_seed=read_secret_seed(secret_seed_file))
    if changed := why_not_again(row, spec):
        raise RuntimeError(f"trial {number} of {folder} cannot be run again: {changed}.")
    again, rollout = run_again(spec)
    if rollout is None:
        raise RuntimeError(f"in trial {number} nothing was replayed: {again['sentence']}.")
    return again, rollout


def _chosen(folder: Path, number: int | None) -> tuple[int, TrialRecord]:
    path = folder / "trials.jsonl"
    first = None
    k = 0
    for k, line in each_line(path, "table of trials"):
        if number in (None, k):
            row = record_of(line, f"{path}, line {k}")
            if number is not None or (row["success"] is False and row["sim_time_s"] is not None):
                return k, row
            first = first or (k, row)
    if first is None:
        wanted = "there is no trial" if number is None else f"--trial {number} was given; 1 to {k} are there"
        raise InputError(f"{path}: {wanted}.")
    return first
