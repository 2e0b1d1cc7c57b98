"""CAD files become parts and scenarios from Python."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh
from manifold3d import Manifold

import apo_bench


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two blocks, one on the other, in one STL file."""
    folder = tmp_path_factory.mktemp("drawn")
    low = Manifold.cube((60, 50, 20)).translate((-30, -25, 0))
    high = Manifold.cube((30, 30, 40)).translate((-15, -15, 20))
    meshes = [each.to_mesh() for each in (low, high)]
    both = trimesh.util.concatenate([trimesh.Trimesh(m.vert_properties, m.tri_verts) for m in meshes])
    both.export(folder / "blocks.stl")
    return folder / "blocks.stl"


def test_an_assembly_becomes_a_scenario_that_runs(drawn: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scenario = apo_bench.import_assembly(drawn, unit="mm")
    assert (scenario.name, len(scenario.assembly), scenario.source) == ("blocks", 1, Path("blocks.toml"))
    assert apo_bench.check_scenario(scenario, seeds=0) == ()
    record = apo_bench.run_trial(scenario, method="oracle", fidelity="near-contact")
    assert record["success"]
    with pytest.raises(apo_bench.InputError, match="exists already"):
        apo_bench.import_assembly([drawn], unit="mm")
    saved = apo_bench.save_scenario(scenario, tmp_path / "copy")
    assert [str(each) for each in apo_bench.load_scenario(saved).assembly.operations[0].contacts] == [
        str(each) for each in scenario.assembly.operations[0].contacts
    ]
    with pytest.raises(apo_bench.InputError, match="save to another folder"):
        apo_bench.save_scenario(scenario, tmp_path / "copy")


def test_an_import_that_fails_leaves_no_parts(drawn: Path, tmp_path: Path) -> None:
    for wrong in ({"order": ["nothing"]}, {"fixed": ["nothing"]}, {"up": "w"}):
        with pytest.raises(apo_bench.InputError):
            apo_bench.import_assembly(drawn, tmp_path / "blocks.toml", unit="mm", **wrong)
    assert list(tmp_path.iterdir()) == []
    kept = tmp_path / "blocks_parts" / "mine.txt"
    kept.parent.mkdir()
    kept.touch()
    with pytest.raises(apo_bench.InputError):
        apo_bench.import_assembly(drawn, tmp_path / "blocks.toml", unit="mm", fixed=["nothing"])
    assert kept.exists()


def test_a_scenario_is_shown_assembled_and_at_its_start() -> None:
    finished, start = (apo_bench.show_scenario("block_on_block", finished=end) for end in (True, False))
    assert finished.shape == start.shape == (480, 640, 3)
    assert (finished != start).any()
