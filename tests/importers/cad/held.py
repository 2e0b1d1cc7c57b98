"""What an import must be of a solid that was made, whichever file it came from."""

from __future__ import annotations

import pytest

from apo_bench.importers.cad.part_import import ImportedPart
from tests.importers.cad.made import Made

FREE_MM = 0.01
VOLUME = 1e-3


def hold(done: ImportedPart, made: Made, within_mm: float) -> None:
    """Faces right in number and kind, radii within so much, volume and free radii."""
    whole = [r for r in done.raw.regions if r.is_whole]
    assert sum(r.kind == "plane" for r in done.raw.regions) == made.flats
    assert sum(r.is_round and not r.is_whole for r in done.raw.regions) == made.arcs
    assert sum(r.kind == "cone" for r in whole) == made.cones
    assert sum(r.kind == "other" for r in done.raw.regions) == 0
    for hole, radii in ((True, made.holes), (False, made.shafts)):
        found = sorted(r.radii[0] for r in whole if r.kind == "cylinder" and r.hole == hole)
        assert found == pytest.approx(list(radii), abs=within_mm)
    assert dict(done.refused) == {}
    assert 1e9 * done.solid.volume == pytest.approx(made.volume, rel=VOLUME)
    free = sorted(done.free_mm[n] for n, wall in done.solid.rounds.items() if wall.hole and wall.kind == "cylinder")
    assert free == pytest.approx(list(made.holes), abs=FREE_MM)
    assert done.cut.hulls == 0
