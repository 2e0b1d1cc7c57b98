"""Start and end the record of a trial; every trial gets one, even if its process dies or its corrector misbehaves."""

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
from apo_bench.trial.fingerprint import compute_config_hash

_OUTCOME_COLUMNS = tuple(dropwhile(lambda column: column != "success", RECORD_FIELDS))
"""Columns of a record from `success` on: they state what happened, those before it the settings."""
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")
"""Address of an object in an error message, which differs from run to run."""


def start_record(config: TrialConfig, scenario: Scenario, hashed: str) -> TrialRecord:
    """The settings columns of a record, with its identity and the judge's thresholds.

    Args:
        hashed: From `compute_config_hash`.
    """
    versions = {"schema": RECORD_SCHEMA, "env_id": ENV_ID, "config_hash": hashed}
    settings = list_setting_columns(config, scenario.name)
    return cast(TrialRecord, versions | settings | {"thresholds": asdict(scenario.thresholds)})


def end_record(end: Outcome, *, success: bool | None) -> TrialRecord:
    """The outcome columns of a trial whose ending alone is known; all other outcome columns are null.

    Args:
        success: None if the trial does not count, since the demonstration itself failed.
    """
    known: TrialRecord = {
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": end.stage if end.failed else None,
        "failure_code": end.code if end.failed else None,
        "failure_operation": None if end.operation is None else end.operation + 1,  # counted from 1
        "sentence": clean(end.sentence)[:LONGEST_SENTENCE],
    }
    return cast(TrialRecord, dict.fromkeys(_OUTCOME_COLUMNS)) | known


def record_lost_trial(config: TrialConfig, content: str, code: str) -> TrialRecord:
    """The failed record of a trial whose process died (`worker_died`) or took too long (`time_limit`).

    It has no wall times and compiles no scene, so it does not depend on the machine that lost the trial.

    Args:
        content: From `compute_content_hash`.
    """
    return _record_failure(config, content, None, Outcome("worker", code, None, describe_outcome(code)))


def record_corrector_failure(config: TrialConfig, content: str, demonstration: str, why: str) -> TrialRecord:
    """The failed record of a trial whose corrector raised an error or returned an invalid value.

    Args:
        demonstration: Code of the demonstration, `ok` or why it failed.
        why: The error; addresses of objects, which differ from run to run, are masked.
    """
    # Encoding replaces lone surrogates, which no file can hold.
    why = _ADDRESS.sub("0x...", why.encode(errors="replace").decode())
    return _record_failure(config, content, demonstration, Outcome("correct", "raised", None, why))


def _record_failure(config: TrialConfig, content: str, demonstration: str | None, end: Outcome) -> TrialRecord:
    """A record with settings, the code of the demonstration (None if unknown) and a failure."""
    record = start_record(config, load_scenario(config.scenario), compute_config_hash(config, content))
    return record | {"demonstration": demonstration} | end_record(end, success=False)
