"""Lines and documents of the folder of a sweep, read and written by the table of fields.

Every complaint is one sentence that names the file, the line and the field.
"""

import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Never, cast

import msgspec

from apo_bench.errors import InputError
from apo_bench.io.plain_text import CONTROL, clean
from apo_bench.io.whole_json import HALF_BUT_OF_FILES, HALF_LETTER, WHOLE_LETTERS, half_letter, is_whole, read_whole
from apo_bench.records.row import REQUIRED, ROW_FIELDS, Row
from apo_bench.records.run.fields import RUN_FIELDS, TIMING_FIELDS, Said
from apo_bench.records.settings import RANGE, ROW, SETTINGS, TrialSettings

_USUAL: Mapping[str, Any] = MappingProxyType(
    {
        info.column: info.default
        for name, info in SETTINGS.items()
        if (info.later or not info.key) and name not in ("eye", "salt")
    }
)
"""What a row that does not say means."""
_READABLE = ("apo-bench/row/6", ROW)
"""Schemas of rows; those before today's say nothing of looks."""
_NAMES = ("scenario", "noise", "relations", "grasp", "arm", "method", "spec_hash", "eye", "robot_error")
"""Texts of a row that stand in commands, so that nothing in them may be obeyed by a terminal."""
_TOGETHER = (
    ("level", "level_deg", "careless"),
    ("success", "loose_success"),
    ("as_demonstrated", "success"),
    ("contacts_right", "contacts_missed", "contacts_false"),
    ("planned_error_fixed_mm", "planned_error_free_mm"),
    ("pose_error_fixed_mm", "pose_error_free_mm"),
    ("test_passes", "suspects"),
)
"""Fields that are null together."""
_LONGEST_QUOTE = 60
_TIMED = ("scenario", "method")
_KINDS = {
    "object": "an object",
    "array": "a list",
    "str": "text",
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
}


def _struct(name: str, fields: Mapping[str, Any], required: Sequence[str], **more: Any) -> type[msgspec.Struct]:
    given = []
    for field, kind in fields.items():
        given.append((field, kind) if field in required else (field, kind | None, None))
    return msgspec.defstruct(name, given, kw_only=True, gc=False, **more)


_ROW = msgspec.json.Decoder(_struct("Row", ROW_FIELDS, REQUIRED))
_TIMING = msgspec.json.Decoder(_struct("Timing", TIMING_FIELDS, _TIMED))
_WRITTEN = _struct("Written", ROW_FIELDS, REQUIRED, forbid_unknown_fields=True)
_RUN = msgspec.json.Decoder(dict[str, Any])
_KNOWN = _struct("Run", RUN_FIELDS, ())


def row_of(line: bytes, where: str) -> Row:
    """The row of a line, with every field of the table, null where the line does not say.

    Args:
        where: File and line, for the complaint.

    Raises:
        InputError: A line that is no row.
    """
    row = _decoded(_ROW, line, where, "this is not a row of a sweep")
    if row["schema"] not in _READABLE:
        raise InputError(
            f"{where}: a row of schema '{_short(row['schema'])}' was given; {', '.join(_READABLE)} can be read."
        )
    wrong = _fault(row)
    if wrong is not None:
        raise _wrong(where, *wrong)
    row["sentence"] = row["sentence"] and clean(row["sentence"])
    return as_usual(row)


def as_usual(row: Mapping[str, Any]) -> Row:
    """A row with what it does not say about how it was run."""
    usual = {"eye": RANGE if row["noise"] == RANGE else TrialSettings.eye, **_USUAL}
    return cast(Row, {**row, **{name: value for name, value in usual.items() if row.get(name) is None}})


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
        said = _parsed(_RUN, text, file, HALF_BUT_OF_FILES)
        msgspec.convert(said, _KNOWN)
        for name, value in said.items():
            _check_said(value, file, name)
    except _UNREADABLE as error:
        _refuse(error, file, "this is not a document that a sweep wrote")
    for name, path in (said.get("files") or {}).items():
        if CONTROL.search(name + path):
            raise _wrong(file, "files", "text without control characters is needed")
    return {name: value for name, value in said.items() if value is not None}


def _check_said(value: Any, file: str, name: str) -> None:
    try:
        msgspec.convert(value, Said)
    except msgspec.ValidationError as error:
        place, what = _said(error)
        gap = " " * place.startswith("(")
        raise _wrong(file, f"{_short(name)}{gap}{place}", what) from error


def unwritable(row: Mapping[str, Any]) -> str:
    """Why a row may not be written, since it could not be read again; empty if it may."""
    try:
        msgspec.convert(dict(row), _WRITTEN)
        half = half_letter(dict(row), HALF_LETTER)
        wrong = _fault(row) if half is None else (half, WHOLE_LETTERS)
    except msgspec.ValidationError as error:
        wrong = _said(error)
    return "" if wrong is None else f"field {wrong[0]}: {wrong[1]}"


_UNREADABLE = (msgspec.DecodeError, msgspec.ValidationError, RecursionError, ValueError)


def _decoded(decoder: Any, line: bytes, where: str, none: str) -> dict[str, Any]:
    try:
        return msgspec.structs.asdict(_parsed(decoder, line, where, HALF_LETTER))
    except _UNREADABLE as error:
        _refuse(error, where, none)


def _parsed(decoder: Any, text: bytes, where: str, half: re.Pattern[str]) -> Any:
    """What is wrong with a field is said first, then what is seen only when looking closer, which few lines need."""
    said = None if b"\\" in text else decoder.decode(text)
    return said if said is not None and is_whole(text) else msgspec.convert(read_whole(text, where, half), decoder.type)


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
    if row["success"] and None in (row.get("sim_seconds"), row.get("extra_operations")):
        return "sim_seconds", "success is true, so sim_seconds and extra_operations are needed"
    return None


def _said(error: msgspec.ValidationError) -> tuple[str, str]:
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
    words = re.sub(r"`([^`]*)`", lambda found: _kinds(found[1]), text)
    needed = re.fullmatch(r"Expected (.*?)(?:, got (.*))?", words)
    if needed:
        return field, f"{needed[1]} is needed" + f", {needed[2]} was given" * bool(needed[2])
    return field, words[:1].lower() + words[1:]


def _kinds(said: str) -> str:
    """`int | null` in words."""
    names = [_KINDS.get(kind, kind) for kind in said.split(" | ")]
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _short(text: str) -> str:
    said = clean(text)
    return said if len(said) <= _LONGEST_QUOTE else said[: _LONGEST_QUOTE - 3] + "..."


def _refuse(error: Exception, where: str, none: str) -> Never:
    if isinstance(error, InputError):
        raise error
    if isinstance(error, msgspec.ValidationError):
        raise _wrong(where, *_said(error)) from error
    raise InputError(f"{where}: {none}; remove it, or the folder.") from error


def _wrong(where: str, field: str, what: str) -> InputError:
    place = f"{where}, field {field}" if field else where
    return InputError(f"{place}: {what}; remove it, or the folder.")
