"""Start and end the record of a trial; a trial always has one, also if its process dies or its corrector misbehaves."""

import re
from dataclasses import asdict
from itertools import dropwhile
from typing import cast

from apo_bench.assembly import Outcome
from apo_bench.io import clean
from apo_bench.records import (
    ENV_ID,
    LONGEST_SENTENCE,
    RECORD_FIELDS,
    RECORD_SCHEMA,
    TrialConfig,
    TrialRecord,
    describe_outcome,
    list_setting_columns,
)
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.trial.fingerprint import config_hash

_OUTCOME_COLUMNS = tuple(dropwhile(lambda column: column != "success", RECORD_FIELDS))
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")


def start_record(config: TrialConfig, scenario: Scenario, hashed: str) -> TrialRecord:
    """The columns of the settings.

    Args:
        hashed: From `config_hash`.
    """
    versions = {"schema": RECORD_SCHEMA, "env_id": ENV_ID, "config_hash": hashed}
    settings = list_setting_columns(config, scenario.name)
    return cast(TrialRecord, versions | settings | {"thresholds": asdict(scenario.thresholds)})


def end_record(end: Outcome, *, success: bool | None) -> TrialRecord:
    """The outcome columns of a trial of which only the ending is known; all others are null."""
    known: TrialRecord = {
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": end.stage if end.failed else None,
        "failure_code": end.code if end.failed else None,
        "failure_operation": None if end.operation is None else end.operation + 1,
        "sentence": clean(end.sentence)[:LONGEST_SENTENCE],
    }
    return cast(TrialRecord, dict.fromkeys(_OUTCOME_COLUMNS)) | known


def record_lost_trial(config: TrialConfig, content: str, code: str) -> TrialRecord:
    """The failed record of a trial whose process died (`worker_died`) or took too long (`time_limit`).

    It compiles nothing and has no wall times, so it is the same wherever the trial was lost.

    Args:
        content: From `content_hash`.
    """
    return _record_failure(config, content, None, Outcome("worker", code, None, describe_outcome(code)))


def record_misbehaviour(config: TrialConfig, content: str, demonstration: str, why: str) -> TrialRecord:
    """The failed record of a trial whose corrector raised an error or returned what it must not.

    Args:
        why: What it did; addresses of objects, which differ from run to run, are left out.
    """
    why = _ADDRESS.sub("0x...", why.encode(errors="replace").decode())
    return _record_failure(config, content, demonstration, Outcome("correct", "raised", None, why))


def _record_failure(config: TrialConfig, content: str, demonstration: str | None, end: Outcome) -> TrialRecord:
    record = start_record(config, load_scenario(config.scenario), config_hash(config, content))
    return record | {"demonstration": demonstration} | end_record(end, success=False)
