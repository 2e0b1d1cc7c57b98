"""Two pages of the reference, read from the types: the settings and the record of a trial."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Mapping
from dataclasses import MISSING

from msgspec.inspect import (
    BoolType,
    DictType,
    FloatType,
    IntType,
    ListType,
    LiteralType,
    NoneType,
    StrType,
    Type,
    TypedDictType,
    UnionType,
    type_info,
)

from apo_bench.records import (
    CODES,
    KEY,
    LARGEST_NUMBER,
    RECORD_FIELDS,
    RECORD_SCHEMA,
    REQUIRED,
    SETTINGS,
    STAGES,
    SettingInfo,
    TrialConfig,
    TrialRecord,
)

SETTINGS_HEAD = """# Settings of a trial

With the same version and the same files these settings determine the record of a trial. They have one name everywhere:
fields of `TrialConfig` and `SweepConfig`, keys of a sweep file, arguments of the environments and options of
`apo-bench`. A sweep takes several values of some of them, and one of others. `noise_level` sets `noise_mm` and
`noise_deg`.
"""
RECORD_HEAD = f"""# Columns of a trial record

The record of a trial is one JSON object, one line of `trials.jsonl`, of schema `{RECORD_SCHEMA}`. Lengths are in mm,
angles in degrees, quaternions are wxyz, operations are numbered from 1. The columns of the *key* distinguish the
trials of one sweep; *needed* columns are in every record. A column that may be null may also be left out.
"""
FIRST = {
    "schema": "Version of these columns.",
    "env_id": "Version of the environment.",
    "config_hash": "16 hexadecimal digits of a hash of the version, the files and all settings but method and seed: "
    "records with the same may be counted together.",
    "secret_seed": "Hash of the secret seed that the trial was drawn with; null for one that anyone can draw.",
}
FEW = 4
"""Words of a closed list that fit in a table."""


def settings_page() -> str:
    """The page of settings, as Markdown."""
    meanings = sentences(TrialConfig)
    lines = [
        SETTINGS_HEAD,
        "| setting | meaning | value | default | option | values in a sweep |",
        "|---|---|---|---|---|---|",
    ]
    for name, info in SETTINGS.items():
        option = f"`--{info.option}`" if info.help else "argument"
        default = "" if info.default is MISSING else info.usual or f"`{info.default}`"
        axis = "several" if info.axis or (info.drawn and info.help) else "one" if info.shared else ""
        lines.append(f"| `{name}` | {meanings[name]} | {value_of(info)} | {default} | {option} | {axis} |")
    return "\n".join(lines) + "\n"


def record_page() -> str:
    """The page of columns, as Markdown."""
    meanings = sentences(TrialConfig) | sentences(TrialRecord) | FIRST
    lines = [RECORD_HEAD, "| column | meaning | value | null | |", "|---|---|---|---|---|"]
    for column, kind in RECORD_FIELDS.items():
        value, null = without_null(type_info(kind))
        need = "key" if column in KEY else "needed" if column in REQUIRED else ""
        lines.append(f"| `{column}` | {meanings[column]} | {words(value)} | {'yes' if null else ''} | {need} |")
    lines += ["", "## How a trial can end", "", f"Stages, in their order: {', '.join(f'`{s}`' for s in STAGES)}.", ""]
    lines += ["| code | sentence |", "|---|---|"]
    return "\n".join([*lines, *(f"| `{code}` | {sentence} |" for code, sentence in CODES.items())]) + "\n"


def sentences(of: type) -> Mapping[str, str]:
    """Field of a class -> the sentence below it; a field without one is not there."""
    body = ast.parse(inspect.getsource(of)).body[0]
    assert isinstance(body, ast.ClassDef)
    return {
        field.target.id: " ".join(str(below.value.value).split())
        for field, below in zip(body.body, body.body[1:], strict=False)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    }


def value_of(info: SettingInfo) -> str:
    """What a setting may be, in words."""
    if info.choices:
        return " or ".join(f"`{choice}`" for choice in info.choices)
    return "a secret in a file" if info.name == "secret_seed" else words(type_info(info.kind))


def without_null(kind: Type) -> tuple[Type, bool]:
    """The type of a value that is there, and whether it may be null."""
    if not isinstance(kind, UnionType):
        return kind, False
    (one,) = (each for each in kind.types if not isinstance(each, NoneType))
    return one, True


def words(kind: Type) -> str:
    """A type, with its range, in words."""
    match kind:
        case IntType(ge=low, le=high):
            return f"whole number, {low} to {high}"
        case FloatType(ge=low, gt=above, le=high) if high is not None and high < LARGEST_NUMBER:
            return f"number above {above:g}, to {high:g}" if low is None else f"number, {low:g} to {high:g}"
        case FloatType(ge=low):
            return "number from 0" if low == 0 else "number"
        case LiteralType(values):
            return " or ".join(f"`{value}`" for value in values) if len(values) <= FEW else "see below"
        case ListType(item_type=each):
            return f"list, each: {words(each)}"
        case DictType(value_type=each):
            return f"object, each: {words(each)}"
        case TypedDictType(fields=fields):
            return "object with " + ", ".join(f"`{field.name}`" for field in fields)
        case StrType():
            return "text"
        case BoolType():
            return "`true` or `false`"
    raise ValueError(f"there are no words for {kind}")


if __name__ == "__main__":
    sys.stdout.write(settings_page() + "\n" + record_page())
