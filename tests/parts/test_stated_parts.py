"""Faces, matter and pieces of parts that are not boxes alone: what does not agree is refused in one sentence."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.geometry import physical_pieces
from apo_bench.io.documents import JsonNode
from apo_bench.parts import load_part, part_names, part_path, read_part
from apo_bench.parts.allowed import LARGEST_PART_BYTES
from apo_bench.parts.checking import check_part
from apo_bench.parts.making import bore, circle, extrude, join, rectangle, shaft, write_part
from apo_bench.parts.stated import _beside

MADE = join(
    extrude(
        rectangle(40, 40, names=("ny", "px", "py", "nx")),
        0,
        10,
        bores=[bore((-8, 0), 3, 0, 10, "bore", fit=True)],
        bottom="bottom",
        top="top",
    ),
    shaft(4, 10, 22, "pin", chamfer_high=1, top="tip").moved((10, 0, 0)),
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


def test_the_part_loads_with_its_matter(part: Path) -> None:
    file = read_part(part)
    assert file.density == 2700.0
    assert file.xml.count('density="2700.0"') == len(file.pieces) == len(load_part(part).pieces)
    assert file.stated is not None
    assert (file.stated.source, file.stated.licence) == ("a test", "Apache-2.0")


def test_faces_with_hundreds_of_holes_take_as_much_room_as_the_part_file(part: Path) -> None:
    beside = part.with_suffix(".toml")
    beside.write_text(beside.read_text() + "#" * 1_500_000 + "\n")
    assert load_part(part).faces
    beside.write_text(beside.read_text() + "#" * LARGEST_PART_BYTES)
    assert "larger than 4 MB" in refusal(part)


FACES = {
    "a schema of another kind": (r"part/1", "part/9", '"apo-bench/part/1" is needed'),
    "an unknown key": (r"density", "densety", "unknown key 'densety'; did you mean 'density'"),
    "no volume": (r"volume_mm3 = .*\n", "", "the key 'volume_mm3' is missing"),
    "a volume of something else": (r"volume_mm3 = .*", "volume_mm3 = 17000.0", "volume_mm3: 17000 is stated"),
    "no volume at all": (r"volume_mm3 = .*", "volume_mm3 = 0", "a finite number above 0"),
    "not a number": (r"volume_mm3 = .*", "volume_mm3 = nan", "a finite number above 0"),
    "a centroid elsewhere": (r"centroid_mm = .*", "centroid_mm = [1, 0, 5]", "centroid_mm: that of the pieces is"),
    "an infinite centroid": (r"centroid_mm = .*", "centroid_mm = [inf, 0, 5]", "3 finite numbers are needed"),
    "an inertia in other units": (r"inertia_mm5 = .*", "inertia_mm5 = [1, 1, 1, 0, 0, 0]", "inertia_mm5: that of"),
    "an inertia of nothing": (r"inertia_mm5 = .*", "inertia_mm5 = [1, 1, -1, 0, 0, 0]", "of a solid are needed"),
    "too heavy": (r"density = .*", "density = 1e9", "a finite number from 1 to 25000"),
    "friction of nothing": (r"friction = .*", "friction = []", "1 to 3 numbers"),
    "much friction": (r"friction = .*", "friction = 99", "1 to 3 numbers"),
    "a date": (r"source = .*", "source = 1999-01-01", "the date or time"),
    "no faces": (r"(?s)\[faces.*", "[faces]\n", "tables of faces are needed"),
    "a name with a dot": (r"\[faces\.top\]", '[faces."top.most"]', "letters, digits and underscores"),
    "another kind": (r'kind = "plane"', 'kind = "torus"', 'kind = "plane" or "cylinder" or "cone" or "rim"'),
    "a twisted outline": (
        r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n",
        r"\1outline_mm = [[-20, -20, 0], [-20, 20, 10], [-20, 20, 0], [-20, -20, 10]]" + "\n",
        "corners around an area",
    ),
    "two corners": (
        r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n",
        r"\1outline_mm = [[0, 0, 0], [0, 1, 0]]" + "\n",
        "three",
    ),
    "off its plane": (
        r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n",
        r"\1outline_mm = [[-20, -20, 0], [-20, -20, 10], [-20, 20, 10], [-20.1, 20, 0]]" + "\n",
        "within 0.001 mm of one plane",
    ),
    "beside its sides": (
        r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n",
        r"\1outline_mm = [[-20, -20, 0], [-20, -20, 11], [-20, 20, 11], [-20, 20, 0]]" + "\n",
        "no side of a piece lies below the face",
    ),
    "turned inwards": (
        r"(?s)(\[faces\.nx\].*?)outline_mm = .*?\n",
        r"\1outline_mm = [[-20, -20, 0], [-20, 20, 0], [-20, 20, 10], [-20, -20, 10]]" + "\n",
        "no side of a piece lies below the face",
    ),
    "no hole where the pin stands": (
        r"(?s)(\[faces\.top\].*?)holes_mm = .*?\n",
        r"\1",
        "no side of a piece lies below",
    ),
    "a wider bore": (r"radius_mm = 3\n", "radius_mm = 3.1\n", "pieces have a side 3.0"),
    "a narrower bore": (r"radius_mm = 3\n", "radius_mm = 2.95\n", "pieces lie along 0% of the wall"),
    "a bore elsewhere": (r"at_mm = \[-8", "at_mm = [-8.02", "pieces have a side"),
    "a longer bore": (r"(?s)(\[faces\.bore\].*?)span_mm = .*?\n", r"\1span_mm = [0, 30]" + "\n", "of the wall"),
    "a bore that is a shaft": (r"(?s)(\[faces\.bore\].*?)hole = true", r"\1hole = false", "pieces have a side"),
    "a thicker pin": (r"radius_mm = 4\n", "radius_mm = 4.01\n", "pieces lie along 0% of the wall"),
    "a longer pin": (r"span_mm = \[10, 21\]", "span_mm = [0, 21]", "mm is stated"),
    "an axis of no length": (r"axis = \[0, 0, 1\]", "axis = [0, 0, 0]", "a direction, three numbers"),
    "a tilted axis": (r"axis = \[0, 0, 1\]", "axis = [0, 0.01, 1]", "mm is stated"),
    "a span from end to start": (r"span_mm = \[10, 21\]", "span_mm = [21, 10]", "a start and an end"),
    "half a turn of nothing": (
        r"hole = true",
        "hole = true\nextent_deg = 180",
        "extent_deg below 360 and toward",
    ),
    "a cone of one radius": (r"radii_mm = \[4, 3\]", "radii_mm = [4, 4]", "two radii that differ"),
    "a steeper cone": (r"radii_mm = \[4, 3\]", "radii_mm = [4, 3.2]", "of the wall"),
    "a face twice": (
        r"\Z",
        '\n[faces.again]\nkind = "plane"\noutline_mm = [[-20, -20, 0], [-20, -20, 10], [-20, 20, 10], [-20, 20, 0]]\n',
        "the face lies on 'nx'",
    ),
    "a wall twice": (
        r"\Z",
        '\n[faces.again]\nkind = "cylinder"\nat_mm = [10, 0, 0]\naxis = [0, 0, 1]\nradius_mm = 4\n'
        "span_mm = [12, 20]\nhole = false\n",
        "the face lies on 'pin'",
    ),
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
    "no corners": (r' vertex="[^"]*"', "", "has no vertex="),
    "three corners": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0"', "4 to 640 corners"),
    "a number too few": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 1 1"', "4 to 640 corners"),
    "an infinite corner": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 inf"', "4 to 640 corners"),
    "a flat piece": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 1 1 0"', "is flat"),
    "a thin piece": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 1 1 0.000001"', "is flat"),
    "a corner twice": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 1 0 0 0"', "corners 1 and 5 of piece"),
    "a corner inside": (r'vertex="[^"]*"', 'vertex="0 0 0 1 0 0 0 1 0 0 0 1 .1 .1 .1"', "is not convex: its corner 5"),
    "a mesh of two geoms": (r'mesh="p2"', 'mesh="p1"', "the mesh 'p1', which <asset> has not, or another geom has"),
    "a mesh of no geom": (r'<geom name="p2"[^>]*>', "", "no geom has the mesh 'p2'"),
    "a file": (r'<mesh name="p1"', '<mesh file="p1.stl" name="p1"', "has file=, which only a picture has"),
    "a file elsewhere": (r'<mesh name="p1"', '<mesh file="../p1.stl" name="p1"', "in the folder of the part"),
    "a piece that does not collide": (r'mesh="p2"', 'mesh="p2" contype="0"', "'p2' is a picture if it has"),
    "a wide cylinder": (r'size="0.004 ', 'size="0.4 ', "has a radius of 0.4 m; 0.1 is the most"),
    "a turned mesh": (r'mesh="p2"', 'mesh="p2" zaxis="1 0 0"', "has zaxis=, which a mesh has not"),
    "a mesh somewhere": (r'mesh="p2"', 'mesh="p2" pos="1 0 0"', "has pos=, which a mesh has not"),
    "a cylinder of three sizes": (r'size="0.004 0.0055"', 'size="0.004 0.0055 0.1"', "has 3 numbers in size="),
    "a cylinder of no size": (r'size="0.004 0.0055"', "", "has no size="),
    "a cylinder that is no more": (r'size="0.004 0.0055"', 'size="0.004 0"', "2 to 3 numbers"),
    "a cylinder along nothing": (r'zaxis="0 0 1"', 'zaxis="0 0 0"', "has a zaxis= of no length"),
    "a density of its own": (r'mesh="p2"', 'mesh="p2" density="1"', "has density=; where pieces are not boxes"),
    "friction of its own": (r'type="mesh"', 'type="mesh" friction="1"', "has friction=; where pieces are not boxes"),
    "a site": (r"</body>", '<site name="s" pos="0 0 0"/></body>', "site 's' is given"),
    "a piece far away": (
        r'type="cylinder" pos="[0-9.]* ',
        'type="cylinder" pos="0.5 ',
        "separate solids",
    ),
}


@pytest.mark.parametrize("case", PIECES)
def test_pieces_must_be_convex_and_one(case: str, part: Path) -> None:
    old, new, words = PIECES[case]
    text, count = re.subn(old, new, part.read_text(encoding="utf-8"), count=1)
    assert count == 1
    part.write_text(text, encoding="utf-8")
    assert words in refusal(part)


def test_the_file_beside_it_must_be_there(part: Path) -> None:
    part.with_suffix(".toml").unlink()
    assert "thing.toml: the file that states the faces of a part" in refusal(part)


def test_beside_boxes_alone_any_file_may_lie(tmp_path: Path) -> None:
    path = write_part("step", extrude(rectangle(40, 40), 0, 10, top="top"), tmp_path, source="a test", licence="none")
    assert not path.with_suffix(".toml").exists()
    path.with_suffix(".toml").write_text("a scenario, perhaps", encoding="utf-8")
    assert "top" in load_part(path).faces


def stl(triangles: np.ndarray) -> bytes:
    """A binary STL file."""
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    rows = np.zeros(len(triangles), dtype=row)
    rows["corners"] = triangles
    return bytes(80) + len(triangles).to_bytes(4, "little") + rows.tobytes()


TETRAHEDRON = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
TRIANGLES = TETRAHEDRON[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
PICTURE = '<geom name="looks" type="mesh" mesh="looks" contype="0" conaffinity="0" group="1"/>'


def with_picture(part: Path, geom: str, file: str = "looks.stl") -> None:
    text = part.read_text(encoding="utf-8")
    text = text.replace("</asset>", f'<mesh name="looks" file="{file}"/></asset>').replace("</body>", geom + "</body>")
    part.write_text(text, encoding="utf-8")


def test_a_picture_is_shown_and_never_collides(part: Path) -> None:
    import mujoco

    pieces = load_part(part).pieces
    with_picture(part, PICTURE)
    (part.parent / "looks.stl").write_bytes(stl(TRIANGLES))
    assert [piece.name for piece in load_part(part).pieces] == [piece.name for piece in pieces]
    file = read_part(part)
    assert "file=" not in file.xml
    model = mujoco.MjModel.from_xml_string(file.xml)
    looks = model.geom("looks")
    assert (looks.contype[0], looks.conaffinity[0], looks.group[0]) == (0, 0, 1)
    assert {int(model.geom(piece.name).group[0]) for piece in pieces} == {3}
    assert model.body("thing").mass[0] == pytest.approx(2700.0 * load_part(part).volume, rel=2e-3)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (None, "No such file"),
        (b"", "no binary STL file"),
        (b"solid looks\nendsolid looks\n" + bytes(200), "no binary STL file"),
        (stl(TRIANGLES)[:-1], "no binary STL file"),
        (stl(np.full((2, 3, 3), np.nan)), "corners within 10 m"),
        (stl(1e5 * TRIANGLES), "corners within 10 m"),
        (stl(TRIANGLES[:1]), "lie in a plane"),
        (stl(np.repeat(TRIANGLES, 6000, axis=0)), "larger than 1.0"),
    ],
)
def test_a_picture_that_is_none_is_refused(raw: bytes | None, words: str, part: Path) -> None:
    with_picture(part, PICTURE)
    if raw is not None:
        (part.parent / "looks.stl").write_bytes(raw)
    with pytest.raises(InputError, match=words):
        load_part(part)


@pytest.mark.parametrize(
    ("geom", "words"),
    [
        (PICTURE.replace('contype="0" ', ""), "is a picture if it has"),
        (PICTURE.replace('mesh="looks"', 'mesh="p1"'), "is a picture if it has"),
        (PICTURE + PICTURE.replace('"looks"', '"again"', 1), "is a second picture"),
        (PICTURE.replace('name="looks"', 'name="p1"'), "two geoms are called 'p1'"),
        (PICTURE.replace(' contype="0" conaffinity="0" group="1"', ""), "only a picture has"),
    ],
)
def test_what_only_looks_like_a_picture_is_refused(geom: str, words: str, part: Path) -> None:
    with_picture(part, geom)
    (part.parent / "looks.stl").write_bytes(stl(TRIANGLES))
    assert words in refusal(part)


def test_pieces_of_many_sides_are_refused(part: Path) -> None:
    rng = np.random.default_rng(0)
    ball = rng.normal(size=(600, 3))
    ball *= 0.004 / np.linalg.norm(ball, axis=1)[:, None]
    text = part.read_text(encoding="utf-8")
    corners = " ".join(f"{x:.9f}" for x in ball.ravel())
    part.write_text(re.sub(r'vertex="[^"]*"', f'vertex="{corners}"', text, count=1), encoding="utf-8")
    assert "330 and 200 are the most" in refusal(part)


def test_a_fit_hole_whose_pieces_touch_it_in_corners_is_refused(tmp_path: Path) -> None:
    """Triangles that fan out from corners of the wall have no side on it; where they are hardly anything of the part,
    they recede to nothing, and the hole gets wider all around."""
    hole = circle(5, name="bore", sides=64)
    body = extrude(rectangle(12, 12), 0, 10, holes=[hole])
    marked = replace(body, rounds=tuple(replace(wall, fit=True) for wall in body.rounds))
    assert load_part(write_part("free", body, tmp_path, source="a test", licence="none")).rounds["bore"].hole
    assert "touch it in a corner only" in refusal(write_part("fan", marked, tmp_path, source="a test", licence="none"))
    large = extrude(rectangle(60, 40), 0, 10, holes=[hole])
    fitting = replace(large, rounds=tuple(replace(wall, fit=True) for wall in large.rounds))
    solid = load_part(write_part("wide", fitting, tmp_path, source="a test", licence="none"))
    assert len(physical_pieces(solid, 2.5e-4)) < len(solid.pieces)
    banded = extrude(rectangle(60, 40), 0, 10, holes=[circle(5, name="bore", sides=64, fit=True)])
    assert load_part(write_part("band", banded, tmp_path, source="a test", licence="none")).fits


@pytest.mark.parametrize("name", part_names())
def test_parts_of_the_package_are_as_they_say(name: str) -> None:
    """They are not held against their pieces each time that they are loaded."""
    check_part(read_part(part_path(name)), load_part(name))


def test_a_part_file_is_read_once_until_it_or_the_file_beside_it_changes(tmp_path: Path) -> None:
    for suffix in (".xml", ".toml"):
        shutil.copy(part_path("peg").with_suffix(suffix), tmp_path / f"mine{suffix}")
    mine = tmp_path / "mine.xml"
    first = read_part(mine)
    assert read_part(mine) is first
    beside = mine.with_suffix(".toml")
    beside.write_text(beside.read_text().replace("density = ", "density = 1"))
    assert read_part(mine).density > first.density
    mine.write_text("<mujoco/>")
    with pytest.raises(InputError):
        read_part(mine)


def test_where_a_face_points_is_taken_across_its_axis() -> None:
    """A middle that is stated half a thousandth off is brought across the axis, not further off."""
    axis = np.array([0.0, 0.0, 1.0])
    toward = _beside(JsonNode([1.0, 0.0, 5e-4], "part.toml"), axis)
    assert toward == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    with pytest.raises(InputError, match="a direction across the axis is needed"):
        _beside(JsonNode([1.0, 0.0, 2e-3], "part.toml"), axis)
