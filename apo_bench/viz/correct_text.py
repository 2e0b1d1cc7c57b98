"""A correction in words and tables for people, and as one JSON object."""

from typing import Any

import numpy as np

from apo_bench.assembly import Consistency, Correction, Observation
from apo_bench.correction.explanation import Explanation
from apo_bench.formats.json_forms import covariance_form, pose_form
from apo_bench.geometry import Array, pose
from apo_bench.viz.explain_text import explanation_form, hypothesis_forms, hypothesis_lines, sentences, total
from apo_bench.viz.tables import form_table

_CORRECTION = "apo-bench/correction/1"
_TOO_GOOD = 1e-6  # a p-value nearer to 1 happens to nobody whose noise is what was stated ...
_TESTED = 3  # ... if at least so many degrees of freedom are tested
_POSE_COLUMNS = {
    "operation": "d",
    "part": "",
    "position_mm": "z.3f",
    "quaternion_wxyz": "z.6f",
    "moved_mm": ".3f",
    "turned_deg": ".3f",
}
_SUSPECT_COLUMNS = {
    "relation": "",
    "made": "d",
    "contacts": "",
    "chi_square": ".1f",
    "freedom": "d",
    "p_value": ".2g",
    "may_be_wrong": "",
}


def correction_lines(correction: Correction, explanation: Explanation | None) -> list[tuple[str, str]]:
    """How it ended, the gaps, the test, what is free: name and text of each line."""
    contradictory = correction.status == "inconsistent"
    facts = {
        "ended": [correction.sentence if correction.ok else f"{correction.status}: {correction.sentence}"],
        "contact gap": [_gaps(correction)],
        "test": [_test(correction.test, contradictory)],
        "left out": [", ".join(correction.dropped)],
        "test without": [_test(correction.test_after, contradictory)],
        "may be": hypothesis_lines(correction.hypotheses),
        "contacts": [] if explanation is None else [total(explanation)],
        "free": [] if explanation is None else sentences(explanation),
    }
    return [("" if i else name, text) for name, texts in facts.items() for i, text in enumerate(texts) if text]


def correction_tables(form: dict[str, Any]) -> list[Any]:
    """Tables of `rich` of what `correction_form` says: corrected poses, and the suspects."""
    tables = []
    if form["operations"] is not None:
        tables.append(form_table(form["operations"], _POSE_COLUMNS))
    if form["test"] is not None and form["test"]["suspects"]:
        tables.append(form_table(form["test"]["suspects"], _SUSPECT_COLUMNS))
    return tables


def correction_form(
    scenario: str,
    method: str,
    observation: Observation,
    correction: Correction,
    explanation: Explanation | None,
    assumed: bool,
) -> dict[str, Any]:
    """What `json` can write: mm, degrees, wxyz, operations from 1; poses only of a correction that converged."""
    return {
        "schema": _CORRECTION,
        "scenario": scenario,
        "method": method,
        "status": correction.status,
        "sentence": correction.sentence,
        "gap_before_mm": _number(correction.gap_before_m * 1e3),
        "gap_after_mm": _number(correction.gap_after_m * 1e3) if correction.ok else None,
        "rank": correction.rank,
        "freedom": None if explanation is None else explanation.freedom,
        "deviations_assumed": assumed,
        "operations": _operations_form(observation, correction) if correction.ok else None,
        "test": _test_form(correction.test),
        "test_after": _test_form(correction.test_after),
        "dropped": list(correction.dropped),
        "left_out": [k + 1 for k in correction.left_out],
        "hypotheses": hypothesis_forms(correction.hypotheses),
        "explanation": None if explanation is None else explanation_form(scenario, explanation),
    }


def _gaps(correction: Correction) -> str:
    """The largest gap before and, of a correction that converged, after."""
    known = np.isfinite(correction.gap_before_m)  # it is not where an operation was not seen
    before = f"{correction.gap_before_m * 1e3:.3f} mm as seen" if known else "unknown as seen"
    if not correction.ok:
        return before
    of = ", relations that were left out counted too" if correction.dropped else ""
    return f"{before}, {correction.gap_after_m * 1e3:.3f} mm corrected{of}"


def _test(test: Consistency | None, contradictory: bool) -> str:
    if test is None:
        return ""
    numbers = f"chi-square {test.chi_square:.1f}, {test.freedom} degrees of freedom, p {test.p_value:.2g}"
    if test.passes and contradictory:
        return f"{numbers}, but the contacts contradict each other"
    if test.passes and test.p_value > 1.0 - _TOO_GOOD and test.freedom >= _TESTED:
        return f"{numbers}: the stated noise is far larger than what was seen; are the units right?"
    if test.passes:
        return f"{numbers}: explained by the stated noise"
    named = [suspect.relation for suspect in test.ambiguous]
    who = f"; {'one of ' * (len(named) > 1)}{', '.join(named)} may be wrong" if named else ""
    if contradictory:
        return f"{numbers}: the contacts contradict each other{who}"
    return f"{numbers}: longer than the stated noise explains{who}"


def _moved(observation: Observation, correction: Correction) -> Array:
    """How far each goal was moved and turned, (n, 2), [mm, degrees]."""
    # D = seen^-1 corrected: its log ends with the turn, whose size is an angle
    D = pose.inverse(observation.poses) @ correction.poses
    return np.column_stack(
        [np.linalg.norm(D[..., :3, 3], axis=-1) * 1e3, np.degrees(np.linalg.norm(pose.log(D)[..., 3:], axis=-1))]
    )


def _operations_form(observation: Observation, correction: Correction) -> list[dict[str, Any]]:
    moved = _moved(observation, correction)
    return [
        {
            "operation": k + 1,
            "part": operation.main,
            **pose_form(correction.poses[k]),
            "moved_mm": float(moved[k, 0]),
            "turned_deg": float(moved[k, 1]),
            "covariance_mm_deg": None if correction.covariance is None else covariance_form(correction.covariance[k]),
        }
        for k, operation in enumerate(observation.assembly.operations)
    ]


def _test_form(test: Consistency | None) -> dict[str, Any] | None:
    return test and {
        "chi_square": _number(test.chi_square),
        "freedom": test.freedom,
        "p_value": test.p_value,
        "level": test.level,
        "passes": test.passes,
        "suspects": [
            {
                "relation": suspect.relation,
                "made": suspect.made + 1,
                "contacts": list(map(str, suspect.contacts)),
                "chi_square": _number(suspect.chi_square),
                "freedom": suspect.freedom,
                "p_value": suspect.p_value,
                "may_be_wrong": suspect in test.ambiguous,
            }
            for suspect in test.suspects
        ],
        "ambiguous": [suspect.relation for suspect in test.ambiguous],
    }


def _number(x: float) -> float | None:
    """JSON knows no infinity."""
    return float(x) if np.isfinite(x) else None
