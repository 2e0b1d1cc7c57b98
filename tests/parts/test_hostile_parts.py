"""Parts that try to say more than a part may say: refused by name, in a moment; the physics is told nothing else."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import InputError, load_scenario
from apo_bench.geometry import Box
from apo_bench.parts import load_part, part_names, part_path, read_part
from apo_bench.parts.allowed import ELEMENT_RULES, LARGEST_PART_BYTES, MOST_FACES, MOST_PIECES, MOST_SITES
from apo_bench.parts.faces import unite
from apo_bench.parts.load import check_solid
from apo_bench.resources import folder

PART = """<mujoco model="thing">
  <default>
    <geom type="box" density="600" friction="0.8 0.005 0.0001" rgba="0.5 0.5 0.5 1"/>
    <site size="0.002" group="4"/>
  </default>
  <worldbody>
    <body name="thing">
      <geom name="low" pos="0 0 0.01" size="0.02 0.02 0.01"/>
      <site name="foot" pos="0 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""
GEOM = '<geom name="low" '
SITE = '<site name="foot" '
END = "</mujoco>"
ELEMENTS = {
    "gravity": ('<option gravity="0 0 -1"/>', "<option> stands in <mujoco>"),
    "time step": ('<option timestep="1e-9"/>', "<option>"),
    "flags": ('<option><flag contact="disable"/></option>', "<option>"),
    "compiler": ('<compiler angle="degree" inertiafromgeom="false"/>', "<compiler>"),
    "size": ('<size memory="1T"/>', "<size>"),
    "weld": ('<equality><weld body1="thing"/></equality>', "<equality>"),
    "actuator": ('<actuator><motor joint="x"/></actuator>', "<actuator>"),
    "plugin": ('<extension><plugin plugin="mujoco.elasticity.cable"/></extension>', "<extension>"),
    "file": ('<asset><mesh name="m" file="/etc/passwd"/></asset>', "an .stl file in the folder of the part"),
    "texture": ('<asset><texture name="t" type="2d"/></asset>', "<texture> stands in <asset>"),
    "contact": ('<contact><exclude body1="a" body2="b"/></contact>', "<contact>"),
    "include": ('<include file="/etc/passwd"/>', "write the boxes into the file itself"),
    "another world": ("<worldbody/>", "more than 1 <worldbody>"),
    "another default": ("<default/>", "more than 1 <default>"),
    "text": ("attack", "the text 'attack' stands between elements"),
    "instruction": ("<?php evil?>", "<?php?> is given"),
}
INSIDE = {
    "joint": ("<joint/>", "the scene adds joints"),
    "inertial": ('<inertial pos="0 0 1" mass="1"/>', "the density gives the inertia"),
    "body": ("<body/>", "<body> stands in <body>"),
    "camera": ("<camera/>", "<camera>"),
    "frame": ("<frame/>", "<frame>"),
    "composite": ('<composite type="grid"/>', "<composite>"),
    "plugin": ('<plugin plugin="p"/>', "<plugin>"),
}
OF_GEOM = {
    "mass": "1e300",
    "condim": "1",
    "margin": "1",
    "gap": "1",
    "priority": "9",
    "solref": "0.02 1",
    "solimp": "0 0 0",
    "solmix": "0",
    "shellinertia": "true",
    "fluidshape": "ellipsoid",
    "fluidcoef": "9 9 9 9 9",
    "material": "m",
    "hfield": "h",
    "fromto": "0 0 0 1 1 1",
    "fitscale": "9",
    "user": "1",
    "quat": "1 0 0 0",
    "euler": "0 0 0",
    "dclass": "fit",
    "xmlns": "urn:x",
    "k" * 100_000: "1",
}
VALUES = {
    "density": ("0", "-1", "1e300", "nan", "inf", "600 600", "", "1_0", "0x10", "٣", "999" * 9_999),
    "friction": ("-1", "0 0 0", "1e9", "1 1 1", "nan 0 0", "0.8 0.005 0.0001 1", "0.8, 0.005"),
    "rgba": ("0.5 0.5 0.5 0", "2 0 0 1", "0.5 0.5 0.5", "red"),
    "size": ("0.02 0.02 1e-9", "0.02 0.02 -0.01", "1e9 1 1", "0.02", "0.02 0.02 0.01 0.01"),
    "pos": ("0 0 1e9", "0 0", "0 0 0 0", "0 0 0\0", "0\u00a00 0", "0 \u30000 0"),
    "type": ("sdf", "sphere", "Box", ""),
    "name": ("a/b", "a b", "", "world!", "../a", "x" * 65, "é"),
    "class": ("/", "a/b"),
}


