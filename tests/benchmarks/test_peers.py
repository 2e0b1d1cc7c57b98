"""Solvers of others as correctors: each solves what it can say, where its package is installed."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from types import ModuleType

import pytest

from apo_bench import InputError, correct
from tests.correction.baselines.test_baselines import noisy
from tests.correction.test_round_contacts import case

ADAPTED = """
from dataclasses import replace
from typing import Any

import numpy as np
from apo_bench.correction.correctors import correct
from apo_bench.assembly.equations import equations
from benchmarks.corrector_bench.peers_{package} import {package}
from tests.correction.baselines.test_baselines import noisy
for name in ("stick_in_tower", "fixture"):
    seen = noisy(name)
    {check}
blind = replace(seen, observed=~seen.observed)
assert correct(blind, {package}).sentence == "operation 1 was not seen"
"""
AGREES = 'assert np.allclose(correct(seen, gtsam).goals, correct(seen, "least-squares").goals, atol=1e-7)'
MATES = """made = correct(seen, cadquery)
    assert made.ok
    standing = np.array([relation.lost is None for relation in seen.assembly.relations()])
    assert equations(seen.assembly, seen.start, made.goals).gaps(made.goals)[standing].max() < 2e-5"""


def peer(package: str) -> str:
    return f"benchmarks.corrector_bench.peers_{package}:{package}"


@pytest.mark.parametrize(("package", "check"), [("gtsam", AGREES), ("cadquery", MATES)])
def test_adapters_solve_what_they_can_say(package: str, check: str) -> None:
    """GTSAM finds the optimum of `least-squares`; mates hold at the end. Each in a process of its own."""
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
    code = ADAPTED.format(check=check, package=package)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("package", ["gtsam", "cadquery"])
def test_an_adapter_without_its_package_says_what_to_install(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=f"pip install {package}"):
        correct(noisy("bridge"), peer(package))


@pytest.mark.parametrize(("package", "loaded"), [("gtsam", "casadi"), ("cadquery", "gtsam")])
def test_adapters_do_not_meet_in_one_process(package: str, loaded: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, loaded, ModuleType(loaded))
    with pytest.raises(InputError, match="processes of their own"):
        correct(noisy("bridge"), peer(package))


def test_mates_are_those_of_flat_contacts() -> None:
    with pytest.raises(InputError, match="CadQuery knows flat contacts"):
        correct(case("shaft in hole")[0], peer("cadquery"))
