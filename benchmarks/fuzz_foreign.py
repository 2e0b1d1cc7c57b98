"""Valid files that other programs write: CAD, logs of trackers, frames, arms; and what a cache keeps."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cli import app as cli
from apo_bench.files.json_forms import observation_form
from apo_bench.files.observation import as_planned
from apo_bench.parts import load_part
from apo_bench.parts.making import bore, extrude, rectangle, shaft, write_part
from apo_bench.recording.columns import Conventions
from apo_bench.recording.formats import read_log
from apo_bench.resources import folder
from apo_bench.scenario.file import load_scenario
from benchmarks.fuzz_kind import Kind
from benchmarks.fuzz_mutate import Chance, by_json
from benchmarks.recording_forms import FORMS, Tracked, camera_text, known_text

ROOT = Path(__file__).parents[1]
SCENARIO = "stick_in_tower"
_LOGS = ("csv-wxyz", "bop", "tum", "ros-csv", "ros-json", "ros-tf")
_REPLAY = ("replay", "block_on_block", "--fidelity", "contact", "--method", "oracle", "--json", "--cache", "kept")
_ROBOT = b"""schema = "apo-bench/robot/1"
quaternion = "wxyz"
base = { at_mm = [-420, 0, 0], turn_deg = [0, 0, 0] }
flange_to_tip = { at_mm = [0, 0, 150], turn_deg = [0, 0, 45] }
"""
_OBJECTS = """schema = "apo-bench/objects/1"

[objects]
castle1 = {{ id = "{of}11" }}
castle2 = {{ id = "{of}12" }}
stick = {{ id = "{of}13", frame = {{ at_mm = [0, 0, -10], turn_deg = [0, 0, 90] }} }}
"""
_POSES = b"""[[pose]]
part = "plate"
at_mm = [0, 0, 0]

[[pose]]
part = "pin"
name = "pin_1"
at_mm = [-25, 0, 0]
quaternion_wxyz = [0.6, 0, 0, 0.8]
color = [0.5, 0.5, 1]

