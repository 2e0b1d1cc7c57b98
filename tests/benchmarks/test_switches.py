"""What `make test` runs under other kernels runs under them, and what the processor does not allow is named."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, replace

import pytest

from benchmarks import switches
from benchmarks.switches import EXPECTED, Kernels, Switch

OWN = Kernels(("SkylakeX", "SkylakeX"), ("X86_V3", "X86_V4"))
BARE = replace(OWN, numpy=())


def found(
    monkeypatch: pytest.MonkeyPatch, own: Kernels, blas: Mapping[str, Kernels | str], plain: Kernels | str
) -> list:
    """The switches of a processor on which processes say this of their kernels."""
    monkeypatch.setattr(switches, "under", lambda asked: blas.get(asked.get("OPENBLAS_CORETYPE"), plain))
    monkeypatch.setattr(switches, "BLAS", tuple(blas))
    return list(switches.switches(own))


def test_a_switch_is_one_whose_kernels_run_in_both_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = {
        "Haswell": replace(OWN, blas=("Haswell", "Haswell")),
        "Zen": replace(OWN, blas=("Haswell", "Haswell")),
        "SkylakeX": OWN,
        "Nehalem": replace(OWN, blas=("Nehalem", "SkylakeX")),
        "Cooperlake": "this processor lacks instructions that it needs",
    }
    plain, haswell, zen, own, half, dead = found(monkeypatch, OWN, kernels, BARE)
    assert haswell == Switch("OpenBLAS Haswell", {"OPENBLAS_CORETYPE": "Haswell"}, kernels["Haswell"])
    assert zen == "Zen is not run: OpenBLAS takes Haswell for it on this processor"
    assert own == "SkylakeX is not run again: it is what OpenBLAS takes on this processor by itself"
    assert half == "Nehalem is not run: OpenBLAS takes Nehalem and SkylakeX for it on this processor"
    assert dead == "Cooperlake is not run: this processor lacks instructions that it needs"
    assert plain.environment == {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"}


def test_a_process_says_when_it_has_not_the_kernels_that_it_was_started_for(monkeypatch: pytest.MonkeyPatch) -> None:
    here = switches.in_use()
    monkeypatch.setenv(EXPECTED, json.dumps(asdict(here)))
    assert switches.missing() is None
    monkeypatch.setenv(EXPECTED, json.dumps(asdict(replace(here, blas=("Nonsense",)))))
    assert "not" in str(switches.missing())
    monkeypatch.delenv(EXPECTED)
    assert switches.missing() is None
