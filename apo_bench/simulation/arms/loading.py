"""Read the model file of an arm or gripper, MJCF or URDF, as `MjSpec`, without what a scene has itself."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from apo_bench.errors import InputError, one_line, require

_LONGEST = 200
_LARGEST_BASE_M = 0.5
_NAMED = ("bodies", "joints", "geoms", "sites", "actuators")
_OF_THE_SCENE = ("sensors", "keys", "cameras", "lights", "textures", "pairs", "skins", "texts", "numerics", "tuples")
"""A scene has these itself, or needs none of them."""
_NOT_RIGID = ("flexes", "hfields", "plugins")
"""An arm is made of rigid bodies, and runs no code."""


def load_model(path: Path, kind: str) -> Any:
    """Read a model file as `MjSpec`, without sensors, key frames, cameras, lights and pictures.

    Every body, joint, geom, site and actuator has a name in it. Meshes that touch nothing are left out, since they
    would be compiled with every scene. Options of the simulation are MuJoCo's defaults: the scene states them.

    Args:
        path: An MJCF or URDF file.
        kind: What the file should be, for the message: `arm`, `gripper`.

    Raises:
        InputError: There is no such file, MuJoCo cannot read it, it has what no arm has, or a mesh is missing.
    """
    require(path.is_file(), f"{path}: the model file of the {kind} is missing; check the path.")
    try:
        spec = _read(path)
    except (ValueError, RuntimeError, mujoco.FatalError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: MuJoCo cannot read this model file of the {kind}: {_reason(error)}.") from error
    _check_kinds(spec, path, kind)
    _check_world(spec, path, kind)
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
                each.name = f"{plural[:-1]}_{i}"
    return spec


def compiled(spec: Any, path: Path) -> Any:
    """The model of what was read.

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


def files_of(path: Path) -> tuple[Path, ...]:
    """A model file, with the files that it includes and the meshes that it names."""
    try:
        included = tuple(_included(path, path.parent, frozenset()))
        meshes = tuple(_mesh_file(spec, mesh) for spec in (_read(path),) for mesh in spec.meshes)
    except (OSError, ValueError, RuntimeError, mujoco.FatalError, ElementTree.ParseError):
        return (path,)
    return tuple(dict.fromkeys((*included, *meshes)))


def _read(path: Path) -> Any:
    """A model file as it is, or without what the grippers of robosuite have and MuJoCo refuses.

    These state some meshes twice, of which robosuite takes the first, and a group of a class, which has no effect.
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


def _included(path: Path, main: Path, outer: frozenset[Path]) -> Iterator[Path]:
    """A file and what it includes; MuJoCo looks for these in the folder of the main file."""
    yield path
    for include in ElementTree.parse(path).iter("include"):
        file = main / include.get("file", "")
        if file not in outer and file.is_file():
            yield from _included(file, main, outer | {file})


def _mesh_file(spec: Any, mesh: Any) -> Path:
    stated = Path(mesh.file)
    return (Path(spec.modelfiledir) / spec.meshdir / stated).absolute()


def _check_kinds(spec: Any, path: Path, kind: str) -> None:
    """Rigid bodies that nothing outside of the model moves."""
    for plural in _NOT_RIGID:
        require(
            not len(getattr(spec, plural)),
            f"{path}: the {kind} has {plural}; an arm has rigid bodies and actuators only, so remove them.",
        )
    for body in spec.bodies:
        require(not body.mocap, f"{path}: the body '{body.name}' of the {kind} is a mocap body; remove mocap=.")


def _check_world(spec: Any, path: Path, kind: str) -> None:
    """One thing, of hinges and slides, that nothing ties to the world."""
    for joint in spec.joints:
        require(
            joint.type in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE),
            f"{path}: the joint '{joint.name}' of the {kind} neither turns nor slides; arms have hinges, and "
            "grippers hinges and slides.",
        )
    moving = [body.name for body in spec.worldbody.bodies if body.find_all("joint")]
    require(
        len(moving) <= 1,
        f"{path}: the {kind} has {len(moving)} bodies that move on their own ({', '.join(moving[:4])}); give one.",
    )
    for equality in spec.equalities:
        holds = equality.type in (mujoco.mjtEq.mjEQ_WELD, mujoco.mjtEq.mjEQ_CONNECT)
        bodies = {equality.name1, equality.name2} if equality.objtype == mujoco.mjtObj.mjOBJ_BODY else set()
        require(
            not holds or not bodies & {"", "world"},
            f"{path}: the equality '{equality.name}' ties something to the world; remove it, the arm moves.",
        )


def check_surroundings(model: Any, path: Path) -> None:
    """Raise an `InputError` if what stands fast in the file of an arm reaches farther than a base does."""
    first = int(model.jnt_bodyid[0]) if model.njnt else 0
    at = model.body_pos[model.body_rootid[first]][:2]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for geom in range(model.ngeom):
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
        if not touches or model.body_weldid[model.geom_bodyid[geom]]:
            continue
        is_plane = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
        R = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + R @ model.geom_aabb[geom, :3]
        half = np.abs(R) @ model.geom_aabb[geom, 3:]
        reach = float(np.linalg.norm(np.abs(middle[:2] - at) + half[:2]))
        if is_plane or reach > _LARGEST_BASE_M:
            raise InputError(
                f"{path}: the geom '{model.geom(geom).name}' stands fast and reaches farther than "
                f"{_LARGEST_BASE_M:g} m from the arm; remove it, what is around the arm belongs to the scenario."
            )


def _keep_meshes(spec: Any, path: Path, kind: str) -> None:
    """Keep the meshes that something touches by, each with its absolute path."""
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
    """What MuJoCo says, in one line."""
    return one_line(" ".join(str(error).split()).rstrip("."), _LONGEST)
