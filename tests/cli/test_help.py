"""`--help` in groups with examples, and what a shell offers when Tab is pressed."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import typer

from apo_bench.cli.app import app, main
from apo_bench.cli.shared import GROUPS, OPTIONS
from apo_bench.cli.shared.completion import list_offered_names
from apo_bench.cli.shared.help import OTHERS
from apo_bench.perception.observation.noise import NOISES, NoiseLevel, make_noise
from apo_bench.records.contact_sources import check_contact_source
from apo_bench.records.methods import check_method
from apo_bench.scenario.scenario_file import list_scenario_names
from apo_bench.simulation.arms.finding import arm_names


def commands(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    yield words, command
    for name, one in getattr(command, "commands", {}).items():
        yield from commands(one, (*words, name))


EVERY = dict(commands(typer.main.get_command(app)))


def test_every_command_stands_under_one_heading() -> None:
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted(name for words in EVERY if len(words) == 1 for name in words)


@pytest.mark.parametrize("words", EVERY, ids=" ".join)
def test_every_help_page_ends_with_two_examples_that_can_be_typed(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--help"]) == 0
    page, _, examples = capsys.readouterr().out.partition("\nExamples:\n")
    assert page.lstrip().startswith("Usage: apo-bench")
    assert max(map(len, page.splitlines())) <= 80
    lines = examples.strip().splitlines()
    assert len(lines) == 2
    for line in lines:
        typed = shlex.split(line.split("MUJOCO_GL=egl ")[-1])[1:]
        command = EVERY[()]
        while hasattr(command, "commands"):
            command = command.commands[typed.pop(0)]
        command.make_context("apo-bench", typed)


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_every_option_stands_under_one_heading_and_whole(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    main([command, "--help"])
    said = capsys.readouterr().out
    headings = [line[:-1] for line in said.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert headings == ["Arguments", *(heading for heading in OPTIONS if heading in headings), OTHERS, "Examples"]
    named = [name for names in OPTIONS.values() for name in names]
    assert len(named) == len(set(named))
    written = "".join(said.split())
    for one in EVERY[command,].params:
        assert one.opts[0] in (*named, "scenario", "scenarios")
        assert "".join(one.help.split()) in written
    assert said.split(f"{OTHERS}:")[1].split()[0] == "--help"


def test_offered_names_are_the_known_names() -> None:
    assert tuple(list_offered_names("scenario")) == list_scenario_names()
    assert {name for name in list_offered_names("arm") if not name.endswith(":")} == set(arm_names())
    assert [check_method(name) for name in list_offered_names("method")] == list_offered_names("method")
    assert [check_contact_source(name) for name in list_offered_names("contact_source") if name != "face-offset"]
    assert set(NOISES) < set(list_offered_names("noise"))
    for name in list_offered_names("noise"):
        assert make_noise(name, NoiseLevel(1.0, 1.0))
