"""Scenes are compiled once per test run."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from pathlib import Path

import pytest

from apo_bench import Scene, build_scene, load_scenario
from benchmarks.switches import missing


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--bop-dir", type=Path, help="Folder of published estimates and truth, BOP results format.")


def pytest_configure() -> None:
    """A run for other kernels than the processor's own proves that it has them, in every process."""
    if wrong := missing():
        raise pytest.UsageError(wrong)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes longest comes first, so that no process is left alone with it at the end."""
    items.sort(key=lambda item: item.path.suffix != ".ipynb" and item.path.name != "test_success_rate.py")


@pytest.fixture(scope="session")
def tower() -> Scene:
    return build_scene(load_scenario("stick_in_tower"))


@pytest.fixture(scope="session")
def castles() -> Scene:
    return build_scene(load_scenario("stick_on_castles"))
