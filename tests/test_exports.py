"""What `apo_bench` exports: there, typed, light, and never hidden by a module of the same name."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import pytest

import apo_bench

PACKAGE = Path(apo_bench.__file__).parent
VERBS = ("demonstrate", "observe", "detect_contacts", "correct", "replay", "judge", "run_trial", "run_sweep")


def test_the_verbs_and_their_records_are_exported() -> None:
    records = {"Demonstration", "Observation", "Correction", "Plan", "ReplayResult", "Verdict", "TrialConfig"}
    assert records.union(VERBS) <= set(apo_bench.__all__)
    assert set(apo_bench.__all__) <= set(dir(apo_bench))
    for name in VERBS:
        assert inspect.isfunction(getattr(apo_bench, name))
    with pytest.raises(AttributeError, match="has no attribute 'sweep'"):
        apo_bench.sweep  # type: ignore[attr-defined]  # noqa: B018


def test_static_types_are_of_the_names_that_are_exported() -> None:
    """Each name of `__init__.pyi` comes from the module that `__init__.py` imports it from."""
    stub = ast.parse((PACKAGE / "__init__.pyi").read_text(encoding="utf-8"))
    typed = {a.asname: node.module for node in stub.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert typed == dict(apo_bench._EXPORTS)  # type: ignore[attr-defined]
    assert {"__version__", *typed} == set(apo_bench.__all__)
