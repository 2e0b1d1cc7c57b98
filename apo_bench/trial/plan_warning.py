"""What speaks against a plan before it is carried out: the test of its correction, and the failure it predicts."""

from __future__ import annotations

from apo_bench.assembly.correction_record import Correction
from apo_bench.assembly.goals import Plan
from apo_bench.prediction.failure import predict
from apo_bench.scenario.scenario import Scenario


def plan_warning(scenario: Scenario, plan: Plan, correction: Correction | None) -> str:
    """`the stated noise does not explain the correction (p = 0.0004); foretold: operation 3 (stick) will fail: ..`.

    Empty if nothing speaks against it.

    Args:
        correction: What the corrector returned; None where none was asked.
    """
    sentences, test = [], None if correction is None else correction.test_after or correction.test
    if test is not None and not test.passes:
        sentences.append(f"the stated noise does not explain the correction (p = {test.p_value:.2g})")
    prediction = predict(plan, scenario.clearance_mm, scenario.thresholds, scenario.attach)
    if prediction.fails:
        sentences.append(f"foretold: {prediction.sentence}")
    return "; ".join(sentences)
