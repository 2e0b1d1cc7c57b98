"""A row: what was asked for, and how it ended; what only a replay can say is filled in by `trial`."""

from dataclasses import asdict
from itertools import dropwhile
from typing import cast

from apo_bench.assembly.reached import Outcome
from apo_bench.io.plain_text import clean
from apo_bench.records.row import LONGEST_SENTENCE, ROW_FIELDS, Row
from apo_bench.records.setting_columns import setting_columns
from apo_bench.records.settings import ENV_ID, ROW, TrialSettings
from apo_bench.scenario.scenario import Scenario

_FOUND = tuple(dropwhile(lambda column: column != "success", ROW_FIELDS))
"""Columns of what came out."""


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
    return cast(Row, dict.fromkeys(_FOUND)) | known
