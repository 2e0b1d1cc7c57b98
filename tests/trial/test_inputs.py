"""The identity of a trial follows every file that it opens, and every file that MuJoCo opens for it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import apo_bench
from apo_bench.resources import folder
from apo_bench.trial.input_files import list_module_files

AUDITED = """
import json, os, sys
from dataclasses import replace
from pathlib import Path

home, package = Path(sys.argv[1]), Path(sys.argv[2])
opened = set()

def note(event, arguments):
    if event == "open" and isinstance(arguments[0], str) and not (arguments[2] or 0) & (os.O_WRONLY | os.O_RDWR):
        opened.add(os.path.realpath(arguments[0]))

import mujoco
import apo_bench.resources
apo_bench.resources.__file__ = str(home / "apo_bench" / "resources.py")  # assets and scenarios are those of the copy
from apo_bench.mjcf import part_file

add_picture = part_file.add_picture

def add_and_note(spec, body, picture):
    opened.add(os.path.realpath(picture.file))
    add_picture(spec, body, picture)

part_file.add_picture = add_and_note
from apo_bench import TrialConfig
from apo_bench.trial import input_files
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash
from apo_bench.trial.trial_stages import scene_of
from apo_bench.trial.run import run_trial

read = mujoco.MjSpec.from_file

def read_and_note(path):
    spec = read(path)
    named = [(spec.meshdir, each.file) for each in spec.meshes]
    named += [(spec.texturedir, each.file) for each in spec.textures]
    for file in (path, *(Path(path).parent / place / name for place, name in named if name)):
        opened.add(os.path.realpath(file))
    return spec

mujoco.MjSpec.from_file = staticmethod(read_and_note)
sys.addaudithook(note)
os.chdir(home)
sys.path.insert(0, str(home))
given = json.loads(sys.argv[3])
settings = TrialConfig(str(home / "scenario.toml"), **given)
content = "not read before the trial"
scene = scene_of(settings)
row = run_trial(settings, scene, content=content)
assert row["predicted_success"] is not None, row["sentence"]
of_python = tuple(map(os.path.realpath, (sys.prefix, sys.base_prefix, "/proc", "/sys", "/dev", "/etc", "/usr")))
files = sorted(
    file for file in opened
    if not file.startswith(of_python)
    and not (Path(file).is_relative_to(package) and file.endswith((".py", ".pyc", ".nbi", ".nbc")))
)

def identity():
    input_files._digest_module.cache_clear()
    return compute_config_hash(settings, compute_content_hash(scene.scenario, settings.scenario, scene.arm.files))

before = identity()
assert identity() == before
changed = {}
for file in files:
    if not Path(file).is_relative_to(home):
        changed[file] = "outside"
        continue
    name = os.path.relpath(file, home)
    if name.endswith(".pyc"):
        continue
    text = Path(file).read_bytes()
    Path(file).write_bytes(text + b" ")
    changed[name] = identity() != before
    Path(file).write_bytes(text)
assert identity() == before
print(json.dumps(changed))
"""
ARM = """
from pathlib import Path

import numpy as np

from apo_bench.simulation.arms.arm import Arm


def arm():
    return Arm(
        mjcf=Path(__file__).parents[1] / "arm.xml",
        base=(-0.42, 0.0, 0.0),
        joints=("j1", "j2", "j3", "j4", "j5", "j6"),
        tip="tip",
        fingers=("left_finger", "right_finger"),
        grip="grip",
        mount="gripper",
        home=np.array([0.0, 0.2, 0.9, 0.0, 0.47, 0.0]),
        opening_m=0.046,
    )
"""
NOISE = """
from own import shifts
def blurred(goals, rng):
    return shifts.shifted(goals, rng)
blurred.deviation_mm = 1.0
blurred.deviation_deg = 1.0
"""
SHIFTS = """
def shifted(goals, rng):
    moved = goals.copy()
    moved[:, :3, 3] += rng.normal(0.0, 1e-3, (len(goals), 3))
    return moved
