"""The page of the environment names what the environment has, and what it says of autoreset is so."""

from __future__ import annotations

import csv
import inspect
import re
from pathlib import Path

import gymnasium
import numpy as np

import apo_bench
from apo_bench.envs.apo_replay import APOReplay

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "guide" / "environment.md").read_text(encoding="utf-8")


def lines_of(heading: str) -> list[str]:
    """The lines of the table below a heading."""
    section = TEXT.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return [line for line in section.splitlines() if line.startswith("| ")][1:]


def test_every_argument_stands_in_its_table_with_its_default() -> None:
    table = {line.split("|")[1].strip(" `"): line.split("|")[2] for line in lines_of("Arguments")}
    arguments = {name: p.default for name, p in inspect.signature(APOReplay).parameters.items()}
    assert table.keys() == arguments.keys()
    for name, default in arguments.items():
        shown = f'"{default}"' if isinstance(default, str) else str(default)
        assert shown in table[name], name


def test_every_key_of_observation_and_info_stands_in_its_table() -> None:
    env = apo_bench.CorrectPoses(gymnasium.make("APOReplay-v0", scenario="block_on_block", grasp="weld"))
    seen, told = env.reset(seed=0)
    *_, ended = env.step(np.zeros(env.action_space.shape))
    named = {key for line in lines_of("Info") for key in re.findall(r"`(\w+)`", line.split("|")[2])}
    assert named == told.keys() | ended.keys()
    assert {line.split("|")[1].strip(" `") for line in lines_of("Observation space")} == seen.keys()


def test_the_rates_on_the_page_are_those_that_are_kept() -> None:
    with (ROOT / "benchmarks" / "results" / "environment.csv").open(encoding="utf-8") as file:
        kept = {(row["scenario"], row["policy"]): row["successes"] for row in csv.DictReader(file)}
    policies = list(dict.fromkeys(policy for _, policy in kept))
    for scenario in dict.fromkeys(name for name, _ in kept):
        line = next(line for line in lines_of("Rates of simple policies") if line.startswith(f"| [{scenario}]"))
        assert [cell.strip() for cell in line.split("|")[2:-1]] == [kept[scenario, policy] for policy in policies]