def refusal(text: str, tmp_path: Path) -> str:
    path = tmp_path / "thing.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        load_part(path)
    message = str(refused.value)
    assert message.startswith(str(path))
    assert message.endswith(".")
    assert len(message) < len(str(path)) + 300
    return message


@pytest.mark.parametrize("case", ELEMENTS)
def test_elements_that_a_part_may_not_have(case: str, tmp_path: Path) -> None:
    given, words = ELEMENTS[case]
    assert words in refusal(PART.replace(END, given + END), tmp_path)


@pytest.mark.parametrize("case", INSIDE)
def test_elements_that_a_body_may_not_have(case: str, tmp_path: Path) -> None:
    given, words = INSIDE[case]
    message = refusal(PART.replace("</body>", given + "</body>"), tmp_path)
    assert words in message
    assert "line 10" in message


@pytest.mark.parametrize("key", OF_GEOM)
def test_attributes_that_a_geom_may_not_have(key: str, tmp_path: Path) -> None:
    """On the geom or as a default: both are refused by name."""
    for place, called in ((GEOM, "<geom> 'low'"), ("<geom type", "<geom>")):
        message = refusal(PART.replace(place, f'{place.split()[0]} {key}="{OF_GEOM[key]}"{place[5:]}'), tmp_path)
        assert f"{called} has {key[:60]}=, which a part may not say; allowed are" in message


