"""Read a part file as plain data: one body of named boxes, cylinders and meshes, whose sites mark faces."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, final
from xml.etree import ElementTree

import mujoco
import numpy as np

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array
from apo_bench.io import read_text

_LARGEST_BYTES = 4_000_000  # size of a part file
_LONGEST_REASON = 200  # characters of MuJoCo's reason in an error message
_MUST_BE_EMPTY = (
    *("joints", "tendons", "actuators", "sensors", "equalities", "pairs", "excludes", "keys", "plugins"),
    *("cameras", "lights", "flexes", "skins", "hfields", "textures", "materials"),
)
"""Elements that a part file must not have: the scene adds them."""
_KINDS: Mapping[Any, Literal["box", "cylinder", "mesh"]] = {
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}


@final
@dataclass(frozen=True, eq=False)
class PartGeom:
    """A convex piece of a part as the file states it, part frame, [m]."""

    name: str
    kind: Literal["box", "cylinder", "mesh"]
    pos: Array
    """(3,)."""
    size: Array
    """(3,): half sizes of a box; radius, half length and 0 of a cylinder."""
    axis: Array
    """(3,): axis of a cylinder, not normalised."""
    corners: Array
    """(k, 3): vertices of a mesh, in double precision."""
    density: float
    """[kg/m^3]."""
    friction: tuple[float, float, float]
    """Coefficients of sliding, torsional and rolling friction."""
    rgba: tuple[float, float, float, float]


@final
@dataclass(frozen=True, eq=False)
class PartSite:
    """A point on a face, which gives the face its name."""

    name: str
    pos: Array
    """(3,), frame of the part, [m]."""
    size: Array
    """(3,), [m]."""
    group: int
    rgba: tuple[float, float, float, float]
    default: str
    """Name of the default class of the site; `main` if none is stated."""


@final
@dataclass(frozen=True, eq=False)
class PartPicture:
    """The appearance of a part: a mesh that never collides."""

    name: str
    file: Path
    rgba: tuple[float, float, float, float]


@final
@dataclass(frozen=True, eq=False)
class PartModel:
    """The content of a part file."""

    body: str
    geoms: tuple[PartGeom, ...]
    sites: tuple[PartSite, ...]
    picture: PartPicture | None


def read_part_model(path: Path) -> PartModel:
    """Read a part file.

    Raises:
        InputError: MuJoCo cannot read the file, or it has an element that parts must not have.
    """
    text = read_text(path, "part file", _LARGEST_BYTES)
    require("<include" not in text, f"{path}: <include> is given, which a part has not; write all into the file.")
    try:
        spec = mujoco.MjSpec.from_string(text)
        corners = _corners(text)
    except (ValueError, ElementTree.ParseError) as error:
        raise InputError(f"{path}: MuJoCo cannot read this part file: {_reason(error)}.") from error
    body = _only_body(spec, path)
    # Geoms that never collide are pictures, all others are pieces.
    shown = [geom for geom in body.geoms if not geom.contype and not geom.conaffinity]
    require(len(shown) <= 1, f"{path}: {len(shown)} geoms never collide; a part has one picture at most.")
    pieces = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
    for each in (*pieces, *body.sites):
        require(each.name, f"{path}: a geom or site has no name; name it, records and messages use the name.")
    meshes = [geom.meshname for geom in pieces if geom.meshname]
    unused = {mesh.name for mesh in spec.meshes} - {geom.meshname for geom in body.geoms}
    require(
        len(set(meshes)) == len(meshes) and not unused, f"{path}: each mesh belongs to one geom; remove what is left."
    )
    return PartModel(
        body=body.name,
        geoms=tuple(_geom(geom, corners, path) for geom in pieces),
        sites=tuple(_site(site) for site in body.sites),
        picture=_picture(spec, shown[0], path) if shown else None,
    )


def _corners(text: str) -> dict[str, Array]:
    """Mesh -> its vertices, (k, 3), from the text, since MuJoCo keeps them in single precision."""
    meshes = [mesh for mesh in ElementTree.fromstring(text).iter("mesh") if "vertex" in mesh.attrib]
    return {
        mesh.get("name", ""): np.array([float(x) for x in mesh.attrib["vertex"].split()]).reshape(-1, 3)
        for mesh in meshes
    }


def _only_body(spec: Any, path: Path) -> Any:
    """The single body of a part file, whose frame is the part frame."""
    for plural in _MUST_BE_EMPTY:
        require(not len(getattr(spec, plural)), f"{path}: the part has {plural}, which a part has not; remove them.")
    require(
        len(spec.bodies) == 2 and not spec.worldbody.geoms and not spec.worldbody.sites,  # the world and the part
        f"{path}: a part is one <body> in <worldbody>, with all of its geoms and sites.",
    )
    body = spec.bodies[1]
    plain = np.array_equal(body.pos, np.zeros(3)) and np.array_equal(body.quat, [1.0, 0.0, 0.0, 0.0])
    require(
        plain and not body.mocap and not body.explicitinertial and not body.gravcomp,
        f"{path}: the body has a pose, an inertia or a force; the scene places it, the density gives its mass.",
    )
    return body


def _geom(geom: Any, corners: Mapping[str, Array], path: Path) -> PartGeom:
    """Convert a geom of a part file to a `PartGeom`, which has no rotation apart from the axis of a cylinder."""
    kind = _KINDS.get(geom.type)
    if kind is None:
        raise InputError(f'{path}: geom "{geom.name}" has another type than box, cylinder or mesh.')
    aligned = np.array_equal(geom.quat, [1.0, 0.0, 0.0, 0.0]) and geom.alt.type in (
        mujoco.mjtOrientation.mjORIENTATION_QUAT,
        mujoco.mjtOrientation.mjORIENTATION_ZAXIS,
    )
    require(
        aligned and np.isnan(geom.mass) and np.isnan(geom.fromto[0]),
        f'{path}: geom "{geom.name}" is turned or has a mass; say pos=, size=, zaxis= of a cylinder, and density=.',
    )
    has_axis = geom.alt.type == mujoco.mjtOrientation.mjORIENTATION_ZAXIS
    require(not has_axis or kind == "cylinder", f'{path}: geom "{geom.name}" has zaxis=, which only a cylinder has.')
    require(
        kind != "mesh" or (geom.meshname in corners and not np.any(geom.pos)),
        f'{path}: geom "{geom.name}" needs a mesh with vertex=, and no pos=.',
    )
    return PartGeom(
        name=geom.name,
        kind=kind,
        pos=np.array(geom.pos),
        size=np.array(geom.size),
        axis=np.array(geom.alt.zaxis if has_axis else (0.0, 0.0, 1.0)),
        corners=corners[geom.meshname] if kind == "mesh" else np.zeros((0, 3)),
        density=float(geom.density),
        friction=_numbers(geom.friction),
        rgba=_numbers(geom.rgba),
    )


def _site(site: Any) -> PartSite:
    """Convert a site of a part file to a `PartSite`."""
    return PartSite(
        name=site.name,
        pos=np.array(site.pos),
        size=np.array(site.size),
        group=int(site.group),
        rgba=_numbers(site.rgba),
        default=site.classname.name,
    )


def _picture(spec: Any, geom: Any, path: Path) -> PartPicture:
    """The picture of a part; MuJoCo compiles it once to check the file."""
    file = spec.mesh(geom.meshname).file if geom.meshname else ""
    require(
        file and Path(file).name == file,
        f'{path}: geom "{geom.name}", which never collides, needs a mesh with file= in the folder of the part.',
    )
    picture = PartPicture(geom.name or "picture", path.parent / file, _numbers(geom.rgba))
    alone = mujoco.MjSpec()
    add_picture(alone, alone.worldbody, picture)
    try:
        alone.compile()
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read the picture {picture.file.name}: {_reason(error)}.") from error
    return picture


def add_picture(spec: Any, body: Any, picture: PartPicture) -> None:
    """Add the picture of a part to a body as a geom without mass and collisions."""
    # A picture need not enclose a volume, so its inertia is that of its surface.
    shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.add_mesh(name=picture.name, file=str(picture.file.absolute()), inertia=shell)
    body.add_geom(
        name=picture.name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=picture.name,
        mass=0.0,
        contype=0,
        conaffinity=0,
        group=1,
        rgba=picture.rgba,
    )


def _numbers(values: Iterable[float]) -> Any:
    return tuple(float(x) for x in values)


def _reason(error: Exception) -> str:
    """The message of MuJoCo or of the XML parser in one line."""
    return one_line(" ".join(str(error).split()).rstrip("."), _LONGEST_REASON)
