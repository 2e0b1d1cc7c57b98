"""Part files: shapes against numbers written by hand, unions against counted cells, broken files."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import InputError, build_scene, load_scenario
from apo_bench.geometry import Box, measure_face_area
from apo_bench.resources import folder
from apo_bench.scenario.parts import find_part_path, list_part_names, load_part
from apo_bench.scenario.parts.box_union import SIDES, unite

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


def test_the_package_has_the_parts_of_the_toy_world_and_those_that_a_script_makes():
    made = {name for name in list_part_names() if find_part_path(name).with_suffix(".toml").exists()}
    assert set(list_part_names()) - made == set(NAMED)


@pytest.mark.parametrize("name", sorted(NAMED))
def test_the_faces_close_the_solid(name: str):
    """Areas along opposite directions are equal, and the divergence theorem gives the volume."""
    faces = load_part(name).faces.values()
    assert np.abs(sum(measure_face_area(f) * f.normal for f in faces)).max() < 1e-12
    flux = sum(measure_face_area(f) * f.normal @ f.outline[0] for f in faces)
    assert flux / 3 == pytest.approx(1e-9 * VOLUME_MM3[name], rel=1e-9)


cells = st.lists(st.tuples(*[st.integers(0, 3)] * 3, *[st.integers(1, 3)] * 3), min_size=1, max_size=5)


@given(cells)
@settings(max_examples=30, deadline=None)
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
FOOT = '<site name="foot" pos="0 0 0"/>'

BROKEN = {
    "not mjcf": (GOOD, "<body/>", "MuJoCo cannot read this part file"),
    "two bodies": ("</worldbody>", '<body name="other"/></worldbody>', "one <body>"),
    "an included file": ("<worldbody>", '<include file="x.xml"/><worldbody>', "<include> is given"),
    "too light": ('<geom type="box"/>', '<geom type="box" density="1"/>', "weighs 4.8e-05 kg"),
    "two pieces": ('pos="0 0 0.03"', 'pos="0 0 0.3"', "2 separate solids"),
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


SCENARIO = (folder("scenarios") / "stick_in_tower.toml").read_text(encoding="utf-8")


def with_own_stick(tmp_path: Path, text: str) -> Path:
    """A scenario file whose stick is this part file."""
    (tmp_path / "rod.xml").write_text(text, encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(SCENARIO.replace('file = "stick"', 'file = "rod.xml"'), encoding="utf-8")
    return file


def test_only_shape_place_and_matter_of_a_part_reach_the_physics(tmp_path: Path):
    """The rest of what MuJoCo understands is the scene's business."""
    whole = find_part_path("stick").read_text(encoding="utf-8")
    more = whole.replace("<geom type", '<geom margin="1" condim="6" solmix="9" priority="7" type')
    more = more.replace("<worldbody>", '<option gravity="0 0 -1" timestep="0.5"/><worldbody>')
    models = [build_scene(load_scenario(with_own_stick(tmp_path, text))).work.model for text in (whole, more)]
    images = []
    for model in models:
        image = np.zeros(mujoco.mj_sizeModel(model), dtype=np.uint8)
        mujoco.mj_saveModel(model, None, image)
        images.append(image.tobytes())
    assert images[0] == images[1]


def test_no_file_of_somebody_else_is_read(tmp_path: Path):
    """Neither included, nor as an entity, nor as a picture outside of the folder of the part."""
    secret = tmp_path / "secret.xml"
    secret.write_text("<mujoco><default><geom density='77'/></default></mujoco>")
    path = tmp_path / "own" / "thing.xml"
    path.parent.mkdir()
    entity = f'<!DOCTYPE m [<!ENTITY a SYSTEM "file://{secret}">]>{GOOD.replace("<worldbody>", "&a;<worldbody>")}'
    looks = '<geom name="looks" type="mesh" mesh="m" contype="0" conaffinity="0"/>'
    picture = GOOD.replace("<worldbody>", '<asset><mesh name="m" file="../secret.stl"/></asset><worldbody>')
    for text in (
        GOOD.replace("<worldbody>", f'<include file="{secret}"/><worldbody>'),
        entity,
        picture.replace(FOOT, FOOT + looks),
    ):
        path.write_text(text)
        with pytest.raises(InputError):
            load_part(path)