@pytest.mark.parametrize("key", VALUES)
def test_values_out_of_range(key: str, tmp_path: Path) -> None:
    bare = ElementTree.fromstring(PART)
    geom = bare.find("worldbody/body/geom")
    assert geom is not None
    for value in VALUES[key]:
        if "\0" in value:
            assert "not well-formed XML" in refusal(PART.replace('pos="0 0 0.01"', f'pos="{value}"'), tmp_path)
            continue
        geom.set(key, value)
        message = refusal(ElementTree.tostring(bare, encoding="unicode"), tmp_path)
        assert f'has {key}="{value[:60]}"; ' in message
        assert "allowed" in message


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('group="4"', 'group="6"', "has group="),
        ("<site name", '<site type="box" name', "<site> 'foot' has type="),
        ('<body name="thing"', '<body name="a/b"', "<body> 'a/b' has name="),
        ('<body name="thing"', '<body name="thing" mocap="true"', "<body> 'thing' has mocap="),
        ('<body name="thing"', '<body name="thing" gravcomp="1"', "has gravcomp="),
        ('model="thing"', 'model="a/b"', "has model="),
        ("<default>", '<default class="other">', "has class="),
    ],
)
def test_everything_else_is_refused_too(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert words in refusal(PART.replace(old, new, 1), tmp_path)


BILLION = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">' for i in range(1, 9))
COSTLY = {
    "entities": (f'<!DOCTYPE m [<!ENTITY a0 "0">{BILLION}]>{PART.replace("0.01", "&a8;")}', "<!DOCTYPE>"),
    "a file": (f'<!DOCTYPE m [<!ENTITY a SYSTEM "file:///etc/passwd">]>{PART}', "<!DOCTYPE>"),
    "a document type": (f'<!DOCTYPE m SYSTEM "http://localhost/m.dtd">{PART}', "<!DOCTYPE>"),
    "defaults of attributes": (f'<!DOCTYPE m [<!ATTLIST geom mass CDATA "9">]>{PART}', "<!DOCTYPE>"),
    "an unknown entity": (PART.replace("thing", "&thing;"), "not well-formed XML"),
    "another encoding": ('<?xml version="1.0" encoding="utf-7"?>' + PART.replace("<geom", "<g\xe9om"), "<g\xe9om>"),
    "sites": (
        PART.replace("</body>", (SITE + 'pos="0 0 0"/>') * 20_000 + "</body>"),
        f"{MOST_SITES} <site>",
    ),
    "boxes": (PART.replace("</body>", (GEOM + 'size="1 1 1"/>') * 20_000 + "</body>"), f"{MOST_PIECES + 1} <geom>"),
    "nested classes": (PART.replace("</default>", '<default class="c">' * 8_000 + "</default>" * 8_001, 1), "at most"),
    "classes": (PART.replace("</default>", '<default class="c"/>' * 8_000 + "</default>", 1), "<default>"),
    "nested bodies": (PART.replace("</body>", "<body>" * 50_000 + "</body>" * 50_001), "<body> stands in <body>"),
    "unclosed": ("<mujoco>" * 100_000, "<mujoco> stands in <mujoco>"),
    "larger than a part": (PART + " " * LARGEST_PART_BYTES, "larger than 4 MB"),
    "empty": ("", "not well-formed XML"),
}


@pytest.mark.parametrize("case", COSTLY)
def test_costly_files_are_refused(case: str, tmp_path: Path) -> None:
    text, words = COSTLY[case]
    assert words in refusal(text, tmp_path)


def test_utf_16_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thing.xml"
    path.write_bytes(PART.encode("utf-16"))
    with pytest.raises(InputError, match="not UTF-8 text"):
        load_part(path)


def test_comments_a_byte_order_mark_and_other_line_ends_are_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "thing.xml"
    text = '<?xml version="1.0" encoding="utf-8"?><!-- note --><!-- <option/> -->' + PART
    path.write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert load_part(path).volume == pytest.approx(0.04 * 0.04 * 0.02)


def test_many_faces_are_refused(tmp_path: Path) -> None:
    """Three combs in each other make thousands of small faces out of a hundred boxes."""
    boxes = ""
    for axis in range(3):
        for k in range(33):
            size = ["0.05"] * 3
            at = ["0"] * 3
            size[axis] = "0.0005"
            at[axis] = f"{0.003 * (k - 16):.4f}"
            boxes += f'<geom name="b{axis}_{k}" size="{" ".join(size)}" pos="{" ".join(at)}"/>'
    body = PART.partition("<geom name")[0] + boxes + "</body></worldbody></mujoco>"
    assert f"more than {MOST_FACES} faces" in refusal(body, tmp_path)


def test_a_hundred_boxes_at_unrelated_places_are_one_solid(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    boxes = "".join(
        f'<geom name="b{k}" pos="{" ".join(map(str, at))}" size="{" ".join(map(str, half))}"/>'
        for k, (at, half) in enumerate(
            zip(rng.uniform(-0.05, 0.05, (100, 3)), rng.uniform(0.01, 0.04, (100, 3)), strict=True)
        )
    )
    path = tmp_path / "thing.xml"
    path.write_text(PART.partition("<geom name")[0] + boxes + "</body></worldbody></mujoco>")
    assert len(load_part(path).faces) > 100


spans = st.lists(st.tuples(*[st.integers(0, 3)] * 3, *[st.integers(1, 3)] * 3), min_size=1, max_size=6)


@given(spans)
@settings(max_examples=30, deadline=None)
def test_a_mesh_of_the_same_boxes_agrees(spans: list[tuple[int, ...]]) -> None:
    """Also where the surface touches itself along an edge or in a corner."""
    from apo_bench.geometry import Solid
    from apo_bench.parts.load import _face, _number

    boxes = [
        Box(f"b{k}", 0.01 * (np.array(low) + np.array(size) / 2), 0.005 * np.array(size))
        for k, (*low, sx, sy, sz) in enumerate(spans)
        for size in [(sx, sy, sz)]
    ]
    union = unite(boxes)
    faces = [_face(surface, None, _number(union.surfaces, k)) for k, surface in enumerate(union.surfaces)]
    whole = {face.name: face for face in faces}
    check_solid(Solid("thing", whole, tuple(boxes), union.centroid, union.volume), "thing")
    for wrong, words in (
        (Solid("thing", whole, tuple(boxes), union.centroid + 1e-4, union.volume), "centroid"),
        (Solid("thing", whole, tuple(boxes), union.centroid, 1.001 * union.volume), "volume of its cells"),
        (Solid("thing", dict(list(whole.items())[:-1]), tuple(boxes), union.centroid, union.volume), "faces enclose"),
    ):
        if words != "faces enclose" or abs(faces[-1].outline[0] @ faces[-1].normal) > 1e-9:
            with pytest.raises(InputError, match=words):
                check_solid(wrong, "thing")


@pytest.mark.parametrize("name", part_names())
def test_parts_of_the_package_keep_to_the_table(name: str) -> None:
    """And what a scene is told of them is all that the file says, with density and friction of the file beside it."""
    file = read_part(part_path(name))
    told = ElementTree.fromstring(file.xml)
    said = ElementTree.parse(part_path(name)).getroot()
    beside = {"density", "friction"} if part_path(name).with_suffix(".toml").exists() else set()
    own = [(e.tag, {k: v for k, v in e.attrib.items() if e.tag != "geom" or k not in beside}) for e in told.iter()]
    assert own == [(e.tag, e.attrib) for e in said.iter()]
    assert all(not (e.text or "").strip() for e in told.iter())
    assert all(key.split("/")[-1] in key for key in ELEMENT_RULES)


SCENARIO = (folder("scenarios") / "stick_in_tower.toml").read_text(encoding="utf-8")


def test_a_scene_does_not_take_a_part_that_has_changed_since(tmp_path: Path) -> None:
    from apo_bench import build_scene

    part = tmp_path / "rod.xml"
    part.write_bytes(part_path("stick").read_bytes())
    file = tmp_path / "mine.toml"
    file.write_text(SCENARIO.replace('file = "stick"', 'file = "rod.xml"'), encoding="utf-8")
    scenario = load_scenario(file)
    scene = build_scene(scenario)
    whole = part.read_text(encoding="utf-8")
    part.write_text(whole.replace("</mujoco>", '<option gravity="0 0 -1"/></mujoco>'), encoding="utf-8")
    with pytest.raises(InputError, match="<option> stands in <mujoco>"):
        build_scene(scenario)
    part.write_text(whole.replace('"bar"', '"rod"'), encoding="utf-8")
    with pytest.raises(InputError, match="load the scenario again"):
        build_scene(scenario)
    assert tuple(scene.work.model.opt.gravity) == (0.0, 0.0, -9.81)


@pytest.mark.parametrize(
    ("said", "friction"),
    [('density="2" friction="0.01"', (0.01, 0.005, 0.0001)), ('density="25000" friction="10 0.1 0"', (10.0, 0.1, 0.0))],
)
def test_what_stands_at_the_ends_of_the_ranges_is_composed(
    said: str, friction: tuple[float, ...], tmp_path: Path
) -> None:
    from apo_bench import build_scene

    part = tmp_path / "rod.xml"
    whole = part_path("stick").read_text(encoding="utf-8")
    part.write_text(whole.replace('density="600" friction="0.8 0.005 0.0001"', said), encoding="utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(SCENARIO.replace('file = "stick"', 'file = "rod.xml"'), encoding="utf-8")
    model = build_scene(load_scenario(file)).work.model
    assert model.geom("stick/bar").friction == pytest.approx(friction)
    assert model.body("stick/").subtreemass == pytest.approx(float(said.split('"')[1]) * 0.22 * 0.0195**2)


@pytest.mark.parametrize(("key", "value"), [("contype", "1"), ("conaffinity", "2"), ("group", "3"), ("group", "0")])
def test_a_geom_may_only_say_that_it_never_collides(key: str, value: str, tmp_path: Path) -> None:
    assert f"<geom> 'low' has {key}=" in refusal(PART.replace(GEOM, f'{GEOM}{key}="{value}" '), tmp_path)
    allowed = refusal(PART.replace(GEOM, f'{GEOM}contype="0" conaffinity="0" group="1" '), tmp_path)
    assert "'low' is a picture if it has" in allowed
