"""Lines and documents of the folder of a sweep, read and written by tables of fields; those of a row are in `row`.

Every complaint is one sentence that names the file, the line and the field.
"""

import re
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, Never, cast

import msgspec
from msgspec import Meta

from apo_bench.errors import InputError
from apo_bench.io import CONTROL, clean
from apo_bench.records.record import KEY, RECORD_FIELDS, REQUIRED, TrialRecord
from apo_bench.records.settings import RECORD_SCHEMA, Name

_Text = Annotated[str, Meta(max_length=100_000)]
_Plain = None | bool | int | float | _Text
_Listed = list[_Plain | list[_Plain]]
_Inner = _Plain | _Listed | dict[Name, _Plain | _Listed]
_RunValue = _Plain | list[_Plain | list[_Plain] | dict[Name, _Inner]] | dict[Name, _Inner]
"""Any value of `run.json`: no deeper than one that a sweep writes."""
_Texts = dict[Name, _Text]
RUN_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        "schema": Name,
        "grids": list[dict[Name, _Inner]],
        "files": _Texts,
        "content": _Texts,
        "versions": _Texts,
        "python": _Text,
        "platform": _Text,
        "command": _Text,
        "secret_seed": _Text,
        "limits": dict[Name, Annotated[float, Meta(gt=0.0, le=1e9)] | None],  # wall times [s]
        "code": _Texts,
    }
)
"""Of `run.json`: all may be missing, and what else stands there is shown as it is."""
_Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
TIMING_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        **{name: RECORD_FIELDS[name] for name in KEY},
        **dict.fromkeys(("compile_s", "demonstrate_s", "trial_s"), _Seconds),
        "host": Name,
        "worker": int | Name,
    }
)
"""Of a line of `timing.jsonl`."""
_NAMES = (
    *("scenario", "noise", "contact_source", "grasp", "arm", "method", "config_hash", "pose_source"),
    *("robot_error", "ft_sensor", "assumed_robot_error"),
)
"""Texts of a row that stand in commands, so that nothing in them may be obeyed by a terminal."""
_TOGETHER = (
    ("noise_mm", "noise_deg", "human_error_scale"),
    ("success", "loose_success"),
    ("as_demonstrated", "success"),
    ("contacts_true_positive", "contacts_false_negative", "contacts_false_positive"),
    ("planned_error_fixed_mm", "planned_error_free_mm"),
    ("pose_error_fixed_mm", "pose_error_free_mm"),
    ("test_passes", "suspects"),
    (
        "probe_contacts",
        "probe_contacts_rejected",
        "base_error_estimate_mm",
        "base_error_estimate_deg",
        "base_error_std_mm",
        "base_error_std_deg",
    ),
)
"""Fields that are null together."""
_LONGEST_QUOTE = 60
_TYPE_WORDS = {
    "object": "an object",
    "array": "a list",
    "str": "text",
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
}


def _struct(name: str, fields: Mapping[str, Any], required: Iterable[str] = (), **more: Any) -> type[msgspec.Struct]:
    columns: list[Any] = [
        (field, kind) if field in required else (field, kind | None, None) for field, kind in fields.items()
    ]
    return msgspec.defstruct(name, columns, kw_only=True, gc=False, **more)


_ROW = msgspec.json.Decoder(_struct("TrialRecord", RECORD_FIELDS, REQUIRED))
_TIMING = msgspec.json.Decoder(_struct("Timing", TIMING_FIELDS, ("scenario", "method")))
_WRITTEN = _struct("Written", RECORD_FIELDS, REQUIRED, forbid_unknown_fields=True)
_RUN = msgspec.json.Decoder(dict[str, Any])
_KNOWN = _struct("Run", RUN_FIELDS)


def row_of(line: bytes, where: str) -> TrialRecord:
    """The row of a line, with every field of the table, null where the line does not say.

    Args:
        where: File and line, for the complaint.

    Raises:
        InputError: A line that is no row.
    """
    row = _decoded(_ROW, line, where, "this is not a row of a sweep")
    if row["schema"] != RECORD_SCHEMA:
        raise InputError(
            f"{where}: a row of schema '{_short(row['schema'])}' was given; only {RECORD_SCHEMA} can be read."
        )
    fault = _fault(row)
    if fault is not None:
        raise _wrong(where, *fault)
    row["sentence"] = row["sentence"] and clean(row["sentence"])
    return cast(TrialRecord, row)


def timing_of(line: bytes, where: str) -> dict[str, Any]:
    """A line of `timing.jsonl` with every field of the table.

    Raises:
        InputError: A line that is none.
    """
    return _decoded(_TIMING, line, where, "this is not a line of timings")


