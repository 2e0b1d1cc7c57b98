"""Part files: shapes against numbers written by hand, unions against counted cells, broken files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import InputError
from apo_bench.geometry import Box, Face, face_area
from apo_bench.parts import load_part, part_names, part_path
from apo_bench.parts.faces import SIDES, unite

SIX = ("px", "nx", "py", "ny", "pz", "nz")
POCKETS = tuple(f"{pocket}_{wall}" for pocket in "AB" for wall in ("px", "nx", "py", "ny"))

NAMED = {
    "block": SIX,
    "bridge": SIX,
    "stick": SIX,
    "cube": (*SIX, "hpy", "hny", "hpz", "hnz"),
    "castle": ("px", "nx", "py", "ny", "bottom", "topP", "topN", "sfl", "spy", "sny"),
    "table": ("top",),
    "table_pockets": ("top", "A_fl", "B_fl", *POCKETS),
}
VOLUME_MM3 = {
    "block": 50**3,
    "bridge": 100 * 50 * 20,
    "stick": 220 * 20 * 20,
    "cube": 50**3 - 50 * 20 * 20,
    "castle": 60 * 60 * 40 - 60 * 20 * 10,
    "table": 1400 * 1200 * 20,
    "table_pockets": 1400 * 1200 * 20 - 2 * 50 * 50 * 6,
}
CASTLE = {  # normal, its coordinate [mm], corners, area [mm^2]
    "px": ((1, 0, 0), 30, 8, 60 * 40 - 200),
    "nx": ((-1, 0, 0), 30, 8, 60 * 40 - 200),
    "py": ((0, 1, 0), 30, 4, 60 * 40),
    "ny": ((0, -1, 0), 30, 4, 60 * 40),
    "bottom": ((0, 0, -1), 0, 4, 60 * 60),
    "topP": ((0, 0, 1), 40, 4, 60 * 20),
    "topN": ((0, 0, 1), 40, 4, 60 * 20),
    "sfl": ((0, 0, 1), 30, 4, 60 * 20),
    "spy": ((0, -1, 0), -10, 4, 60 * 10),
    "sny": ((0, 1, 0), -10, 4, 60 * 10),
}


def test_the_package_has_the_parts_of_the_toy_world_and_those_that_a_script_makes():
    made = {name for name in part_names() if part_path(name).with_suffix(".toml").exists()}
    assert set(part_names()) - made == set(NAMED)


@pytest.mark.parametrize("name", sorted(NAMED))
def test_names_volume_and_exact_coordinates(name: str):
    solid = load_part(name)
    assert {face for face in solid.faces if not face.startswith("auto_")} == set(NAMED[name])
    assert solid.volume == pytest.approx(1e-9 * VOLUME_MM3[name], rel=1e-12)
    for face in solid.faces.values():
        corners = np.concatenate([face.outline, *face.holes]) * 1e3
        assert np.abs(corners - corners.round()).max() < 1e-6, "every corner of these parts lies on whole millimetres"


@pytest.mark.parametrize("name", sorted(NAMED))
def test_the_faces_close_the_solid(name: str):
    """Areas along opposite directions are equal, and the divergence theorem gives the volume."""
    faces = load_part(name).faces.values()
    assert np.abs(sum(face_area(f) * f.normal for f in faces)).max() < 1e-12
    flux = sum(face_area(f) * f.normal @ f.outline[0] for f in faces)
    assert flux / 3 == pytest.approx(1e-9 * VOLUME_MM3[name], rel=1e-9)


@pytest.mark.parametrize("name", sorted(CASTLE))
def test_the_faces_of_the_castle(name: str):
    normal, distance, corners, square_mm = CASTLE[name]
    face = load_part("castle").faces[name]
    assert face.plane == pytest.approx((*normal, -1e-3 * distance), abs=1e-12)
    assert len(face.outline) == corners
    assert face_area(face) == pytest.approx(1e-6 * square_mm)
    assert not face.fit


def test_the_hole_of_the_cube_goes_through_two_faces():
    faces = load_part("cube").faces
    assert [len(faces[name].holes) for name in ("px", "nx", "py", "hpy")] == [1, 1, 0, 0]
    assert faces["hpz"].plane == pytest.approx((0, 0, -1, 0.01))
    hole = Face("hole", faces["px"].holes[0])
    assert hole.normal == pytest.approx((-1, 0, 0)), "holes run clockwise seen from outside"


def test_which_faces_are_the_fit():
    fit = {name: {f.name for f in load_part(name).faces.values() if f.fit} for name in NAMED}
    assert fit == {name: set() for name in NAMED} | {"stick": {"py", "ny", "pz", "nz"}, "table_pockets": set(POCKETS)}


def test_centroids_in_the_part_frame():
    assert load_part("castle").centroid == pytest.approx((0, 0, (144 * 20 - 12 * 35) / 132 * 1e-3), abs=1e-12)
    assert load_part("cube").centroid == pytest.approx((0, 0, 0), abs=1e-12)


def test_faces_without_a_site_are_named_by_direction_and_place():
    first, second = (list(load_part("table").faces) for _ in range(2))
    assert first == second
    assert first == ["top", "auto_px_1", "auto_nx_1", "auto_py_1", "auto_ny_1", "auto_nz_1"]


cells = st.lists(st.tuples(*[st.integers(0, 3)] * 3, *[st.integers(1, 3)] * 3), min_size=1, max_size=5)


@given(cells)
@settings(max_examples=40, deadline=None)
def test_a_union_is_what_counted_cells_say(spans: list[tuple[int, ...]]):
    """An independent count on a grid of unit cells: volume, centroid, and the area that looks along each direction."""
    full = np.zeros((8, 8, 8), bool)
    boxes = []
    for k, (x, y, z, dx, dy, dz) in enumerate(spans):
        full[x + 1 : x + dx + 1, y + 1 : y + dy + 1, z + 1 : z + dz + 1] = True
        low = 0.01 * np.array([x, y, z])
        size = 0.01 * np.array([dx, dy, dz])
        boxes.append(Box(f"b{k}", low + size / 2, size / 2))
    union = unite(boxes)
    assert union.volume == pytest.approx(1e-6 * full.sum(), rel=1e-9)
    assert union.centroid == pytest.approx(0.01 * (np.argwhere(full).mean(axis=0) - 0.5), abs=1e-9)
    for side in range(len(SIDES)):
        axis = side // 2
        step = 1 - 2 * (side % 2)
        bare = full & ~np.roll(full, -step, axis=axis)
        areas = sum(surface.shape.area for surface in union.surfaces if surface.side == side)
        assert areas == pytest.approx(1e-4 * bare.sum(), abs=1e-10)
        heights = {round(s.height * 100) for s in union.surfaces if s.side == side}
        assert heights == {i - (step < 0) for i in np.argwhere(bare)[:, axis]}


@pytest.mark.parametrize("name", sorted(NAMED))
def test_a_mesh_union_has_the_same_volume_and_surface(name: str):
    import trimesh

    solid = load_part(name)
    boxes = [trimesh.creation.box(bounds=(b.center - b.half, b.center + b.half)) for b in solid.pieces]
    mesh = trimesh.boolean.union(boxes, engine="manifold") if len(boxes) > 1 else boxes[0]
    assert mesh.volume == pytest.approx(solid.volume, rel=1e-6)
    assert mesh.center_mass == pytest.approx(solid.centroid, abs=1e-7)
    assert mesh.area == pytest.approx(sum(face_area(face) for face in solid.faces.values()), rel=1e-6)


GOOD = """<mujoco model="thing">
  <default>
    <geom type="box"/>
    <default class="fit"><site size="0.002"/></default>
  </default>
  <worldbody>
    <body name="thing">
      <geom name="low" pos="0 0 0.01" size="0.02 0.02 0.01"/>
      <geom name="high" pos="0 0 0.03" size="0.01 0.02 0.01"/>
      <site name="foot" pos="0 0 0"/>
      <site name="side" class="fit" pos="0.02 0 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""