"""
CONTACT_SOURCE = "def given(assembly, start, truth, rng): return assembly\n"


def write_home(home: Path) -> None:
    """A scenario of a peg with a picture, an arm that includes and names files, and modules of one's own."""
    for name in ("assets", "scenarios"):
        shutil.copytree(folder(name), home / name, ignore=shutil.ignore_patterns("*.py", "__pycache__", "tracks"))
    text = (home / "scenarios" / "peg_in_hole.toml").read_text().replace('file = "peg"', 'file = "own_peg.xml"')
    (home / "scenario.toml").write_text(text)
    shutil.copy(home / "assets" / "parts" / "peg.toml", home / "own_peg.toml")
    part = (home / "assets" / "parts" / "peg.xml").read_text()
    part = part.replace("<worldbody>", '<asset><mesh name="look" file="look.stl"/></asset><worldbody>')
    geom = '<geom name="look" type="mesh" mesh="look" contype="0" conaffinity="0" group="1"/></body>'
    (home / "own_peg.xml").write_text(part.replace("</body>", geom))
    trimesh.creation.box((0.01, 0.01, 0.07)).export(home / "look.stl")
    arm = (home / "assets" / "arms" / "six_axis.xml").read_text()
    (home / "rest.xml").write_text(
        '<mujoco><asset><mesh name="hat" file="hat.stl"/><texture name="skin" type="2d" file="skin.png"/>'
        '<material name="skin" texture="skin"/></asset></mujoco>'
    )
    meshes = home / "meshes"
    meshes.mkdir()
    trimesh.creation.box((0.01, 0.01, 0.01)).export(meshes / "hat.stl")
    import matplotlib.image

    matplotlib.image.imsave(meshes / "skin.png", np.zeros((4, 4, 3)))
    arm = arm.replace("<default>", '<include file="rest.xml"/><default>', 1)
    arm = arm.replace("<compiler ", '<compiler meshdir="meshes" texturedir="meshes" ')
    hat = '<geom name="hat" type="mesh" mesh="hat" material="skin" mass="0" contype="0" conaffinity="0"/>'
    (home / "arm.xml").write_text(arm.replace('<body name="base">', f'<body name="base">{hat}'))
    (home / "own").mkdir()
    for name, source in (("arms", ARM), ("noise", NOISE), ("shifts", SHIFTS), ("contact_source", CONTACT_SOURCE)):
        (home / "own" / f"{name}.py").write_text(source)
    (home / "own" / "__init__.py").write_text("")
    shutil.copy(home / "assets" / "noise" / "megapose-tless.toml", home / "camera.toml")


OWN = {
    *("own_peg.xml", "own_peg.toml", "look.stl", "arm.xml", "rest.xml", "meshes/hat.stl", "meshes/skin.png"),
    *("own/__init__.py", "own/arms.py", "own/noise.py", "own/shifts.py", "own/contact_source.py"),
}
SHIPPED = {"scenario.toml", "assets/room.xml", "assets/parts/bored_plate.toml"}
GIVEN = (
    (
        {"arm": "own.arms:arm", "noise": "own.noise:blurred", "contact_source": "own.contact_source:given"},
        OWN | SHIPPED,
    ),
    ({"noise": "camera.toml"}, {"camera.toml", "assets/arms/six_axis.xml", "assets/arms/six_axis.toml"} | SHIPPED),
)


@pytest.mark.parametrize(("given", "expected"), GIVEN)
def test_every_file_that_a_trial_opens_is_in_its_identity(
    given: dict[str, str], expected: set[str], tmp_path: Path
) -> None:
    home = tmp_path.resolve()
    write_home(home)
    settings = json.dumps({"seed": 5, "method": "contact-robust", "min_predicted_success": 1.0, **given})
    command = [sys.executable, "-c", AUDITED, str(home), str(Path(apo_bench.__file__).parent), settings]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    changed = json.loads(done.stdout.splitlines()[-1])
    assert expected <= set(changed)
    assert {file: found for file, found in changed.items() if found is not True} == {}


def test_a_module_counts_with_what_it_imports_from_the_same_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    sources = {
        "kit_of_tests/__init__.py": "",
        "kit_of_tests/main.py": "import numpy\nfrom . import near\ndef late():\n    import beside_of_tests\n",
        "kit_of_tests/near.py": "from kit_of_tests.far.end import x\n",
        "kit_of_tests/far/__init__.py": "",
        "kit_of_tests/far/end.py": "x = 1",
        "kit_of_tests/unused.py": "",
        "beside_of_tests.py": "import kit_of_tests.main, apo_bench, json\n",
    }
    for name, source in sources.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(source)
    found = {file.relative_to(tmp_path).as_posix() for file in list_module_files("kit_of_tests.main")}
    assert found == set(sources) - {"kit_of_tests/unused.py"}
    assert list_module_files("no_such_module_of_tests") == list_module_files("builtins") == ()
    inside = {file.parent.parts[-1] for file in list_module_files("shapely.affinity")}
    assert "shapely" in inside
    assert "numpy" not in inside