def run_of(text: bytes, file: str) -> dict[str, Any]:
    """What `run.json` says, all of it.

    Raises:
        InputError: It is no such document.
    """
    try:
        run = _RUN.decode(text)
        msgspec.convert(run, _KNOWN)
        for name, value in run.items():
            _check_value(value, file, name)
    except _UNREADABLE as error:
        _refuse(error, file, "this is not a document that a sweep wrote")
    for name, path in (run.get("files") or {}).items():
        if CONTROL.search(name + path):
            raise _wrong(file, "files", "text without control characters is needed")
    return {name: value for name, value in run.items() if value is not None}


def _check_value(value: Any, file: str, name: str) -> None:
    try:
        msgspec.convert(value, _RunValue)
    except msgspec.ValidationError as error:
        place, what = _in_words(error)
        gap = " " * place.startswith("(")
        raise _wrong(file, f"{_short(name)}{gap}{place}", what) from error


def unwritable(row: Mapping[str, Any]) -> str:
    """Why a row may not be written, since it could not be read again; empty if it may."""
    try:
        msgspec.convert(dict(row), _WRITTEN)
        fault = _fault(row)
    except msgspec.ValidationError as error:
        fault = _in_words(error)
    return "" if fault is None else f"field {fault[0]}: {fault[1]}"


_UNREADABLE = (msgspec.DecodeError, msgspec.ValidationError, RecursionError, ValueError)


def _decoded(decoder: Any, line: bytes, where: str, none: str) -> dict[str, Any]:
    try:
        return msgspec.structs.asdict(decoder.decode(line))
    except _UNREADABLE as error:
        _refuse(error, where, none)


def _fault(row: Mapping[str, Any]) -> tuple[str, str] | None:
    """The field and what is wrong with it, of fields that do not go together."""
    for name in _NAMES:
        if row.get(name) and CONTROL.search(row[name]):
            return name, "text without control characters is needed"
    for names in _TOGETHER:
        if len({row.get(name) is None for name in names}) > 1:
            return names[0], f"{' and '.join(names)} are null together, or none of them is"
    if row.get("as_demonstrated") and not row["success"]:
        return "as_demonstrated", "it is true, so success is needed to be true as well"
    if row["success"] is False and None in (row["failure_stage"], row["failure_code"]):
        return "failure_stage", "success is false, so failure_stage and failure_code are needed"
    if row["success"] and (row["failure_stage"], row["failure_code"]) != (None, None):
        return "failure_stage", "success is true, so failure_stage and failure_code are null"
    if row["success"] and None in (row.get("sim_time_s"), row.get("extra_operations")):
        return "sim_time_s", "success is true, so sim_seconds and extra_operations are needed"
    return None


def _in_words(error: msgspec.ValidationError) -> tuple[str, str]:
    """The field, and what is needed there and what was given, in words."""
    text, _, place = str(error).partition(" - at `$")
    field = clean(place.rstrip("`").lstrip(".")).replace("[...]", " (an entry)").strip()[:_LONGEST_QUOTE]
    missing = re.fullmatch(r"Object missing required field `(.*)`", text)
    if missing:
        return f"{field}.{missing[1]}".strip("."), "it is missing"
    unknown = re.fullmatch(r"Object contains unknown field `(.*)`", text)
    if unknown:
        return f"{field}.{unknown[1]}".strip("."), "no such field is in the table of fields"
    value = re.fullmatch(r"Invalid enum value '?(.*?)'?", text, re.DOTALL)
    if value:
        return field, f"'{_short(value[1])}' is none of the values that it has"
    words = re.sub(r"`([^`]*)`", lambda kinds: _kinds_in_words(kinds[1]), text)
    needed = re.fullmatch(r"Expected (.*?)(?:, got (.*))?", words)
    if needed:
        return field, f"{needed[1]} is needed" + f", {needed[2]} was given" * bool(needed[2])
    return field, words[:1].lower() + words[1:]


def _kinds_in_words(kinds: str) -> str:
    """`int | null` in words."""
    names = [_TYPE_WORDS.get(kind, kind) for kind in kinds.split(" | ")]
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _short(text: str) -> str:
    text = clean(text)
    return text if len(text) <= _LONGEST_QUOTE else text[: _LONGEST_QUOTE - 3] + "..."


def _refuse(error: Exception, where: str, none: str) -> Never:
    if isinstance(error, InputError):
        raise error
    if isinstance(error, msgspec.ValidationError):
        raise _wrong(where, *_in_words(error)) from error
    raise InputError(f"{where}: {none}; remove it, or the folder.") from error


def _wrong(where: str, field: str, what: str) -> InputError:
    place = f"{where}, field {field}" if field else where
    return InputError(f"{place}: {what}; remove it, or the folder.")