FIT = '<default class="fit"><site size="0.002"/></default>'
HIGH = '<geom name="high" pos="0 0 0.03" size="0.01 0.02 0.01"/>'
FOOT = '<site name="foot" pos="0 0 0"/>'

BROKEN = {
    "no_xml": (GOOD, "castle!", "not well-formed XML"),
    "cut_off": ("</worldbody>", "", "not well-formed XML"),
    "not_mjcf": (GOOD, "<robot/>", "begins with <mujoco>"),
    "no_body": (GOOD, "<mujoco><worldbody/></mujoco>", "no body"),
    "no_boxes": (GOOD, '<mujoco><worldbody><body name="b"/></worldbody></mujoco>', "no geom"),
    "two_bodies": ("</worldbody>", '<body name="other"/></worldbody>', "more than 1 <body>"),
    "geom_outside": ("</worldbody>", '<geom name="g" size="1 1 1"/></worldbody>', "<geom> stands in <worldbody>"),
    "joint": (FOOT, "<freejoint/>", "allowed are <geom>, <site>; the scene adds joints"),
    "body_moved": ('<body name="thing">', '<body name="thing" pos="0 0 1">', "has pos=, which a part may not say"),
    "include": ("<worldbody>", '<include file="x.xml"/><worldbody>', "<include>"),
    "sphere": (HIGH, '<geom name="high" type="sphere" size="0.01"/>', 'has type="sphere"'),
    "sphere_by_class": (FIT, FIT + '<default class="round"><geom type="sphere"/></default>', 'has type="sphere"'),
    "sphere_by_nothing": ('<geom type="box"/>', "", "'low' has no type="),
    "no_size": ('size="0.01 0.02 0.01"', "", "'high' has no size="),
    "class_twice": (FIT, FIT + FIT, "two <default> have class 'fit'"),
    "class_without_name": (FIT, "<default/>", "a nested <default> has no class="),
    "two_densities": ('size="0.01 0.02 0.01"', 'size="0.01 0.02 0.01" density="600"', "densities from 600 to 1000"),
    "too_light": ('<geom type="box"/>', '<geom type="box" density="1"/>', "weighs 4.8e-05 kg"),
    "too_heavy": (HIGH, '<geom name="high" pos="0 0 9.02" size="9 9 9"/>', "weighs 5.83e+06 kg"),
    "unknown_class": (HIGH, '<geom name="high" class="cube" size="1 1 1"/>', "class 'cube'"),
    "turned": ('name="high"', 'name="high" euler="0 0 45"', "has euler="),
    "unnamed": ('name="high" ', "", "has no name"),
    "dotted_name": ('name="high"', 'name="a.b"', "'a.b'"),
    "same_name": ('name="high"', 'name="low"', "two geoms are called 'low'"),
    "flat": ('size="0.01 0.02 0.01"', 'size="0.01 0 0.01"', "2 to 3 numbers of 0.0005 to 10 m"),
    "negative": ('size="0.01 0.02 0.01"', 'size="0.01 -0.02 0.01"', "2 to 3 numbers of 0.0005"),
    "nan": ('size="0.01 0.02 0.01"', 'size="0.01 nan 0.01"', "2 to 3 numbers of 0.0005 to 10 m"),
    "infinite": ('pos="0 0 0.03"', 'pos="0 0 inf"', "3 numbers of -10 to 10 m"),
    "word": ('pos="0 0 0.03"', 'pos="0 0 up"', "3 numbers of -10 to 10 m"),
    "two_numbers": ('size="0.01 0.02 0.01"', 'size="0.01 0.02"', "'high' has 2 numbers in size="),
    "two_names": (FOOT, FOOT + '<site name="sole" pos="0.01 0 0"/>', "'foot' and 'sole' lie on one face"),
    "in_the_air": (FOOT, '<site name="foot" pos="0 0 -0.01"/>', "'foot' at (0, 0, -10) mm lies on no face"),
    "inside": (FOOT, '<site name="foot" pos="0 0 0.01"/>', "lies on no face"),
    "on_an_edge": (FOOT, '<site name="foot" pos="0.02 0 0"/>', "lies on an edge"),
    "kept_name": ('name="foot"', 'name="auto_foot"', "auto_"),
    "two_pieces": ('pos="0 0 0.03"', 'pos="0 0 0.3"', "2 separate solids"),
}


