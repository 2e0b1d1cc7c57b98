"""What is no ordinary file is refused by every reader, and documents that do not fit their type get one sentence."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import pytest

from apo_bench import InputError, load_scenario, read_observation
from apo_bench.formats.bop import read_results
from apo_bench.io import FileTable, NotNegative, Text, Triple, convert_typed, read_typed
from apo_bench.io.documents import parse_plain
from apo_bench.io.safe_io import read_bytes, read_text
from apo_bench.scenario.parts import load_part

READERS: dict[str, Callable[[Path], object]] = {
    "part.xml": load_part,
    "scenario.toml": load_scenario,
    "observation.json": lambda path: read_observation(path, "stick_in_tower"),
    "results.csv": read_results,
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_ordinary_file_is_refused_at_once(reader: str, tmp_path: Path) -> None:
    fifo, folder, link = (tmp_path / f"{kind}_{reader}" for kind in ("fifo", "folder", "link"))
    os.mkfifo(fifo)
    folder.mkdir()
    link.symlink_to("/dev/zero")
    for words, path in (
        ("a pipe", fifo),
        ("a folder", folder),
        ("a device", link),
        ("cannot be read", tmp_path / f"none_{reader}"),
        ("not a path", Path(f"zero\0byte_{reader}")),
    ):
        with pytest.raises(InputError, match=words) as refused:
            READERS[reader](path)
        assert "\n" not in str(refused.value)


def test_only_so_much_is_read(tmp_path: Path) -> None:
    """Also of a file that has no end in sight."""
    path = tmp_path / "large"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(InputError, match=r"larger than 0\.5 MB; give a sweep file"):
        read_bytes(path, "sweep file", 500_000)
    path.write_bytes(b"\xef\xbb\xbfone\r\n")
    assert read_text(path, "file") == "one\r\n"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_text(path, "file")


class Pose(FileTable, frozen=True):
    """A table in a table."""

    at_mm: Triple
    turn_deg: Triple = (0.0, 0.0, 0.0)


class Step(FileTable, frozen=True, tag="step"):
    """One of two kinds."""

    move: Text
    goal: Pose
    kind: Literal["centred", "contact"] = "centred"


class Wait(FileTable, frozen=True, tag="wait"):
    """The other kind."""

    seconds: NotNegative


class Plan(FileTable, frozen=True, kw_only=True):
    """A whole file."""

    schema: Literal[1]
    operations: list[Step | Wait]
    rate: NotNegative = 0.0


STEP: dict[str, Any] = {"type": "step", "move": "stick", "goal": {"at_mm": [1, 2.5, 3]}}
GOOD: dict[str, Any] = {"schema": 1, "operations": [STEP, {"type": "wait", "seconds": 2}]}


def test_a_document_becomes_its_type(tmp_path: Path) -> None:
    plan = convert_typed(GOOD, Plan, "plan")
    assert plan == Plan(schema=1, operations=[Step("stick", Pose((1.0, 2.5, 3.0))), Wait(2.0)])
    path = tmp_path / "plan.toml"
    path.write_text('schema = 1\n[[operations]]\ntype = "wait"\nseconds = 2\n')
    assert read_typed(path, Plan, "plan").operations == [Wait(2.0)]
    path.write_text('{"schema": 1, "operations": []}')
    assert read_typed(path, Plan, "plan", syntax="json").operations == []


@pytest.mark.parametrize(
    ("document", "sentence"),
    [
        ([], "plan: a table of named keys is needed, [] was given."),
        (GOOD | {"rat": 1}, "plan: unknown key 'rat' (did you mean 'rate'?)."),
        (GOOD | {"rate": -1}, "plan, rate: a number >= 0.0 is needed, -1 was given."),
        (GOOD | {"rate": "fast"}, 'plan, rate: a number is needed, "fast" was given.'),
        (
            GOOD | {"operations": [STEP | {"move": "\x1b[2J"}]},
            "plan, operation 1, move: a text without control characters",
        ),
        (GOOD | {"operations": [STEP, STEP | {"goal": {}}]}, "plan, operation 2, goal: the key 'at_mm' is missing."),
    ],
)
def test_what_does_not_fit_its_type_is_said_in_one_sentence(document: Any, sentence: str) -> None:
    with pytest.raises(InputError) as refused:
        convert_typed(document, Plan, "plan")
    assert str(refused.value).startswith(sentence)
    assert str(refused.value).endswith(".")


@pytest.mark.parametrize(("text", "syntax"), [("a = = 1", "toml"), ("a = 1\na = 2", "toml")])
def test_text_of_another_syntax_is_refused(text: str, syntax: Any) -> None:
    with pytest.raises(InputError, match=f"plan: this is not {syntax.upper()} ") as refused:
        parse_plain(text, "plan", syntax)
    assert "\n" not in str(refused.value)
