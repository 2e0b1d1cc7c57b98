"""Two pages of the reference, read from the types: the settings of a trial, and the columns of a row."""

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

from apo_bench.cli.setting_options import axis_flag
from apo_bench.records import (
    CODES,
    KEY,
    LARGEST_NUMBER,
    REQUIRED,
    ROW,
    ROW_FIELDS,
    SETTINGS,
    STAGES,
    Row,
    SettingInfo,
    TrialSettings,
)

SETTINGS_HEAD = """# Settings of a trial

With the same code and the same files these settings determine the row of a trial. In Python they are the fields of
`TrialSettings`; `apo-bench replay` takes them as options. A sweep varies those that have an axis: a field of
`SweepSettings`, a key of a sweep file and an option of `apo-bench sweep`. `--level L` stands for
`--level-mm L --level-deg L`; its axis is `levels`.
"""
ROW_HEAD = f"""# Columns of a row

A row is what is kept of one trial: one JSON object, one line of `trials.jsonl`, of schema `{ROW}`. Lengths are in mm,
angles in degrees, quaternions are wxyz, operations are numbered from 1. The columns of the *key* tell the trials of one
sweep apart; *needed* is what every row must say besides. A column that may be null may also be left out.
"""
FEW = 4
"""Words of a closed list that fit in a table."""


def settings_page() -> str:
    """The page of settings, as Markdown."""
    said = sentences(TrialSettings)
    lines = [SETTINGS_HEAD, "| setting | meaning | value | default | option | axis |", "|---|---|---|---|---|---|"]
    for name, info in SETTINGS.items():
        option = f"`--{info.option}`" if info.help else "argument"
        default = "" if info.default is MISSING else info.usual or f"`{info.default}`"
        axis = [f"`{info.axis}`"] * bool(info.axis) + [f"`{axis_flag(info)}`"] * bool(info.axis and info.help)
        lines.append(f"| `{name}` | {said[name]} | {value_of(info)} | {default} | {option} | {', '.join(axis)} |")
    return "\n".join(lines) + "\n"


def row_page() -> str:
    """The page of columns, as Markdown."""
    said = sentences(Row)
    lines = [ROW_HEAD, "| column | meaning | value | null | |", "|---|---|---|---|---|"]
    for column, kind in ROW_FIELDS.items():
        value, null = without_null(type_info(kind))
        need = "key" if column in KEY else "needed" if column in REQUIRED else ""
        lines.append(f"| `{column}` | {said[column]} | {words(value)} | {'yes' if null else ''} | {need} |")
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
    return "a secret in a file" if info.name == "salt" else words(type_info(info.kind))


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
    sys.stdout.write(settings_page() + "\n" + row_page())
