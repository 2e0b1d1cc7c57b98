"""What the contacts determine, in sentences and tables for people, and as one JSON object."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from apo_bench.assembly import Hypothesis, spell
from apo_bench.correction.explanation import Explanation, FreeDirection, OperationExplanation, PartExplanation
from apo_bench.correction.relation_equations import RelationHold
from apo_bench.correction.shared_estimate import SharedEstimate
from apo_bench.formats.json_forms import covariance_form, pose_form
from apo_bench.geometry import Array
from apo_bench.io import grouped, listed_words, with_article
from apo_bench.viz.tables import form_table

_EXPLANATION = "apo-bench/explanation/1"
_TO_MM_DEG = np.array([1e3] * 3 + [180.0 / np.pi] * 3)
_OFF_M = 1e-6  # a turn is said to be about a point only if that is farther from the origin of the part


def total(explanation: Explanation) -> str:
    """`the contacts fix 13 of 18 directions; 5 are free and 14 equations redundant`."""
    redundant = f"{explanation.redundant} of {explanation.rank + explanation.redundant} equations redundant"
    fixed = f"{explanation.rank} of {6 * len(explanation.goals)} directions"
    return f"the contacts fix {fixed}; {explanation.freedom} are free and {redundant}"


def sentences(explanation: Explanation) -> list[str]:
    """One for each operation: what is fixed by which parts, and what is free; then one for each shared error."""
    lines = [f"{o.operation + 1} {o.part}: {_fixed(o)}; {_loose(explanation, o)}" for o in explanation.operations]
    return [*lines, *map(_shared, explanation.shared)]


def hypothesis_lines(hypotheses: Sequence[Hypothesis]) -> list[str]:
    """`0.92: left out what was seen of operation 2`, one each, if there is any doubt."""
    if len(hypotheses) < 2:
        return []
    return [f"{hypothesis.weight:.2g}: {hypothesis.sentence or 'all as it was seen'}" for hypothesis in hypotheses]


def hypothesis_forms(hypotheses: Sequence[Hypothesis]) -> list[dict[str, Any]]:
    """What `json` can write of what may be believed: operations from 1, poses and covariances in mm and degrees."""
    return [
        {
            "weight": one.weight,
            "sentence": one.sentence,
            "left_out": _numbers(one.left_out),
            "dropped": list(one.dropped),
            "operations": [
                pose_form(T)
                | {"covariance_mm_deg": None if one.covariance is None else covariance_form(one.covariance[k])}
                for k, T in enumerate(one.poses)
            ],
        }
        for one in hypotheses
    ]


def part_table(form: dict[str, Any]) -> Any:
    """How well every part of `explanation_form` is known at the end, as a table of `rich`."""
    return form_table(
        form["parts"], {"part": "", "odl": "", "rank": "d", "deviation_mm": ".2f", "deviation_deg": ".2f"}
    )


def explanation_form(scenario: str, explanation: Explanation) -> dict[str, Any]:
    """What `json` can write: mm, degrees, operations from 1; a spectral gap of null is infinite."""
    return {
        "schema": _EXPLANATION,
        "scenario": scenario,
        "operations": [_operation_form(explanation, o) for o in explanation.operations],
        "parts": [_part_form(part) for part in explanation.parts],
        "rank": explanation.rank,
        "freedom": explanation.freedom,
        "redundant": explanation.redundant,
        "shared": [
            {
                "name": estimate.error.name,
                "operations": _numbers(estimate.error.operations),
                "twist_mm_deg": (estimate.twist * _TO_MM_DEG).tolist(),
                "covariance_mm_deg": covariance_form(estimate.covariance),
            }
            for estimate in explanation.shared
        ],
        "left_out": _numbers(explanation.left_out),
        "spectral_gap": explanation.spectral_gap if np.isfinite(explanation.spectral_gap) else None,
    }


def _shared(estimate: SharedEstimate) -> str:
    """`camera: seen off by (-0.30 +- 0.50, 1.90 +- 0.30, 0.10 +- 0.40) mm and (..) deg, in its frame`."""
    numbers = zip(estimate.twist * _TO_MM_DEG, estimate.deviations * _TO_MM_DEG, strict=True)
    each = [f"{x:.2f} +- {s:.2f}" for x, s in numbers]
    frame = "in the frame of the part" if estimate.error.frame is None else "in its frame"
    return f"{estimate.error.name}: seen off by ({', '.join(each[:3])}) mm and ({', '.join(each[3:])}) deg, {frame}"


def size(free: FreeDirection) -> str:
    """`1.00 mm` or `0.58 deg`."""
    return f"{_deviation(free):.2f} {'deg' if free.direction.turns else 'mm'}"


def _fixed(o: OperationExplanation) -> str:
    if not o.through:
        return "nothing is fixed by contacts"
    others = dict.fromkeys(part for hold in o.through for part in sorted(hold.parts) if part != o.part)
    names = [hold.relation + ("" if hold.lost is None else f" until operation {hold.lost + 1}") for hold in o.through]
    agreeing = [hold.relation for hold in o.agreeing]
    agrees = f"; {listed_words(agreeing)} agree{'s' * (len(agreeing) == 1)}" if agreeing else ""
    return f"{', '.join(o.fixed)} fixed by {listed_words(map(with_article, others))} ({', '.join(names)}{agrees})"


def _loose(explanation: Explanation, o: OperationExplanation) -> str:
    """Free directions, those that go together in one breath."""
    together = grouped((direction.along, direction) for direction in o.free)
    kept = "chosen" if o.operation in explanation.left_out else "kept as seen"
    groups = (_group(explanation, along, some, kept) for along, some in together.items())
    return "; ".join(groups) or "nothing is free"


def _group(explanation: Explanation, along: tuple[int, ...], some: list[FreeDirection], kept: str) -> str:
    sizes = ", ".join(map(size, some))
    names = ", ".join(f"{free.direction}{_about(free)}" for free in some)
    if not along:
        return f"{names} free, {kept}, {sizes}"
    others = dict.fromkeys(explanation.operations[j].part for j in along)
    return f"{names} free together with {listed_words(map(with_article, others))}, {sizes}"


def _about(free: FreeDirection) -> str:
    """The point of a turn, if it is not the origin of the part."""
    is_off = free.direction.turns and np.abs(free.direction.point).max() >= _OFF_M
    return f" about ({', '.join(f'{x * 1e3:.0f}' for x in free.direction.point)}) mm" if is_off else ""


def _deviation(free: FreeDirection) -> float:
    return float(free.deviation * _TO_MM_DEG[3 if free.direction.turns else 0])


def _operation_form(explanation: Explanation, o: OperationExplanation) -> dict[str, Any]:
    return {
        "operation": o.operation + 1,
        "part": o.part,
        "rank": o.rank,
        "fixed": list(o.fixed),
        "free": list(_free_forms(o.free, explanation.goals[o.operation])),
        "through": [_hold_form(hold) for hold in o.through],
        "agreeing": [_hold_form(hold) for hold in o.agreeing],
        "covariance_mm_deg": covariance_form(o.covariance),
    }


def _part_form(part: PartExplanation) -> dict[str, Any]:
    deviations = part.deviations * _TO_MM_DEG
    return {
        "part": part.part,
        "placed": part.placed + 1,
        "odl": spell(part.odl),
        **pose_form(part.pose),
        "rank": part.rank,
        "fixed": list(part.fixed),
        "free": list(_free_forms(part.free, part.pose)),
        "deviation_mm": deviations[:3].tolist(),
        "deviation_deg": deviations[3:].tolist(),
        "covariance_mm_deg": covariance_form(part.covariance),
    }


def _free_forms(free: Sequence[FreeDirection], T: Array) -> Iterator[dict[str, Any]]:
    """Twists per mm of a shift and per degree of a turn; axes in the frame of the part and in the world."""
    for freedom in free:
        d = freedom.direction
        yield {
            "name": str(d),
            "twist_mm_deg": (d.twist * _TO_MM_DEG / _TO_MM_DEG[3 if d.turns else 0]).tolist(),
            "axis": d.axis.tolist(),
            "axis_world": (T[:3, :3] @ d.axis).tolist(),
            **({"point_mm": (d.point * 1e3).tolist()} if d.turns else {}),
            "deviation_deg" if d.turns else "deviation_mm": _deviation(freedom),
            "with": _numbers(freedom.along),
        }


def _hold_form(hold: RelationHold) -> dict[str, Any]:
    return {
        "relation": hold.relation,
        "parts": list(hold.parts),
        "made": hold.made + 1,
        "lost": None if hold.lost is None else hold.lost + 1,
        "equation": spell(hold.word),
        "operations": _numbers(sorted({term.operation for term in hold.word})),
    }


def _numbers(operations: Iterable[int]) -> list[int]:
    return [k + 1 for k in operations]