[[pose]]
part = "pin"
name = "pin_2"
at_mm = [25, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
"""


def foreign_kinds(work: Path) -> Mapping[str, Kind]:
    """Every kind; made with the code that is tested, in a folder."""
    return {**_cad(), "poses": _poses(work), **_recordings(work), "robot frames": _frames(), **_arms(), **_cache(work)}


def _cad() -> dict[str, Kind]:
    """A block with a hole, by itself, and beside a second one."""
    from manifold3d import Manifold

    holed = Manifold.cube((40, 30, 10), True) - Manifold.cylinder(20, 4, 4, 24, True)
    raw = holed.to_mesh()
    corners = np.asarray(raw.vert_properties)[:, :3]
    triangles = np.asarray(raw.tri_verts)
    row = np.zeros(len(triangles), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("x", "<u2")])
    row["c"] = corners[triangles]
    binary = bytes(80) + len(row).to_bytes(4, "little") + row.tobytes()
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t) + "endloop\nendfacet\n"
        for t in corners[triangles]
    )
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    imports = [["part", "import", "{}", "--out", "parts"], ["part", "import", "{}", "--unit", "in", "--out", "parts"]]
    draft = ["scenario", "new", "--assembly", "{}", "--out", "new.toml"]
    kept = ("parts/*", "new.toml", "new_parts/*", "new/*")
    found = {}
    for kind, name, text, commands in (
        ("STL", "a.stl", binary, imports),
        ("STL, text", "b.stl", f"solid a\n{facets}endsolid a\n".encode(), imports),
        ("OBJ", "a.obj", ("o lid\n" + "\n".join(lines) + "\n").encode(), imports),
        ("3MF", "a.3mf", _three_mf(corners, triangles), [imports[0], draft]),
    ):
        said = [[word.format(name) for word in command] for command in commands]
        found[kind] = Kind({name: text}, [name], said, 8, kept, longest_s=20, largest_mb=2000)
    return found


def _three_mf(corners: Any, triangles: Any) -> bytes:
    points = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in corners)
    index = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    model = (
        '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1" name="lid"><mesh><vertices>{points}</vertices><triangles>{index}</triangles></mesh></object>'
        '<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 10"/></components>'
        "</object>"
        '</resources><build><item objectid="1"/><item objectid="2"/></build></model>'
    )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("3D/3dmodel.model", model)
    return out.getvalue()


def _poses(work: Path) -> Kind:
    """A plate with two holes and a pin in each."""
    bores = [bore((x, 0), 4.2, 0, 15, f"bore_{i}") for i, x in enumerate((-25, 25), start=1)]
    plate = extrude(rectangle(80, 50), 0, 15, bores=bores, bottom="bottom", top="top")
    place = work / "posed"
    place.mkdir()
    for name, body in (("plate", plate), ("pin", shaft(4, 0, 40, "side", bottom="tip", top="head"))):
        load_part(write_part(name, body, place, density=700, source="a script", licence="CC0-1.0"))
    files = {path.name: path.read_bytes() for path in sorted(place.iterdir())}
    return Kind(
        {"p.toml": _POSES, **files},
        ["p.toml", "p.toml", "plate.toml", "pin.xml"],
        (["scenario", "new", "--poses", "p.toml", "--out", "new.toml"],),
        8,
        ("new.toml", "new_parts/*"),
        longest_s=20,
    )


def _recordings(work: Path) -> dict[str, Kind]:
    """The log of the guide in every format, with its camera and objects files."""
    starts = load_scenario(SCENARIO).start
    known = known_text({part: starts[part] for part in ("castle1", "castle2", "stick")})
    log = read_log(ROOT / "docs" / "recording.csv", "csv", Conventions())
    found = {}
    for name in _LOGS:
        form = FORMS[name]
        place = work / name
        place.mkdir()
        tracks = {id: Tracked(id, np.eye(4), track.t + 100.0, track.T) for id, track in log.tracks.items()}
        form.write(tracks, place / form.file)
        logs = {path.relative_to(place).as_posix(): path.read_bytes() for path in place.rglob("*") if path.is_file()}
        of = "tracker/" if name == "ros-json" else ""
        camera = camera_text(form.log, known, None).encode()
        more = {"camera.toml": camera, "objects.toml": _OBJECTS.format(of=of).encode()}
        stated = ["--format", form.format, "--camera", "camera.toml"]
        full = ["recording", "import", form.file, *stated, "--objects", "objects.toml", "--out", "seen.json"]
        bare = [*full[:-1], "seen.csv"]
        found[f"recording, {name}"] = Kind(
            {**logs, **more},
            [*logs, *logs, *more] if len(logs) == 1 else [*logs, *more],
            ([*full, "--scenario", SCENARIO], bare, ["noise", "still", form.file, *stated, "--out", "still.toml"]),
            4,
            ("seen.json", "seen.csv", "still.toml"),
            longest_s=20,
        )
    return found


def _frames() -> Kind:
    """Where a robot stands, with an observation of what it is to do."""
    seen = json.dumps(observation_form(as_planned(load_scenario(SCENARIO), 1.0, 1.0), SCENARIO)).encode()
    command = ["plan", SCENARIO, "--observation", "o.json", "--robot", "plan.json", "--frames", "r.toml"]
    return Kind({"r.toml": _ROBOT, "o.json": seen}, ["r.toml"], (command,), 6, ("plan.json",))


def _arms() -> dict[str, Kind]:
    """An arm with its gripper, whole and with a file that it includes."""
    arms = folder("assets") / "arms"
    stated = (arms / "ur5e_primitive.toml").read_bytes()
    files = {"a.toml": stated, **{name: (arms / name).read_bytes() for name in _MODELS}}
    motors = files[_MODELS[0]].index(b"  <actuator>")
    parted = {
        **files,
        "motors.xml": b"<mujoco>\n" + files[_MODELS[0]][motors:],
        _MODELS[0]: files[_MODELS[0]][:motors] + b'  <include file="motors.xml"/>\n</mujoco>\n',
    }
    commands = (["arm", "check", "a.toml", "--layouts", "1"], ["plan", SCENARIO, "--arm", "a.toml"])
    return {
        "arm": Kind(files, list(files), commands, 8, (), 20, 2000),
        "arm with an include": Kind(parted, [*parted, "motors.xml"], commands, 4, (), 20, 2000, may_be_refused=True),
    }


_MODELS = ("ur5e_primitive.xml", "linkage_gripper.xml")


def _cache(work: Path) -> dict[str, Kind]:
    """A demonstration that was kept, changed as damage changes it, or with a digest that fits."""
    place = work / "kept"
    if cli.main([*_REPLAY[:-1], str(place)]):
        raise RuntimeError("a replay did not work")
    files = {f"kept/{path.name}": path.read_bytes() for path in place.iterdir()}
    return {"cache": Kind(files, list(files), (list(_REPLAY),), 2, ("kept/*",), structure=by_kept)}


def by_kept(raw: bytes, rng: Chance) -> bytes:
    """One value of a kept demonstration, with a digest that fits."""
    document = json.loads(raw)
    document["demonstration"] = json.loads(by_json(json.dumps(document["demonstration"]).encode(), rng))
    text = json.dumps(document["demonstration"])
    document["digest"] = hashlib.sha256(text.encode()).hexdigest()
    return json.dumps(document).encode()
