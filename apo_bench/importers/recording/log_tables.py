"""Read log files as tables of text cells: CSV with a header, TUM, and ROS messages in JSON."""

import csv
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.errors import InputError, require
from apo_bench.io import check_separator, read_text

LARGEST_LOG_BYTES = 200_000_000
_TUM_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")  # TUM files have no line of names


class LogTable(NamedTuple):
    """The cells of a log as written in the file, one row per pose."""

    file: Path
    names: Sequence[str]
    """Names of the columns."""
    rows: Sequence[Sequence[Any]]
    places: Sequence[str]
    """Location of each row for messages, as `file, line 3`."""


def read_csv_table(path: Path) -> LogTable:
    """Read a CSV file whose first line names the columns."""
    text = io.StringIO(read_text(path, "log", LARGEST_LOG_BYTES), newline="")
    reader = csv.reader(text, skipinitialspace=True)
    try:
        lines = [(f"{path}, line {reader.line_num}", [cell.strip() for cell in row]) for row in reader if any(row)]
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: this is not a CSV file ({error}).") from error
    require(lines, f"{path}: the file is empty; its first line names the columns, such as t_s,id,x_mm,y_mm,z_mm.")
    (first, names), *rows = lines
    check_separator(first, names)
    for place, cells in rows:
        require(
            len(cells) == len(names),
            f"{place}: {len(cells)} cells were given, and the first line names {len(names)} columns; "
            "begin the log with the line of names, and leave out broken rows.",
        )
    return LogTable(path, names, [cells for _, cells in rows], [place for place, _ in rows])


def read_tum_table(path: Path) -> LogTable:
    """Read lines of `timestamp tx ty tz qx qy qz qw`, [s, m]; lines that begin with # are comments."""
    lines = enumerate(read_text(path, "log", LARGEST_LOG_BYTES).splitlines(), start=1)
    rows = {f"{path}, line {line}": text.split() for line, text in lines if text.strip() and text.lstrip()[0] != "#"}
    for place, words in rows.items():
        require(
            len(words) == len(_TUM_COLUMNS),
            f"{place}: {len(words)} words were given; eight numbers are needed, timestamp tx ty tz qx qy qz qw.",
        )
    return LogTable(path, _TUM_COLUMNS, [*rows.values()], [*rows])


def read_ros_json_table(path: Path) -> LogTable:
    """Read ROS messages in JSON, a list or one per line; without a child_frame_id the topic is the id."""
    names: list[str] = []
    rows = []
    places = []
    for place, message in _messages(path):
        for fields in _poses_in(message):
            fields.setdefault("child_frame_id", str(message.get("topic", path.stem)).strip("/"))
            names = names or sorted(fields)
            require(sorted(fields) == names, f"{place}: the message has other fields than the first; log one kind.")
            rows.append([fields[name] for name in names])
            places.append(place)
    return LogTable(path, names, rows, places)


def _messages(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each message with its location in the file."""
    text = read_text(path, "log", LARGEST_LOG_BYTES)
    try:
        if text.lstrip().startswith("["):
            documents = {f"{path}, message {i}": each for i, each in enumerate(json.loads(text), start=1)}
        else:
            lines = enumerate(text.splitlines(), start=1)
            documents = {f"{path}, line {i}": json.loads(line) for i, line in lines if line.strip()}
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: this is not JSON ({str(error)[:80]}); give a list or one message a line.") from error
    for place, message in documents.items():
        require(isinstance(message, dict), f"{place}: a message with named fields is needed.")
        yield place, message


def _poses_in(message: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the fields of each pose in a message: its own, those of an inner message, or those of a TFMessage."""
    message = next((message[key] for key in ("msg", "message", "data") if key in message), message)
    for each in message.get("transforms", [message]):
        yield dict(_flatten(each, ""))


def _flatten(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield the innermost values with their dotted names."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _flatten(inner, f"{name}.{key}" if name else key)
    else:
        yield name, value
