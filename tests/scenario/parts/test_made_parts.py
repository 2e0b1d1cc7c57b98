"""The parts with round and tilted faces are those that their script makes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from apo_bench.resources import folder
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import build_solid

SCRIPT = folder("assets") / "make_parts.py"


def _script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_parts", SCRIPT)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MADE = _script().PARTS


@pytest.mark.parametrize("name", MADE)
def test_a_part_file_says_what_the_script_makes(name: str) -> None:
    """To a nanometre: files have a finite number of digits, and other machines round differently."""
    written = load_part(Path(folder("assets") / "parts" / f"{name}.xml"))
    made = build_solid(name, MADE[name])
    assert set(written.faces) == set(made.faces)
    assert set(written.rounds) == set(made.rounds)
    assert written.volume == pytest.approx(made.volume, rel=1e-6)
    assert written.centroid == pytest.approx(made.centroid, abs=1e-9)
    for face, other in ((written.faces[key], made.faces[key]) for key in made.faces):
        assert face.fit == other.fit
        assert np.sort(face.outline, axis=0) == pytest.approx(np.sort(other.outline, axis=0), abs=2e-9)
    for wall, drawn in ((written.rounds[key], made.rounds[key]) for key in made.rounds):
        assert (wall.hole, wall.fit) == (drawn.hole, drawn.fit)
        assert wall.radii == pytest.approx(drawn.radii, abs=2e-9)
        assert wall.ends == pytest.approx(drawn.ends, abs=2e-9)
