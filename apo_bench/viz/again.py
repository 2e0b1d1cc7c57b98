"""A trial of a sweep, run once more."""

from apo_bench.records import Row, TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.request import Request, run_settings
from apo_bench.trial.story import Story


def why_not_again(row: Row, spec: TrialSettings) -> str:
    """Why the settings of a row would not give the same trial again; empty if they would."""
    content = content_hash(load_scenario(spec.scenario), spec.scenario, find_arm(spec.arm).files)
    if spec_hash(spec, content) == row.get("spec_hash"):
        return ""
    secret = row.get("salt") is not None and spec.salt is None
    return "its salt was not given (--salt-file)" if secret else "other code or assets made it"


def run_again(spec: TrialSettings) -> tuple[Row, Story | None]:
    """The row, and what is to be seen of the trial; None if nothing was replayed."""
    stories = list[Story]()
    row = run_settings(Request(spec.scenario), spec, stories.append)
    return row, stories[0] if stories else None
