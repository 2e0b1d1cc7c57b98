"""The table of fields: what a row, a line of `timing.jsonl` and `run.json` may say, checked when read and written.

What is read from a file has passed through here: types, finite numbers, ranges, and nothing but these fields. Fields of
rows that the table does not know are left out, since nothing reads them and people add their own; a row that is to be
written may not have any.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal, NotRequired, TypedDict

from msgspec import Meta

from apo_bench.records.key import KEY
from apo_bench.records.outcomes import CODES, STAGES
from apo_bench.records.row import LARGEST
from apo_bench.records.settings import (
    EYES,
    FIDELITIES,
    LARGEST_CARELESS,
    LARGEST_CLEARANCE_MM,
    LARGEST_LEVEL,
    LARGEST_SEED,
)

LONGEST_NAME = 5000
"""Letters; some names are paths."""
_OneOf: Any = Literal
Number = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
Size = Annotated[float, Meta(ge=0.0, le=LARGEST)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Count = Annotated[int, Meta(ge=0, le=1_000_000)]
Operation = Annotated[int, Meta(ge=1, le=100_000)]
Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
Names = list[Name]
Pose = Annotated[list[Number], Meta(min_length=7, max_length=7)]


class Attempt(TypedDict):
    """A set of operations that were freed, and the gap that was left [mm]."""

    step: Operation
    free: list[Operation]
    gap_mm: Number | None


class Foretold(TypedDict):
    """What a plan said about itself, and how far off it is then [mm]."""

    fails: bool
    operation: Operation | None
    code: Literal["ok", "residual", "interference", "unstable_goal"]
    size_mm: NotRequired[Number | None]


NEEDED = ("demonstration", "success", "loose_success", "failure_stage", "failure_code")
"""What every row says, besides its key."""
ROW_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        "schema": Name,
        "env_id": Name,
        "spec_hash": Name,
        "scenario": Name,
        "level": Annotated[float, Meta(ge=0.0, le=LARGEST_LEVEL)],
        "level_deg": Annotated[float, Meta(ge=0.0, le=LARGEST_LEVEL)],
        "careless": Annotated[float, Meta(ge=0.0, le=LARGEST_CARELESS)],
        "clearance_mm": Annotated[float, Meta(ge=0.0, le=LARGEST_CLEARANCE_MM)],
        "eye": _OneOf[EYES],
        "noise": Name,
        "grasp": Name,
        "arm": Name,
        "relations": Name,
        "method": Name,
        "seed": Annotated[int, Meta(ge=0, le=LARGEST_SEED)],
        "salt": Name,
        "timestep_s": Annotated[float, Meta(gt=0.0, le=1.0)],
        "fidelity": _OneOf[FIDELITIES],
        "thresholds": dict[str, Size],
        "demonstration": _OneOf[tuple(CODES)],
        "success": bool,
        "as_demonstrated": bool,
        "loose_success": bool,
        "failure_stage": _OneOf[STAGES],
        "failure_code": _OneOf[tuple(CODES)],
        "failure_operation": Operation,
        "sentence": str,
        "as_demonstrated_code": _OneOf[tuple(CODES)],
        "conditions": dict[str, bool],
        "worst_gap_mm": Number,
        "worst_angle_deg": Number,
        "least_overlap": Number,
        "penetration_mm": Number,
        "pushed_mm": Number,
        "freed": list[Operation],
        "tried": list[Attempt],
        "extra_operations": Annotated[int, Meta(ge=-1_000_000, le=1_000_000)],
        "predicted": Foretold,
        "gap_before_mm": Number,
        "gap_after_mm": Number,
        "chi_square": Annotated[float, Meta(ge=0.0, le=1e300)],
        "chi_square_freedom": Annotated[int, Meta(ge=0, le=LARGEST_SEED)],
        "p_value": Share,
        "test_passes": bool,
        "suspects": Names,
        "dropped": Names,
        "wrong_relation": Name,
        "inside_95": bool,
        "planned_error_fixed_mm": Size,
        "planned_error_free_mm": Size,
        "contacts_right": Count,
        "contacts_missed": Count,
        "contacts_false": Count,
        "reached": dict[str, Pose],
        "pose_error_fixed_mm": Size,
        "pose_error_free_mm": Size,
        "peak_force_n": Size,
        "sim_seconds": Size,
    }
)
"""Of a row: lengths in mm, angles in degrees, operations numbered from 1."""
NEVER_NULL = ("schema", "scenario", "clearance_mm", "seed", "noise", "relations", "grasp", "method")
"""All others may be null."""
REQUIRED = (*NEVER_NULL, "level", "level_deg", "careless", *NEEDED)
"""Without them a line is no row; what else a row does not say is null."""

Text = Annotated[str, Meta(max_length=100_000)]
_Plain = None | bool | int | float | Text
_Listed = list[_Plain | list[_Plain]]
_Inner = _Plain | _Listed | dict[Name, _Plain | _Listed]
Said = _Plain | list[_Plain | list[_Plain] | dict[Name, _Inner]] | dict[Name, _Inner]
"""Any value of `run.json`: no deeper than one that a sweep writes."""
Texts = dict[Name, Text]
Limits = dict[Name, Annotated[float, Meta(gt=0.0, le=1e9)] | None]
"""Wall times [s]; null where there was no limit."""
RUN_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        "schema": Name,
        "grids": list[dict[Name, _Inner]],
        "files": Texts,
        "content": Texts,
        "versions": Texts,
        "python": Text,
        "platform": Text,
        "command": Text,
        "salt": Text,
        "limits": Limits,
        "code": Texts,
    }
)
"""Of `run.json`: all may be missing, and what else stands there is shown as it is."""
Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
TIMING_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        **{name: ROW_FIELDS[name] for name in KEY},
        "compile_s": Seconds,
        "demonstrate_s": Seconds,
        "trial_s": Seconds,
        "host": Name,
        "worker": int | Name,
    }
)
"""Of a line of `timing.jsonl`."""
