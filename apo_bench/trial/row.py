"""A row: what was asked for, and how it ended; what only a replay can say is filled in by `trial`.

A trial always has one: where its corrector misbehaves, its process dies or its time is over, a failed one.
"""

import re
from dataclasses import asdict
from itertools import dropwhile
from typing import cast

from apo_bench.assembly import Outcome
from apo_bench.io.plain_text import clean
from apo_bench.records import ENV_ID, LONGEST_SENTENCE, ROW, ROW_FIELDS, Row, TrialSettings, sentence, setting_columns
from apo_bench.scenario import Scenario, load_scenario
from apo_bench.trial.fingerprint import spec_hash

_OUTCOME_COLUMNS = tuple(dropwhile(lambda column: column != "success", ROW_FIELDS))
"""Columns of what came out."""
_ADDRESS = re.compile(r"\b0x[0-9a-fA-F]+")


def head(spec: TrialSettings, scenario: Scenario, hashed: str) -> Row:
    """What was asked for.

    Args:
        hashed: From `spec_hash`.
    """
    versions = {"schema": ROW, "env_id": ENV_ID, "spec_hash": hashed}
    columns = setting_columns(spec, scenario.name)
    return cast(Row, versions | columns | {"thresholds": asdict(scenario.thresholds)})


def result(end: Outcome, *, success: bool | None) -> Row:
    """The rest of a row of which nothing but its ending is known."""
    known: Row = {
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": end.stage if end.failed else None,
        "failure_code": end.code if end.failed else None,
        "failure_operation": None if end.operation is None else end.operation + 1,
        "sentence": clean(end.sentence)[:LONGEST_SENTENCE],
    }
    return cast(Row, dict.fromkeys(_OUTCOME_COLUMNS)) | known


def lost(spec: TrialSettings, content: str, code: str, what: str = "trial") -> Row:
    """The failed row of a trial whose process, or that of its corrector, died (`worker_died`) or took too long.

    Nothing is compiled for it, and it says nothing of wall times, so that it is the same wherever it happens.

    Args:
        content: From the lock of the sweep: `lock.content[spec.scenario]`.
        code: `worker_died` or `time_limit`.
        what: Whose process died or whose limit it was: `trial` or `corrector`.
    """
    return _failed(spec, content, None, Outcome("worker", code, None, sentence(code, what=what)))


def misbehaved(spec: TrialSettings, content: str, demonstration: str, why: str) -> Row:
    """The failed row of a trial whose corrector raised an error or returned what it must not.

    Args:
        why: What it did; addresses of objects, which differ from run to run, are left out.
    """
    why = _ADDRESS.sub("0x...", why.encode(errors="replace").decode())
    return _failed(spec, content, demonstration, Outcome("correct", "raised", None, why))


def _failed(spec: TrialSettings, content: str, demonstration: str | None, end: Outcome) -> Row:
    settings = head(spec, load_scenario(spec.scenario), spec_hash(spec, content))
    return settings | {"demonstration": demonstration} | result(end, success=False)
