"""What speaks against a plan before it is carried out: the test of its correction, and the failure it foretells."""

from __future__ import annotations

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Plan
from apo_bench.prediction.failure import predict
from apo_bench.scenario.scenario import Scenario


def misgivings(scenario: Scenario, plan: Plan, made: Correction | None) -> str:
    """`the stated noise does not explain the correction (p = 0.0004); foretold: operation 3 (stick) will fail: ..`.

    Empty if nothing speaks against it.

    Args:
        made: What the corrector returned; None where none was asked.
    """
    said, test = [], None if made is None else made.test_after or made.test
    if test is not None and not test.passes:
        said.append(f"the stated noise does not explain the correction (p = {test.p_value:.2g})")
    foretold = predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach)
    if foretold.fails:
        said.append(f"foretold: {foretold.sentence}")
    return "; ".join(said)
