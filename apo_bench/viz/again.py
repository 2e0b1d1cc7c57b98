"""A trial of a sweep, run once more."""

from apo_bench.records import TrialConfig, TrialRecord
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial.fingerprint import config_hash, content_hash
from apo_bench.trial.request import Request, run_settings
from apo_bench.trial.rollout import Rollout


def why_not_again(row: TrialRecord, spec: TrialConfig) -> str:
    """Why the settings of a row would not give the same trial again; empty if they would."""
    content = content_hash(load_scenario(spec.scenario), spec.scenario, find_arm(spec.arm).files)
    if config_hash(spec, content) == row.get("config_hash"):
        return ""
    secret = row.get("secret_seed") is not None and spec.secret_seed is None
    return "its salt was not given (--secret-seed-file)" if secret else "another version or other files made it"


def run_again(spec: TrialConfig) -> tuple[TrialRecord, Rollout | None]:
    """The row, and what is to be seen of the trial; None if nothing was replayed."""
    rollouts = list[Rollout]()
    row = run_settings(Request(spec.scenario), spec, rollouts.append)
    return row, rollouts[0] if rollouts else None
