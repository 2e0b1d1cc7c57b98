"""CAMERA.toml: how a log is written, and the places of its camera and of known parts."""

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

_EULER = re.compile(r"(?!.*(.)\1)([xyz]{3}|[XYZ]{3})")
NamedEntries = Annotated[dict[str, Any], Meta(min_length=1)]
"""A table whose keys are names of the reader's own."""


class Conventions(FileTable, frozen=True, kw_only=True):
    """How a log is written, where its columns do not show it."""

    length: Literal["mm", "cm", "m"] | None = None
    angle: Literal["deg", "rad"] | None = None
    time: Literal["s", "ms", "us", "ns"] = "s"
    quaternion: Literal["wxyz", "xyzw"] | None = None
    """Order of four numbers without names."""
    euler: str | None = None
    """Axes as SciPy spells them: `xyz` about fixed axes, `XYZ` about moving ones."""
    rate_hz: Annotated[float, Meta(gt=0.0, le=1e6)] | None = None
    """Of images that have no time."""
    scene: int | None = None
    """Of BOP results, which may hold several."""
    inverted: bool = False
    """Whether poses are of the camera in the model."""
    mirror: Literal["x", "y", "z"] | None = None
    """The axis along which a left-handed tracker counts the other way."""
    columns: dict[str, str] = field(default_factory=dict)
    """What it is here -> column of the file."""


class RestNoiseTable(FileTable, frozen=True, kw_only=True):
    """An error that stays while a part rests."""

    stays_mm: Annotated[float, Meta(ge=0.0, le=100.0)]
    stays_deg: Annotated[float, Meta(ge=0.0, le=90.0)]

    @property
    def deviation(self) -> Array:
        """(2,), [m, rad]."""
        return np.array([self.stays_mm * 1e-3, np.radians(self.stays_deg)])


class CameraTable(FileTable, frozen=True, kw_only=True):
    """The tables of the file."""

    schema: Literal["apo-bench/camera/1"]
    log: Conventions = Conventions()
    pose: AnyPose | None = None
    known: NamedEntries | None = None
    noise: RestNoiseTable | None = None


@final
@dataclass(frozen=True, eq=False)
class CameraFile:
    """The statements of a camera file."""

    conventions: Conventions
    T_world_camera: Array | None
    """(4, 4), [m]; None: to be solved."""
    known: Mapping[str, Array | None]
    """Part -> where it stands in the world, (4, 4); None: where the scenario starts it."""
    stays: Array | None
    """(2,), standard deviation of the error that stays while a part rests, per axis, [m, rad]; None: not stated."""

    def places(self, planned: Mapping[str, Array]) -> Mapping[str, Array]:
        """Return where known parts stand in the world, (4, 4), [m].

        Args:
            planned: Where the scenario starts them.
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
    if value == "start":
        return None
    require(isinstance(value, dict), f'{place}: "start" or a pose is needed.')
    return convert_typed(value, AnyPose, place).matrix(place)
