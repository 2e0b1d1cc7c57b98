"""Run a finished trial of a sweep again from its record."""

from dataclasses import replace
from pathlib import Path

from apo_bench.errors import InputError
from apo_bench.io import read_lines
from apo_bench.records import TrialRecord, read_secret_seed, restore_settings
from apo_bench.records.run.run_file import list_scenario_files, read_run
from apo_bench.records.run.validation import decode_record
from apo_bench.records.user_code import list_user_code
from apo_bench.scenario.scenario_file import load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash
from apo_bench.trial.request import Request, run_settings
from apo_bench.trial.rollout import Rollout


def repeat_trial(folder: Path, number: int | None, secret_seed_file: Path | None = None) -> tuple[TrialRecord, Rollout]:
    """Run a trial of a sweep again.

    Args:
        folder: Folder of the sweep.
        number: Line of the trial in `trials.jsonl`, from 1; None: the first failure, or the first trial.
        secret_seed_file: File of the secret seed, if the sweep has one.

    Returns:
        The record of the repeated trial, and its rollout.

    Raises:
        InputError: There is no such trial.
        RuntimeError: The trial would differ from the recorded one, or the robot did not replay anything.
    """
    number, record = _choose_trial(folder, number)
    if code := list_user_code(record):
        raise RuntimeError(
            f"trial {number} names code that does not come with the package ({', '.join(code)}), and no file makes it "
            "run; run the trial yourself with `apo-bench run .. --view`."
        )
    name = record["scenario"]
    config = restore_settings(record, list_scenario_files(read_run(folder)).get(name, name))
    if secret_seed_file is not None:
        config = replace(config, secret_seed=read_secret_seed(secret_seed_file))
    # the hash shows whether the same files and version are used
    content = compute_content_hash(load_scenario(config.scenario), config.scenario, find_arm(config.arm).files)
    if compute_config_hash(config, content) != record.get("config_hash"):
        secret = record.get("secret_seed") is not None and config.secret_seed is None
        reason = (
            "its secret seed is missing (--secret-seed-file)" if secret else "another version or other files made it"
        )
        raise RuntimeError(f"trial {number} of {folder} cannot run again: {reason}.")
    rollouts = list[Rollout]()
    again = run_settings(Request(config.scenario), config, rollouts.append)
    if not rollouts:
        raise RuntimeError(f"the robot did not replay anything in trial {number}: {again['sentence']}.")
    return again, rollouts[0]


def _choose_trial(folder: Path, number: int | None) -> tuple[int, TrialRecord]:
    """Return line number and record of the trial; None chooses the first replayed failure, else the first trial."""
    path = folder / "trials.jsonl"
    first = None
    count = 0
    for count, line in read_lines(path, "table of trials"):
        if number in (None, count):
            record = decode_record(line, f"{path}, line {count}")
            # sim_time_s is None if nothing was replayed
            if number is not None or (record["success"] is False and record["sim_time_s"] is not None):
                return count, record
            first = first or (count, record)
    if first is None:
        raise InputError(f"{path}: --trial must be a number from 1 to {count}, got {number}.")
    return first
