"""Decode and check the files of a sweep's folder: records, timings and `run.json`."""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, cast

import msgspec
from msgspec import Meta

from apo_bench.errors import InputError, require
from apo_bench.io import CONTROL, clean
from apo_bench.records.record import KEY, RECORD_FIELDS, REQUIRED, TrialRecord
from apo_bench.records.settings import RECORD_SCHEMA, Name

_Text = Annotated[str, Meta(max_length=100_000)]
_Texts = dict[Name, _Text]
_Plain = None | bool | int | float | _Text
_Values = _Plain | list[_Plain | list[_Plain]]
RUN_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        "schema": Name,
        "grids": list[dict[Name, _Values | dict[Name, _Values]]],
        "files": _Texts,
        "content": _Texts,
        "versions": _Texts,
        "python": _Text,
        "platform": _Text,
        "command": _Text,
        "secret_seed": _Text,
        "limits": dict[Name, Annotated[float, Meta(gt=0.0, le=1e9)] | None],  # wall times [s]
        "revision": _Text,
    }
)
"""Key of `run.json` -> type of its value; all keys are optional."""
_Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
TIMING_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        **{name: RECORD_FIELDS[name] for name in KEY},
        **dict.fromkeys(("compile_s", "demonstrate_s", "trial_s"), _Seconds),
        "host": Name,
        "worker": int | Name,
    }
)
"""Key of a line of `timing.jsonl` -> type of its value."""
NAMES = (
    *("scenario", "noise", "contact_source", "grasp", "arm", "method", "config_hash", "pose_source"),
    *("robot_error", "ft_sensor", "assumed_robot_error"),
)
"""Texts of a record that appear in commands, so they must not contain control characters."""
_TOGETHER = (
    ("noise_mm", "noise_deg", "human_error_scale"),
    ("success", "loose_success"),
    ("as_demonstrated", "success"),
    ("contacts_true_positive", "contacts_false_negative", "contacts_false_positive"),
    ("planned_error_fixed_mm", "planned_error_free_mm"),
    ("pose_error_fixed_mm", "pose_error_free_mm"),
    ("consistent", "suspects"),
    ("probe_contacts", "probe_contacts_rejected", "base_error_estimate_mm", "base_error_estimate_deg"),
)
"""Columns that are all null, or all not null."""
CHECKED = (
    *dict.fromkeys(name for names in _TOGETHER for name in names),
    *("failure_stage", "failure_code", "sim_time_s", "extra_steps"),
)
"""Columns that may contradict each other."""
_LARGE = ("thresholds", "conditions", "tried_corrections", "fit_adjustments", "grasp_slip", "final_poses")
"""Columns that tables do not need; without them a record is read in half the time."""


def _make_struct(
    name: str, fields: Mapping[str, Any], required: Iterable[str] = (), **more: Any
) -> type[msgspec.Struct]:
    """Return a msgspec type with these fields; those that are not required may be null or missing."""
    columns: list[Any] = [
        (field, kind) if field in required else (field, kind | None, None) for field, kind in fields.items()
    ]
    return msgspec.defstruct(name, columns, kw_only=True, gc=False, **more)


_RECORD = msgspec.json.Decoder(_make_struct("TrialRecord", RECORD_FIELDS, REQUIRED))
_KEPT = {name: kind for name, kind in RECORD_FIELDS.items() if name not in _LARGE}
decode_kept = msgspec.json.Decoder(_make_struct("KeptRecord", _KEPT, REQUIRED)).decode
"""Decodes a line of `trials.jsonl` without its large columns into an object; it raises an error of msgspec."""
_TIMING = msgspec.json.Decoder(_make_struct("Timing", TIMING_FIELDS, ("scenario", "method")))
_RUN = msgspec.json.Decoder(_make_struct("Run", RUN_FIELDS))
# for writing, where unknown columns are an error
_WRITTEN = _make_struct("Written", RECORD_FIELDS, REQUIRED, forbid_unknown_fields=True)


def decode_record(line: bytes, where: str) -> TrialRecord:
    """Decode and check a line of `trials.jsonl`; return the record with every column, null where the line has none.

    Args:
        where: File and line, for the message.

    Raises:
        InputError: The line is no record.
    """
    record = msgspec.structs.asdict(_decode_line(_RECORD, line, where))
    require(
        record["schema"] == RECORD_SCHEMA,
        f"{where}: a record of schema '{clean(record['schema'])[:60]}' was given; only {RECORD_SCHEMA} can be read.",
    )
    fault = _find_fault(record)
    if fault:
        raise InputError(f"{where}, {fault}; remove the line, or the folder.")
    record["sentence"] = record["sentence"] and clean(record["sentence"])
    return cast(TrialRecord, record)


def decode_timing(line: bytes, where: str) -> dict[str, Any]:
    """Decode and check a line of `timing.jsonl`.

    Raises:
        InputError: The line holds no wall times of a trial.
    """
    return msgspec.structs.asdict(_decode_line(_TIMING, line, where))


def decode_run(text: bytes, file: str) -> dict[str, Any]:
    """Decode and check `run.json`; return the keys that have a value.

    Raises:
        InputError: The text is no such document.
    """
    run = msgspec.structs.asdict(_decode_line(_RUN, text, file))
    for name, path in (run["files"] or {}).items():
        require(not CONTROL.search(name + path), f"{file}, field files: control characters are not allowed.")
    return {name: value for name, value in run.items() if value is not None}


def describe_unwritable(record: Mapping[str, Any]) -> str:
    """Return why a record may not be written, since reading it would fail; empty if it may."""
    try:
        msgspec.convert(dict(record), _WRITTEN)
        msgspec.json.encode(record)
    except (msgspec.ValidationError, UnicodeError) as error:
        return str(error)
    return _find_fault(record)


def _decode_line(decoder: Any, text: bytes, where: str) -> Any:
    """Decode a text into an object; errors name the place `where`."""
    try:
        return decoder.decode(text)
    except (msgspec.DecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{where}: {clean(str(error))}; remove it, or the folder.") from error


def _find_fault(record: Mapping[str, Any]) -> str:
    """Return a sentence on columns that contradict each other, or hold control characters; empty if there are none."""
    for name in NAMES:
        if CONTROL.search(record.get(name) or ""):
            return f"field {name}: control characters are not allowed"
    null = tuple(record.get(name) is None for name in CHECKED)
    return find_contradiction(null, record["success"], bool(record.get("as_demonstrated")))


def find_contradiction(null: Sequence[bool], success: bool | None, as_demonstrated: bool) -> str:
    """Return a sentence on columns that contradict each other; empty if there are none.

    Args:
        null: Whether the value of each column of `CHECKED` is null.
    """
    unknown = dict(zip(CHECKED, null, strict=True))
    for names in _TOGETHER:
        if len({unknown[name] for name in names}) > 1:
            return f"field {names[0]}: {' and '.join(names)} are null together, or none of them is"
    failure = not (unknown["failure_stage"] or unknown["failure_code"])
    if (success is False and not failure) or (success and failure):
        return "field failure_stage: a failure has a stage and a code, a success has none"
    if success and (unknown["sim_time_s"] or unknown["extra_steps"]):
        return "field sim_time_s: a success has sim_time_s and extra_steps"
    if as_demonstrated and not success:
        return "field as_demonstrated: it is true, so success must be true as well"
    return ""
