"""The schema of a scenario file: the keys of its tables, with the types and limits of their values."""

from dataclasses import fields
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from apo_bench.assembly import GapKind
from apo_bench.io import FileTable, Text, Triple
from apo_bench.records import MEANINGS, Meaning, Thresholds
from apo_bench.scenario.values import LARGEST_LENGTH_MM, Angle, Axis, Length, Point, Pose

_LARGEST_CLEARANCE_MM = 5.0
"""Largest clearance per side, and largest `gap_mm`."""
_MOST_UNDERSIZE_MM = 1.0
"""Largest absolute undersize of a fit face."""
_LARGEST_ERROR_MM = 100.0
"""Largest human error."""
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_HalfWidth = Annotated[float, Meta(ge=0.0, le=LARGEST_LENGTH_MM)]
_Error = Annotated[float, Meta(ge=0.0, le=_LARGEST_ERROR_MM)]
_Undersize = Annotated[float, Meta(ge=-_MOST_UNDERSIZE_MM, le=_MOST_UNDERSIZE_MM)]
_LARGEST_THRESHOLDS = {"overlap_fraction": 1.0, "loose_angle_deg": 180.0}


class PartTable(FileTable, frozen=True, kw_only=True):
    """`[parts.NAME]`."""

    file: Text
    fixed: bool = False
    follows_site: bool = False
    start: Pose | None = None
    color: tuple[_Share, _Share, _Share] | None = None
    fit: dict[str, _Undersize] = msgspec.field(default_factory=dict)
    """Face that recedes by the clearance -> undersize, [mm], see `mark_fit_faces`."""


class ContactTable(FileTable, frozen=True, kw_only=True):
    """An entry of `contacts`."""

    faces: tuple[Text, Text]
    kind: GapKind = "centred"
    gap_mm: tuple[Length, Length] | None = None


class AttachTable(FileTable, frozen=True, kw_only=True):
    """`attach`: stated direction and length of the insertion."""

    along: Axis | None = None
    travel_mm: Annotated[float, Meta(gt=0.0, le=LARGEST_LENGTH_MM)] | None = None


class GraspTable(FileTable, frozen=True, kw_only=True):
    """`grasp`: stated place and directions of the grasp."""

    at_mm: Triple | None = None
    across: Axis | None = None
    ahead: Axis | None = None


class VaryTable(FileTable, frozen=True, kw_only=True):
    """An entry of `vary`: a shift, `along` with `mm`, or a turn, `about` with `deg`."""

    along: Axis | None = None
    mm: tuple[Length, Length] | None = None
    about: Axis | None = None
    deg: tuple[Angle, Angle] | None = None
    at_mm: Point = (0.0, 0.0, 0.0)


class OperationTable(FileTable, frozen=True, kw_only=True):
    """An entry of `[[operations]]`."""

    move: Text
    goal: Pose
    contacts: Annotated[list[tuple[Text, Text] | ContactTable], Meta(min_length=1, max_length=50)]
    carries: tuple[Text, ...] = ()
    attach: AttachTable = AttachTable()
    grasp: GraspTable = GraspTable()
    vary: VaryTable | tuple[VaryTable, ...] = ()
    clamp: bool = False


class SiteTable(FileTable, frozen=True, kw_only=True):
    """`[site]`."""

    center_mm: tuple[Length, Length] = (0.0, 0.0)
    spread_mm: tuple[_HalfWidth, _HalfWidth] = (0.0, 0.0)
    yaw_deg: tuple[Angle, Angle] = (0.0, 0.0)


class HumanErrorTable(FileTable, frozen=True, kw_only=True):
    """`[human_error]`."""

    operation: int
    along: Axis
    size_mm: tuple[_Error, _Error]


JudgeTable = msgspec.defstruct(
    "JudgeTable",
    [("success", Meaning, MEANINGS[0])]
    + [
        (field.name, Annotated[float, Meta(ge=0.0, le=_LARGEST_THRESHOLDS.get(field.name, 1e4))], field.default)
        for field in fields(Thresholds)
    ],
    bases=(FileTable,),
)
"""`[judge]`: the meaning of success, and the thresholds of the judge."""


class ScenarioTable(FileTable, frozen=True, kw_only=True):
    """All tables of a scenario file."""

    schema: Literal[1]
    title: Text
    parts: Annotated[dict[str, Any], Meta(min_length=1, max_length=50)]
    operations: Annotated[list[OperationTable], Meta(min_length=1, max_length=100)]
    paper: Text = ""
    human: Text = ""
    success: Text = ""
    clearance_mm: Annotated[float, Meta(ge=0.0, le=_LARGEST_CLEARANCE_MM)] = 0.25
    gap_mm: Annotated[float, Meta(gt=0.0, le=_LARGEST_CLEARANCE_MM)] = 0.1
    site: SiteTable = SiteTable()
    human_error: HumanErrorTable | None = None
    judge: dict[str, Any] = msgspec.field(default_factory=dict)
