"""Read CAMERA.toml: the conventions of a log, the pose of its camera, and the places of known parts."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from msgspec import Meta, field

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.io import FileTable, convert_typed, read_typed
from apo_bench.scenario.values import AnyPose

_EULER = re.compile(r"(?!.*(.)\1)([xyz]{3}|[XYZ]{3})")  # each axis once, all small or all capital letters
NamedEntries = Annotated[dict[str, Any], Meta(min_length=1)]
"""A table whose keys are names that the user chooses."""


class Conventions(FileTable, frozen=True, kw_only=True):
    """Conventions of a log that its columns do not show."""

    length: Literal["mm", "cm", "m"] | None = None
    angle: Literal["deg", "rad"] | None = None
    time: Literal["s", "ms", "us", "ns"] | None = None
    quaternion: Literal["wxyz", "xyzw"] | None = None
    """Order of the four numbers of a quaternion without names, q0 to q3."""
    euler: str | None = None
    """Order of Euler angles as in SciPy: `xyz` about fixed axes, `XYZ` about moving axes."""
    rate_hz: Annotated[float, Meta(gt=0.0, le=1e6)] | None = None
    """Rate of images, for logs without times."""
    scene: int | None = None
    """Scene of BOP results, which may hold several."""
    inverted: bool = False
    """Whether poses are those of the camera in the frame of the model."""
    mirror: Literal["x", "y", "z"] | None = None
    """The reversed axis of a left-handed tracker."""
    columns: dict[str, str] | list[str] = field(default_factory=dict)
    """Name of a column as this package knows it -> its name in the file; or the names of all columns of a file without
    a header, empty for those that are ignored."""


class RestNoiseTable(FileTable, frozen=True, kw_only=True):
    """The table [noise]: standard deviations of an error that is constant while a part rests."""

    stays_mm: Annotated[float, Meta(ge=0.0, le=100.0)]
    stays_deg: Annotated[float, Meta(ge=0.0, le=90.0)]

    @property
    def deviation(self) -> Array:
        """(2,), standard deviations along and about each axis, [m, rad]."""
        return np.array([self.stays_mm * 1e-3, np.radians(self.stays_deg)])


class CameraTable(FileTable, frozen=True, kw_only=True):
    """The tables of a camera file."""

    schema: Literal["apo-bench/camera/1"]
    log: Conventions = Conventions()
    pose: AnyPose | None = None
    known: NamedEntries | None = None
    noise: RestNoiseTable | None = None


@final
@dataclass(frozen=True, eq=False)
class CameraFile:
    """The content of a camera file."""

    conventions: Conventions
    T_world_camera: Array | None
    """(4, 4), [m]; None: to be solved from known parts."""
    known: Mapping[str, Array | None]
    """Part -> its pose in the world, (4, 4), [m]; None: its start in the scenario."""
    stays: Array | None
    """(2,), standard deviations of the error that is constant during a rest, along and about each axis, [m, rad]."""

    def places(self, planned: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return the poses of known parts in the world, (4, 4), [m].

        Args:
            planned: Start of each part in the scenario, for parts that are known to be there.
        """
        return {part: planned[part] if T is None else T for part, T in self.known.items()}


def read_camera(path: str | Path) -> CameraFile:
    """Read a camera file.

    Raises:
        InputError: A key or value is wrong; the message names it.
    """
    top = read_typed(path, CameraTable, "camera file")
    require(
        top.log.euler is None or _EULER.fullmatch(top.log.euler),
        f"{path}, log, euler: three axes are needed: small letters about fixed axes, such as xyz, capitals about "
        "moving ones.",
    )
    return CameraFile(
        conventions=top.log,
        T_world_camera=None if top.pose is None else top.pose.matrix(f"{path}, pose"),
        known={part: _place(value, f"{path}, known, {part}") for part, value in (top.known or {}).items()},
        stays=None if top.noise is None else top.noise.deviation,
    )


def _place(value: Any, place: str) -> Array | None:
    """Read a known place; None for "start"."""
    if value == "start":
        return None
    require(isinstance(value, dict), f'{place}: "start" or a pose is needed.')
    return convert_typed(value, AnyPose, place).matrix(place)
