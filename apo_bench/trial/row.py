"""A row: what was asked for, and how it ended; what only a replay can say is filled in by `trial`."""

from __future__ import annotations

from dataclasses import asdict

from apo_bench.assembly.goals import Outcome
from apo_bench.io.plain_text import clean
from apo_bench.records.row import LONGEST_SENTENCE, Row
from apo_bench.records.settings import ENV_ID, ROW, TrialSettings
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.confidence import UNKNOWN
from apo_bench.trial.recognised import UNCOUNTED


def head(spec: TrialSettings, scenario: Scenario, hashed: str) -> Row:
    """What was asked for.

    Args:
        hashed: From `spec_hash`.
    """
    return {
        "schema": ROW,
        "env_id": ENV_ID,
        "spec_hash": hashed,
        "scenario": scenario.name,
        "level": spec.level_mm,
        "level_deg": spec.level_deg,
        "careless": spec.careless,
        "clearance_mm": spec.clearance_mm,
        "eye": spec.eye,
        "noise": spec.noise,
        "grasp": spec.grasp,
        "arm": spec.arm,
        "relations": spec.relations,
        "method": spec.method,
        "seed": spec.seed,
        "salt": None if spec.salt is None else spec.salt.hash,
        "timestep_s": spec.timestep_s,
        "fidelity": spec.fidelity,
        "thresholds": asdict(scenario.thresholds),
    }


def result(end: Outcome, *, success: bool | None) -> Row:
    """The rest of a row of which nothing but its ending is known."""
    return {
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": end.stage if end.failed else None,
        "failure_code": end.code if end.failed else None,
        "failure_operation": None if end.operation is None else end.operation + 1,
        "sentence": clean(end.sentence)[:LONGEST_SENTENCE],
        "as_demonstrated_code": None,
        "conditions": None,
        "worst_gap_mm": None,
        "worst_angle_deg": None,
        "least_overlap": None,
        "penetration_mm": None,
        "pushed_mm": None,
        "freed": None,
        "tried": None,
        "extra_operations": None,
        "predicted": None,
        "gap_before_mm": None,
        "gap_after_mm": None,
        **UNKNOWN,
        **UNCOUNTED,
        "reached": None,
        "pose_error_fixed_mm": None,
        "pose_error_free_mm": None,
        "peak_force_n": None,
        "sim_seconds": None,
    }
