"""What an environment says in `info`, where a number may be missing.

A vector environment gathers the infos of its environments into arrays. If the first has an `int` it makes an array
that holds nothing but ints, and a None of the next one raises; numbers of these types go into an array of objects.
"""

from collections.abc import Mapping
from typing import Any, final

from apo_bench.assembly import Outcome
from apo_bench.judging.verdict import Verdict
from apo_bench.records import Predicted

VERDICTS = ("is_success", "as_demonstrated", "loose_success")
"""Keys of what the judge says."""


@final
class NullableInt(int):
    """A whole number beside which None may stand."""


@final
class NullableFloat(float):
    """A number beside which None may stand."""


def nullable(x: float | None) -> float | None:
    """The number as one beside which None may stand."""
    if x is None:
        return None
    return NullableInt(x) if isinstance(x, int) else NullableFloat(x)


def predicted_info(predicted: Mapping[str, Any]) -> dict[str, Any]:
    """What a plan said about itself, as in a row, fit for infos."""
    return {**predicted, **{name: nullable(predicted[name]) for name in ("operation", "size_mm")}}


def verdicts(verdict: Verdict) -> dict[str, bool]:
    """What the judge says."""
    return dict(zip(VERDICTS, (verdict.success, verdict.as_demonstrated, verdict.loose_success), strict=True))


def step_info(
    verdicts: Mapping[str, bool], end: Outcome, predicted: Predicted | None, promised: float | None
) -> dict[str, Any]:
    """What is said after a step: the verdicts, where the replay ended, and what the plan had said of itself."""
    return {
        **verdicts,
        "success": verdicts["is_success"],
        "stage": end.stage,
        "code": end.code,
        "operation": nullable(None if end.operation is None else end.operation + 1),
        "sentence": end.sentence,
        **({} if predicted is None else {"predicted": predicted_info(predicted)}),
        **({} if promised is None else {"promised": promised}),
    }
