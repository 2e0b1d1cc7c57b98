"""Of more holes than a part can have pieces for, those stay that others come into, then the large ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold, OpType

from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from apo_bench.importers.cad.pieces import convex_cutting
from tests.importers.cad.made import block, rod, write_stl

RADII = (1.5, 1.5, 1.5, 2.0, 2.0, 2.5)


def plate() -> Manifold:
    holes = [rod(r, 5, (10 * k, 0, 0), n=24) for k, r in enumerate(RADII)]
    return block(70, 20, 5, (25, 0, 0)) - Manifold.batch_boolean(holes, OpType.Add)


def test_holes_that_nothing_comes_into_are_filled_where_there_are_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, (raw,) = read_raw_solids(write_stl(plate(), tmp_path / "a.stl"), None)
    whole = import_solid(raw, "whole", tmp_path, "a.stl")
    assert len(whole.solid.rounds) == 6
    assert not whole.cut.filled
    monkeypatch.setattr(convex_cutting, "MOST_PIECES", 130)
    at_the_second = np.array([[10.0, 0.3, 2.0]])
    part = import_solid(raw, "part", tmp_path, "a.stl", others=at_the_second)
    assert len(part.solid.pieces) <= 130
    kept = {(round(1e3 * float(w.point[0])), round(1e3 * w.radius, 2)) for w in part.solid.rounds.values()}
    assert (10, 1.5) in kept
    assert (50, 2.5) in kept
    assert len(kept) == 6 - len(part.cut.filled) < 6
    assert all(part.refused[name].startswith("the hole is filled") for name in part.cut.filled)
    # It weighs what is filled too; flat faces keep the holes in their outlines.
    filled = sum(np.pi * r**2 * 5e-9 for r in RADII) - sum(
        np.pi * (1e3 * w.radius) ** 2 * 5e-9 for w in part.solid.rounds.values()
    )
    assert part.solid.volume - whole.solid.volume == pytest.approx(filled, rel=0.01)
    assert {len(face.holes) for face in part.solid.faces.values()} == {0, 6}
