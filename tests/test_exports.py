"""What `apo_bench` exports: there, typed, light, and never hidden by a module of the same name."""

from __future__ import annotations

import ast
import importlib
import inspect
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import apo_bench
from apo_bench.moved import MODULES, NAMES
from apo_bench.names import resolve
from apo_bench.trial.fingerprint import noise_content

PACKAGE = Path(apo_bench.__file__).parent
VERBS = ("demonstrate", "observe", "recognise", "correct", "replay", "judge", "run_trial", "run_sweep")


def test_the_verbs_and_their_records_are_exported() -> None:
    records = {"Demonstration", "Observation", "Correction", "Plan", "ReplayResult", "Verdict", "TrialSettings"}
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


@pytest.mark.parametrize("old", [old for old in MODULES if MODULES[old]])
def test_an_old_module_path_leads_to_the_new_place_with_a_warning(old: str) -> None:
    sys.modules.pop(f"apo_bench.{old}", None)
    new = importlib.import_module(f"apo_bench.{MODULES[old]}")
    with pytest.warns(DeprecationWarning, match=rf"apo_bench\.{old} is apo_bench\.{MODULES[old]} now"):
        moved = importlib.import_module(f"apo_bench.{old}")
    public = [name for name in vars(new) if not name.startswith("_")]
    assert public
    assert all(getattr(moved, name) is getattr(new, name) for name in public)
    for before, after in NAMES.get(old, {}).items():
        place, _, name = after.rpartition(".")
        there = importlib.import_module(f"apo_bench.{place}") if place else new
        assert getattr(moved, before) is getattr(there, name)


def test_a_noise_model_may_be_named_by_its_old_path() -> None:
    """It is the same class, and its rows have a hash over the same file."""
    from apo_bench.observation.models.symmetric import AnyTurn

    sys.modules.pop("apo_bench.observation.symmetric", None)
    with pytest.warns(DeprecationWarning, match="models[.]symmetric now"):
        found = resolve("apo_bench.observation.symmetric:AnyTurn", {}, "noise model")
    assert found is AnyTurn
    old, new = (noise_content(f"apo_bench.observation.{of}symmetric:AnyTurn") for of in ("", "models."))
    assert list(old.values()) == list(new.values()) != []


def test_names_of_a_module_that_is_a_package_now_are_found_in_it() -> None:
    with pytest.warns(DeprecationWarning, match=r"topology\.Assembly now"):
        from apo_bench.assembly import Assembly
    assert Assembly is apo_bench.Assembly
    with pytest.warns(DeprecationWarning, match=r"json_reading\.read_json_observation now"):
        from apo_bench.files import read_observation as read_json
    assert inspect.isfunction(read_json)
    with pytest.raises(ImportError, match="nonsense"):
        from apo_bench.assembly import nonsense  # noqa: F401


def test_what_is_at_its_place_is_imported_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        from apo_bench.assembly import topology
        from apo_bench.observation import noise

        assert topology.Assembly is apo_bench.Assembly
        assert noise.NOISES
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module("apo_bench.observation.unheard_of")


def test_a_level_is_for_a_noise_model_that_is_named() -> None:
    from tests import scenes

    shown = scenes.shown(scenes.stick_in_tower())
    seen = [apo_bench.observe(shown, "isotropic", np.random.default_rng(3), level=level) for level in (2.0, (2.0, 2.0))]
    assert seen[0].goals.tobytes() == seen[1].goals.tobytes()
    made = apo_bench.observe(shown, "isotropic", np.random.default_rng(3))
    assert np.abs(made.goals - shown.goals).max() < np.abs(seen[0].goals - shown.goals).max()
    with pytest.raises(apo_bench.InputError, match=r"the level 2\.0 was given together with a noise"):
        apo_bench.observe(shown, lambda assembly, shown, rng: seen[0], np.random.default_rng(3), level=2.0)