@pytest.mark.parametrize("fault", sorted(BROKEN))
def test_a_broken_part_file_is_refused_in_one_sentence(fault: str, tmp_path: Path):
    old, new, words = BROKEN[fault]
    assert GOOD.count(old) == 1
    path = tmp_path / "thing.xml"
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError) as error:
        load_part(path)
    message = str(error.value)
    assert words in message
    assert message.startswith(str(path))
    assert message.endswith(".")
    assert "\n" not in message


def test_the_unbroken_file_loads(tmp_path: Path):
    path = tmp_path / "thing.xml"
    path.write_text(GOOD)
    solid = load_part(str(path))
    assert solid.name == "thing"
    assert solid.faces["side"].fit
    assert len(solid.faces) == 10


def test_missing_files_and_folders(tmp_path: Path):
    for name, words in (
        (tmp_path, "a folder was given"),
        (tmp_path / "none.xml", "No such file"),
        ("castel", "did you mean 'castle'"),
    ):
        with pytest.raises(InputError, match=words):
            load_part(name)
    binary = tmp_path / "binary.xml"
    binary.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not UTF-8 text"):
        load_part(binary)


def test_reading_parts_needs_no_simulator():
    code = (
        "import sys\n"
        "for name in ('mujoco', 'dm_control', 'mink'): sys.modules[name] = None\n"
        "from apo_bench.parts import load_part\n"
        "print(len(load_part('castle').faces))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("10\n", "")


@pytest.mark.parametrize("name", sorted(NAMED))
def test_the_simulator_reads_the_same_boxes(name: str):
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(part_path(name)))
    for box in load_part(name).pieces:
        geom = model.geom(box.name)
        assert geom.type == mujoco.mjtGeom.mjGEOM_BOX
        assert geom.pos == pytest.approx(box.center)
        assert geom.size == pytest.approx(box.half)
        assert geom.friction == pytest.approx((0.8, 0.005, 0.0001))
    assert {model.site(i).name for i in range(model.nsite)} == set(NAMED[name])


def test_several_copies_fit_into_one_scene():
    import mujoco

    room = mujoco.MjSpec()
    for name in ("castle1", "castle2", "stick", "table_pockets"):
        part = mujoco.MjSpec.from_file(str(part_path(name.rstrip("12"))))
        room.attach(part, frame=room.worldbody.add_frame(), prefix=f"{name}/")
    model = room.compile()
    masses = [model.body(f"{name}/{name.rstrip('12')}").mass[0] for name in ("castle1", "castle2", "stick")]
    assert masses == pytest.approx([0.0792, 0.0792, 0.0528])
