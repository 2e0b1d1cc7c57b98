"""A correction as lines of text, rows of tables, and one JSON object."""

from typing import Any

import numpy as np

from apo_bench.assembly import Consistency, Correction, Observation
from apo_bench.correction.explanation import Explanation
from apo_bench.formats.json_forms import make_covariance_form, make_pose_form
from apo_bench.geometry import pose
from apo_bench.viz.dof_text import format_hypotheses, make_dof_form, make_hypothesis_forms
from apo_bench.viz.form_text import list_facts

_SCHEMA = "apo-bench/correction/1"
_TOO_GOOD = 1e-6  # a p-value above 1 - _TOO_GOOD shows that the stated noise is far too large ...
_TESTED = 3  # ... if the test has at least this many degrees of freedom
_TABLES = ("schema", "operations", "test", "test_after", "hypotheses", "explanation")
"""Keys of a form that are tables or objects, not lines."""
POSE_COLUMNS = {
    "operation": "d",
    "part": "",
    "position_mm": "z.3f",
    "quaternion_wxyz": "z.6f",
    "moved_mm": ".3f",
    "turned_deg": ".3f",
}
"""Columns of the corrected poses: keys of an operation in `make_correction_form`, with their formats."""
SUSPECT_COLUMNS = {
    "relation": "",
    "made": "d",
    "contacts": "",
    "chi_square": ".1f",
    "freedom": "d",
    "p_value": ".2g",
    "may_be_wrong": "",
}
"""Columns of the relations that may be wrong: keys of a suspect in `make_correction_form`, with their formats."""


def format_correction(form: dict[str, Any], correction: Correction) -> list[tuple[str, str]]:
    """Return name and text of each line: the facts of `make_correction_form`, the two tests, the hypotheses."""
    contradictory = correction.status == "inconsistent"
    more = {
        "test": _describe_test(correction.test, contradictory),
        "test_without": _describe_test(correction.test_after, contradictory),
        "hypotheses": format_hypotheses(correction.hypotheses),
    }
    return list_facts(form, _TABLES) + list_facts(more)


def make_correction_form(
    scenario: str,
    method: str,
    observation: Observation,
    correction: Correction,
    explanation: Explanation | None,
    assumed: bool,
) -> dict[str, Any]:
    """Return a correction as a JSON object: mm, degrees, quaternions wxyz, operations from 1.

    Args:
        explanation: Free and fixed directions of the corrected poses; None leaves these entries null.
        assumed: Whether the standard deviations of the observation were assumed, not stated.

    Returns:
        The object; `operations` is null unless the correction converged.
    """
    return {
        "schema": _SCHEMA,
        "scenario": scenario,
        "method": method,
        "status": correction.status,
        "sentence": correction.sentence,
        "gap_before_mm": _replace_infinite(correction.gap_before_m * 1e3),
        "gap_after_mm": _replace_infinite(correction.gap_after_m * 1e3) if correction.ok else None,
        "rank": correction.rank,
        "freedom": None if explanation is None else explanation.freedom,
        "deviations_assumed": assumed,
        "operations": _list_operation_forms(observation, correction) if correction.ok else None,
        "test": _make_test_form(correction.test),
        "test_after": _make_test_form(correction.test_after),
        "dropped": list(correction.dropped),
        "left_out": [k + 1 for k in correction.left_out],
        "hypotheses": make_hypothesis_forms(correction.hypotheses),
        "explanation": None if explanation is None else make_dof_form(scenario, explanation),
    }


def _describe_test(test: Consistency | None, contradictory: bool) -> str | None:
    """Describe a test and its verdict in words; None without a test."""
    if test is None:
        return None
    names = [suspect.relation for suspect in test.ambiguous]
    who = f"; {'one of ' * (len(names) > 1)}{', '.join(names)} may be wrong" if names else ""
    verdict = "explained by the stated noise"
    if contradictory:
        verdict = f"the contacts contradict each other{who}"
    elif not test.passes:
        verdict = f"longer than the stated noise explains{who}"
    elif test.p_value > 1.0 - _TOO_GOOD and test.freedom >= _TESTED:
        verdict = "the stated noise is far larger than the correction; are the units right?"
    return f"chi-square {test.chi_square:.1f}, {test.freedom} degrees of freedom, p {test.p_value:.2g}: {verdict}"


def _list_operation_forms(observation: Observation, correction: Correction) -> list[dict[str, Any]]:
    """Return the corrected pose of each operation, with its distance from the observed pose and its covariance."""
    # D = observed^-1 corrected; the last three numbers of its log are a rotation vector, whose norm is the angle
    D = pose.inverse(observation.poses) @ correction.poses
    moved_mm = np.linalg.norm(D[:, :3, 3], axis=-1) * 1e3
    turned_deg = np.degrees(np.linalg.norm(pose.log(D)[:, 3:], axis=-1))
    return [
        {
            "operation": k + 1,
            "part": operation.main,
            **make_pose_form(correction.poses[k]),
            "moved_mm": float(moved_mm[k]),
            "turned_deg": float(turned_deg[k]),
            "covariance_mm_deg": None
            if correction.covariance is None
            else make_covariance_form(correction.covariance[k]),
        }
        for k, operation in enumerate(observation.assembly.operations)
    ]


def _make_test_form(test: Consistency | None) -> dict[str, Any] | None:
    """Return a consistency test as a JSON object; None without a test."""
    return test and {
        "chi_square": _replace_infinite(test.chi_square),
        "freedom": test.freedom,
        "p_value": test.p_value,
        "level": test.level,
        "passes": test.passes,
        "suspects": [
            suspect._asdict()
            | {
                "made": suspect.made + 1,
                "contacts": list(map(str, suspect.contacts)),
                "chi_square": _replace_infinite(suspect.chi_square),
                "may_be_wrong": suspect in test.ambiguous,
            }
            for suspect in test.suspects
        ],
        "ambiguous": [suspect.relation for suspect in test.ambiguous],
    }


def _replace_infinite(x: float) -> float | None:
    """Return a finite number, or None, since JSON has no infinity."""
    return float(x) if np.isfinite(x) else None
