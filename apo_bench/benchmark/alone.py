"""One trial in a process of its own, as sweeps run it: what ends the process or takes too long is a row too."""

from __future__ import annotations

from apo_bench.benchmark.crew import check_limit, spread
from apo_bench.benchmark.fingerprint import content_hash
from apo_bench.benchmark.grid import Unit
from apo_bench.benchmark.row import Row
from apo_bench.benchmark.spec import TrialSpec
from apo_bench.benchmark.stopping import listening
from apo_bench.benchmark.terms import Terms, versions
from apo_bench.benchmark.worker import Timing, in_time
from apo_bench.correction.own import LIMIT_S, check_correctors
from apo_bench.scenario_file import load_scenario
from apo_bench.simulation.arm import find_arm


def run_alone(spec: TrialSpec, limit_s: float, corrector_limit_s: float = LIMIT_S) -> Row:
    """The row that a sweep with this limit of wall time per trial has for the trial.

    Raises:
        InputError: The request cannot be honoured.
        RuntimeError: The trial could not be run.
        KeyboardInterrupt: A signal asked for an end.
    """
    check_limit(limit_s)
    check_correctors((spec.method,), corrector_limit_s)
    content = content_hash(load_scenario(spec.scenario), spec.scenario, find_arm(spec.arm).mjcf)
    rows: list[Row] = []

    def emit(row: Row, timing: Timing) -> None:
        rows.append(in_time(row, timing, limit_s))

    with listening() as check:
        terms = Terms({spec.scenario: content}, versions(), corrector_limit_s)
        spread((Unit((spec,)),), terms, workers=1, limit_s=limit_s, emit=emit, check=check)
    return rows[0]
