"""Read the model file of an arm or gripper, MJCF or URDF, without elements that the scene provides."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from apo_bench.errors import InputError, one_line, require

_LONGEST = 200  # characters of MuJoCo's reason in an error message
_NAMED = ("bodies", "joints", "geoms", "sites", "actuators")
_OF_THE_SCENE = ("sensors", "keys", "cameras", "lights", "textures", "pairs", "skins", "texts", "numerics", "tuples")
"""Elements that the scene provides or does not need."""


def load_model(path: Path, kind: str) -> Any:
    """Read a model file as `MjSpec`, without sensors, key frames, cameras, lights and pictures.

    Every body, joint, geom, site and actuator has a name in it. Meshes that touch nothing are left out, since they
    would be compiled with every scene. Options of the simulation are MuJoCo's defaults: the scene states them.

    Args:
        path: An MJCF or URDF file.
        kind: What the file should be, for the message: `arm`, `gripper`.

    Raises:
        InputError: There is no such file, MuJoCo cannot read it, or a mesh is missing.
    """
    require(path.is_file(), f"{path}: the model file of the {kind} is missing; check the path.")
    try:
        spec = _read(path)
    except (ValueError, RuntimeError, mujoco.FatalError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: MuJoCo cannot read this model file of the {kind}: {_reason(error)}.") from error
    spec.compiler.fusestatic = False  # else a URDF arm loses the base of its gripper
    for plural in _OF_THE_SCENE:
        for each in list(getattr(spec, plural)):
            spec.delete(each)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH and not geom.contype and not geom.conaffinity:
            spec.delete(geom)
    _keep_meshes(spec, path, kind)
    plain = mujoco.MjSpec()
    spec.option = plain.option
    spec.stat = plain.stat
    spec.visual = plain.visual
    for plural in _NAMED:
        for i, each in enumerate(getattr(spec, plural)):
            if not each.name:
                each.name = f"{'body' if plural == 'bodies' else plural[:-1]}_{i}"  # such as `joint_3`
    return spec


def compile_model(spec: Any, path: Path) -> Any:
    """Compile a model that was read.

    Raises:
        InputError: MuJoCo cannot compile it, or a pose or a range in it is not finite.
    """
    try:
        model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(f"{path}: MuJoCo cannot compile this: {_reason(error)}; correct the file.") from error
    numbers = (model.body_pos, model.body_quat, model.site_pos, model.site_quat, model.jnt_axis, model.jnt_range)
    require(
        all(np.isfinite(each).all() for each in numbers),
        f"{path}: a position, a direction or a range is not a finite number; correct the file.",
    )
    return model


def _read(path: Path) -> Any:
    """Read a model file; faults of robosuite's grippers that MuJoCo refuses are removed.

    They are repeated meshes, of which robosuite uses the first, and the group of a default class, which has no effect.
    """
    try:
        return mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        if not any(words in str(error) for words in ("repeated name", "unrecognized attribute: 'group'")):
            raise
    root = ElementTree.parse(path).getroot()
    for default in root.iter("default"):
        default.attrib.pop("group", None)
    for assets in root.iter("asset"):
        names: set[str] = set()
        for mesh in assets.findall("mesh"):
            name = mesh.get("name") or Path(mesh.get("file", "")).stem
            if name in names:
                assets.remove(mesh)
            names.add(name)
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.modelfiledir = str(path.parent)
    return spec


def _mesh_file(spec: Any, mesh: Any) -> Path:
    """The absolute path of a mesh file."""
    stated = Path(mesh.file)
    return (Path(spec.modelfiledir) / spec.meshdir / stated).absolute()


def _keep_meshes(spec: Any, path: Path, kind: str) -> None:
    """Keep only meshes of colliding geoms, each with an absolute path."""
    used = {geom.meshname for geom in spec.geoms if geom.meshname}
    for mesh in list(spec.meshes):
        if mesh.name not in used:
            spec.delete(mesh)
        elif mesh.file:
            file = _mesh_file(spec, mesh)
            require(
                file.is_file(),
                f"{path}: the mesh file {one_line(str(file), _LONGEST)} of the {kind} is missing; bring it there.",
            )
            mesh.file = str(file)
    spec.meshdir = ""


def _reason(error: Exception) -> str:
    """The message of MuJoCo in one line."""
    return one_line(" ".join(str(error).split()).rstrip("."), _LONGEST)
