"""Files that are no parts are refused in one sentence; what can be mended is mended, and said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from apo_bench import InputError
from apo_bench.cli.app import main
from apo_bench.importers.cad import part_import
from apo_bench.importers.cad.part_import import import_solid, read_raw_solids
from tests.importers.cad.made import block, rod, write_stl, write_triangles


def triangles(mesh: Any) -> Any:
    raw = mesh.to_mesh()
    return np.asarray(raw.vert_properties)[:, :3][np.asarray(raw.tri_verts)]


def with_bytes(path: Path, raw: bytes) -> Path:
    path.write_bytes(raw)
    return path


def is_open(folder: Path) -> Path:
    return write_triangles(triangles(block(20, 20, 20))[:-1], folder / "a.stl")


def huge(folder: Path) -> Path:
    return write_stl(block(30, 30, 30), folder / "a.stl", 1000.0)


REFUSED: dict[str, tuple[Callable[[Path], Path], str]] = {
    "empty": (lambda folder: with_bytes(folder / "a.stl", b""), "the file is empty"),
    "garbage": (lambda folder: with_bytes(folder / "a.obj", bytes(range(256))), "OBJ file|holds no triangles"),
    "no 3mf": (lambda folder: with_bytes(folder / "a.3mf", b"no zip"), "no 3MF file that can be read"),
    "open": (is_open, "the shell is open: 3 edges"),
    "huge": (huge, "states no unit, and 3e\\+04 may be"),
    "missing": (lambda folder: folder / "a.stl", "cannot be read"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_part_is_refused_in_one_sentence(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, sentence = REFUSED[case]
    with pytest.raises(InputError, match=sentence) as raised:
        read_raw_solids(make(tmp_path), None)
    assert "\n" not in str(raised.value)
    assert main(["part", "import", str(tmp_path / "none.stl"), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_ball_is_refused_before_it_is_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It took two minutes and all the memory."""
    (raw,) = read_raw_solids(write_stl(Manifold.sphere(20, 64), tmp_path / "a.stl"), "mm")[1]
    monkeypatch.setattr(part_import, "cut_solid", None)
    with pytest.raises(InputError, match="no face of the part is flat or round"):
        import_solid(raw, "a", tmp_path, "a.stl")


def shells(*given: Any) -> Any:
    return np.concatenate([triangles(each) for each in given])


def test_shells_that_go_through_each_other_are_united_and_it_is_said(tmp_path: Path) -> None:
    path = write_triangles(shells(block(20, 20, 20), block(10, 10, 40, (3, 2, -7))), tmp_path / "a.stl")
    _, (raw,) = read_raw_solids(path, None)
    assert raw.mesh.volume == pytest.approx(8000 + 10 * 10 * 20)
    assert raw.repairs == ("2 closed shells, some of which go through each other, became 1",)


@pytest.mark.parametrize("at", [(20, 0, 0), (0, 0, 20), (20, 20, 0), (20, 5, 3)])
def test_solids_that_touch_stay_two(at: tuple[float, float, float], tmp_path: Path) -> None:
    _, raws = read_raw_solids(
        write_triangles(shells(block(20, 20, 20), block(20, 20, 20, at)), tmp_path / "a.stl"), None
    )
    assert [len(raw.places) for raw in raws] == [2]
    assert raws[0].mesh.volume == pytest.approx(8000)


def test_a_solid_whose_surface_crosses_itself_becomes_no_part(tmp_path: Path) -> None:
    """A corner of a block is drawn through its floor."""
    given = triangles(block(20, 20, 20))
    given[(given == (10, 10, 20)).all(axis=2)] = (0, 0, -10)
    _, (raw,) = read_raw_solids(write_triangles(given, tmp_path / "a.stl"), None)
    with pytest.raises(InputError, match="its surface may cross itself"):
        import_solid(raw, "a", tmp_path, "a.stl")


def test_triangles_that_look_different_ways_are_refused(tmp_path: Path) -> None:
    given = triangles(block(20, 20, 20))
    given[::3] = given[::3, ::-1]
    with pytest.raises(InputError, match="neighbouring triangles face different ways"):
        read_raw_solids(write_triangles(given, tmp_path / "a.stl"), None)


def test_a_free_surface_is_geometry_without_contact_and_is_said(tmp_path: Path) -> None:
    mesh = block(30, 30, 5, (0, 0, -10)) + Manifold.sphere(10, 32)
    _, (raw,) = read_raw_solids(write_stl(mesh, tmp_path / "a.stl"), None)
    done = import_solid(raw, "ball", tmp_path, "a.stl")
    assert sum(region.kind == "other" for region in raw.regions) == 1
    assert done.cut.hulls == 1
    assert done.solid.volume * 1e9 == pytest.approx(mesh.volume(), rel=0.1)


def test_the_command_says_what_it_did_and_names_as_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_stl(block(40, 30, 10) - rod(4, 10, n=32), tmp_path / "lid 1.stl")
    out = tmp_path / "parts"
    assert main(["part", "import", str(path), "--name", "hole1=bore", "--name", "+z=top", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    for words in ("unit mm", "40 x 30 x 10 mm", "6 plane, 1 cylinder", "bore: hole", "free radius 4"):
        assert words in said
    assert {each.suffix for each in out.iterdir()} == {".xml", ".toml", ".png"}
    assert main(["part", "import", str(path), "--name", "hole7=bore", "--out", str(out)]) == 2
    assert "unknown face 'hole7'" in capsys.readouterr().err
