"""What `apo_bench` exports: there, typed, light, and never hidden by a module of the same name."""

from __future__ import annotations

import ast
import inspect
from pathlib import Path

import numpy as np
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


def test_no_module_has_the_name_of_an_exported_verb() -> None:
    verbs = {name for name in apo_bench.__all__ if name[0].islower()}
    modules = {path.stem if path.stem != "__init__" else path.parent.name for path in PACKAGE.rglob("*.py")}
    assert not verbs & modules


def test_a_level_is_for_a_noise_model_that_is_named() -> None:
    from tests import scenes

    shown = scenes.shown(scenes.stick_in_tower())
    seen = [
        apo_bench.observe(shown, "isotropic", np.random.default_rng(3), noise_level=noise_level)
        for noise_level in (2.0, (2.0, 2.0))
    ]
    assert seen[0].poses.tobytes() == seen[1].poses.tobytes()
    made = apo_bench.observe(shown, "isotropic", np.random.default_rng(3))
    assert np.abs(made.poses - shown.poses).max() < np.abs(seen[0].poses - shown.poses).max()
    with pytest.raises(apo_bench.InputError, match=r"the level 2\.0 was given together with a noise"):
        apo_bench.observe(shown, lambda assembly, shown, rng: seen[0], np.random.default_rng(3), noise_level=2.0)
