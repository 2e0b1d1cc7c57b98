"""MJCF files of arms and grippers, read by MuJoCo and stripped of what a scene has of its own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco

from apo_bench.errors import InputError, one_line
from apo_bench.io.reading import opened, read_bytes

_LONGEST, _LARGEST_BYTES = 200, 50_000_000
_NAMED = ("bodies", "joints", "geoms", "sites", "actuators")
_NAMED_FILE = re.compile(r"""\bfile\s*=\s*["']([^"']+)["']""")
_NAMED_FOLDER = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")


def load_model(path: Path, kind: str) -> Any:
    """An MJCF file as `MjSpec`, without sensors, key frames, cameras, lights and pictures of its own.

    Every body, joint, geom, site and actuator has a name in it. Shapes that touch nothing are left out where they are
    meshes, which would have to be compiled with every scene.

    Args:
        kind: What the file should be, for the message: `arm`, `gripper`.

    Raises:
        InputError: There is no such file, MuJoCo cannot read it, or a file that it names is missing.
    """
    with opened(path, f"MJCF file of the {kind}"):
        pass
    spec = _parsed(path, kind)
    folder = Path(spec.modelfiledir or path.parent)
    for plural in ("sensors", "keys", "cameras", "lights", "texts", "numerics", "tuples", "pairs"):
        for each in list(getattr(spec, plural)):
            spec.delete(each)
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH and not geom.contype and not geom.conaffinity:
            spec.delete(geom)
    _keep_meshes(spec, folder, path, kind)
    for plural in _NAMED:
        for i, each in enumerate(getattr(spec, plural)):
            if not each.name:
                each.name = f"{plural[:-1]}_{i}"
    return spec


def compiled(spec: Any, path: Path) -> Any:
    """The model of what was read.

    Raises:
        InputError: MuJoCo cannot compile it.
    """
    try:
        return spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot compile this: {_said(error)}; mend the file.") from error


def files_of(path: Path) -> tuple[Path, ...]:
    """A file of an arm, and the files that it names, beside it or in a folder that it names for them."""
    try:
        text = read_bytes(path, "MJCF file", _LARGEST_BYTES).decode("utf-8", errors="replace")
    except InputError:
        return (path,)
    folders = [path.parent, *(path.parent / name for name in _NAMED_FOLDER.findall(text))]
    named = (folder / name for folder in folders for name in _NAMED_FILE.findall(text))
    return (path, *dict.fromkeys(each for each in named if each.is_file()))


def _parsed(path: Path, kind: str) -> Any:
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        if "repeated name" in str(error):
            return _without_repeats(path, kind)
        raise InputError(f"{path}: MuJoCo cannot read this MJCF file of the {kind}: {_said(error)}.") from error


def _without_repeats(path: Path, kind: str) -> Any:
    """Of assets that have one name the first, as robosuite takes them."""
    try:
        root = ElementTree.fromstring(read_bytes(path, f"MJCF file of the {kind}", _LARGEST_BYTES))
        seen: set[tuple[str, str | None]] = set()
        for assets in root.iter("asset"):
            for each in list(assets):
                key = (each.tag, each.get("name"))
                if key in seen and key[1] is not None:
                    assets.remove(each)
                seen.add(key)
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    except (ElementTree.ParseError, ValueError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot read this MJCF file of the {kind}: {_said(error)}.") from error
    spec.modelfiledir = str(path.parent)
    return spec


def _keep_meshes(spec: Any, folder: Path, path: Path, kind: str) -> None:
    """Meshes that something touches by, each by its whole path; no textures."""
    used = {geom.meshname for geom in spec.geoms if geom.meshname}
    for geom in spec.geoms:
        geom.material = ""
    for plural in ("materials", "textures", "skins"):
        for each in list(getattr(spec, plural)):
            spec.delete(each)
    meshes = folder / spec.meshdir if spec.meshdir else folder
    for mesh in list(spec.meshes):
        name = mesh.name or Path(mesh.file).stem
        if name not in used:
            spec.delete(mesh)
        elif mesh.file:
            file = meshes / mesh.file
            if not file.is_file():
                raise InputError(
                    f"{path}: the mesh file {one_line(str(file), _LONGEST)} of the {kind} is missing; bring it there."
                )
            mesh.name, mesh.file = name, str(file.resolve())
    spec.meshdir = ""


def _said(error: Exception) -> str:
    """What MuJoCo says, in one line."""
    return one_line(" ".join(str(error).split()).rstrip("."), _LONGEST)
