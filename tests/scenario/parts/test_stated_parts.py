"""Faces, matter and pieces of parts that are not boxes alone: what does not agree is refused in one sentence."""

from __future__ import annotations

import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, build_scene, load_scenario
from apo_bench.resources import folder
from apo_bench.scenario.parts import find_part_path, list_part_names, load_part, read_part
from apo_bench.scenario.parts.face_checks import FaceError
from apo_bench.scenario.parts.making import bore, extrude, join, make_rectangle, make_shaft, write_part
from apo_bench.scenario.parts.mass_checks import check_part

MADE = join(
    extrude(
        make_rectangle(40, 40, names=("ny", "px", "py", "nx")),
        0,
        10,
        bores=[bore((-8, 0), 3, 0, 10, "bore", fit=True)],
        bottom="bottom",
        top="top",
    ),
    make_shaft(4, 10, 22, "pin", chamfer_high=1, top="tip").moved((10, 0, 0)),
)


@pytest.fixture
def part(tmp_path: Path) -> Path:
    return write_part("thing", MADE, tmp_path, density=2700.0, source="a test", licence="Apache-2.0")


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as refused:
        load_part(path)
    message = str(refused.value)
    assert message.startswith((str(path), str(path.with_suffix(".toml"))))
    assert message.endswith(".")
    assert "\n" not in message
    assert len(message) < 2 * len(str(path)) + 320
    return message


OUTLINE = r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n"
FACES = {
    "another schema": (r"part/1", "part/9", '"apo-bench/part/1" is needed'),
    "an inertia in other units": (r"inertia_mm5 = .*", "inertia_mm5 = [1, 1, 1, 0, 0, 0]", "inertia_mm5: that of"),
    "another kind": (r'kind = "plane"', 'kind = "torus"', '"plane" or "cylinder" or "cone" or "rim" is needed'),
    "off its plane": (
        OUTLINE,
        r"\1outline_mm = [[-20, -20, 0], [-20, -20, 10], [-20, 20, 10], [-20.1, 20, 0]]" + "\n",
        "within 0.001 mm of one plane",
    ),
    "a wider bore": (r"radius_mm = 3.0\n", "radius_mm = 3.1\n", "pieces have a side 3.0"),
    "half a turn of nothing": (r"hole = true", "hole = true\nextent_deg = 180", "extent_deg below 360 and toward"),
    "a steeper cone": (r"radii_mm = \[4.0, 3.0\]", "radii_mm = [4, 3.2]", "of the wall"),
}


@pytest.mark.parametrize("case", FACES)
def test_what_is_stated_must_be_so(case: str, part: Path) -> None:
    old, new, words = FACES[case]
    beside = part.with_suffix(".toml")
    text, count = re.subn(old, new, beside.read_text(encoding="utf-8"), count=1)
    assert count == 1
    beside.write_text(text, encoding="utf-8")
    assert words in refusal(part)


PIECES = {
    "a flat piece": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 1 1 0"', "is flat"),
    "a corner inside": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 1 .1 .1 .1"', "is not convex: its corner 5"),
    "a piece far away": (r'type="cylinder" pos="[0-9.]* ', 'type="cylinder" pos="0.5 ', "separate solids"),
}


@pytest.mark.parametrize("case", PIECES)
def test_pieces_must_be_convex_and_one(case: str, part: Path) -> None:
    old, new, words = PIECES[case]
    text, count = re.subn(old, new, part.read_text(encoding="utf-8"), count=1)
    assert count == 1
    part.write_text(text, encoding="utf-8")
    assert words in refusal(part)


def test_the_error_of_a_face_names_it_also_after_pickling(part: Path) -> None:
    stated = part.with_suffix(".toml")
    stated.write_text(stated.read_text(encoding="utf-8").replace("radius_mm = 3.0\n", "radius_mm = 3.1\n"), "utf-8")
    with pytest.raises(FaceError) as caught:
        load_part(part)
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value)
    assert (again.face, again.reason) == ("bore", caught.value.reason)
    assert again.reason.startswith("pieces have a side 3.0")


def stl(triangles: np.ndarray) -> bytes:
    """A binary STL file."""
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.zeros(len(triangles), dtype=row)
    rows["corners"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()


TETRAHEDRON = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
TRIANGLES = TETRAHEDRON[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
PICTURE = '<geom name="looks" type="mesh" mesh="looks" contype="0" conaffinity="0"/>'


def with_picture(part: Path, geom: str, file: str = "looks.stl") -> None:
    text = part.read_text(encoding="utf-8")
    text = text.replace("</asset>", f'<mesh name="looks" file="{file}"/></asset>').replace("</body>", geom + "</body>")
    part.write_text(text, encoding="utf-8")


def test_a_picture_is_shown_and_never_collides(part: Path, tmp_path: Path) -> None:
    pieces = load_part(part).pieces
    with_picture(part, PICTURE)
    (part.parent / "looks.stl").write_bytes(stl(TRIANGLES))
    assert [piece.name for piece in load_part(part).pieces] == [piece.name for piece in pieces]
    assert read_part(part).files == (part, part.parent / "looks.stl", part.with_suffix(".toml"))
    file = tmp_path / "mine.toml"
    text = (folder("scenarios") / "stick_in_tower.toml").read_text(encoding="utf-8")
    more = '[parts.thing]\nfile = "thing.xml"\nfixed = true\nstart = { at_mm = [-300, 300, 0] }\n\n[site]'
    file.write_text(text.replace("\n[site]", f"\n{more}"), encoding="utf-8")
    model = build_scene(load_scenario(file)).work.model
    looks = model.geom("thing/looks")
    assert (looks.contype[0], looks.conaffinity[0], looks.group[0]) == (0, 0, 1)
    names = [model.geom(i).name for i in range(model.ngeom) if model.geom_group[i] < 3]
    assert [name for name in names if name.startswith("thing/")] == ["thing/looks"]
    assert model.body("thing/").subtreemass == pytest.approx(2700.0 * load_part(part).volume, rel=2e-3)


@pytest.mark.parametrize("name", list_part_names())
def test_parts_of_the_package_are_as_they_say(name: str) -> None:
    """They are not held against their pieces each time that they are loaded."""
    check_part(read_part(find_part_path(name)), load_part(name))


def test_a_part_file_is_read_once_until_it_or_the_file_beside_it_changes(tmp_path: Path) -> None:
    for suffix in (".xml", ".toml"):
        shutil.copy(find_part_path("peg").with_suffix(suffix), tmp_path / f"mine{suffix}")
    mine = tmp_path / "mine.xml"
    first = read_part(mine)
    assert read_part(mine) is first
    beside = mine.with_suffix(".toml")
    beside.write_text(beside.read_text().replace("density = ", "density = 1"))
    assert read_part(mine).density > first.density
    mine.write_text("<mujoco/>")
    with pytest.raises(InputError):
        read_part(mine)
