"""The description of a data set of images in BOP format: which image shows which operation of which trial, and how.

`apo_trials.json` lies in the folder of the data set, next to `models` and the folder of the split. Objects, scenes and
images have the numbers of the BOP format.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from apo_bench.errors import InputError, require
from apo_bench.formats.bop import LARGEST_ID
from apo_bench.geometry import Array, pose
from apo_bench.io import FileTable, Finite, Text, Triple, read_typed

DESCRIPTION = "apo_trials.json"
CAMERAS = "scene_camera.json"
MODELS_INFO = "models_info.json"
TRUTH, VISIBILITY = "scene_gt.json", "scene_gt_info.json"
LEAST_VISIBLE = 0.1
"""A part of which a smaller fraction is visible is no target, as in the BOP benchmark."""
_LARGEST_BYTES = 64_000_000
_LEVELS = 3  # folders above a file in which the description is looked for
_Id = Annotated[int, Meta(ge=0, le=LARGEST_ID)]
_Key = Annotated[str, Meta(pattern=r"^[0-9]{1,9}\Z")]  # the number of a scene, an image or an object
_NineNumbers = Annotated[tuple[Finite, ...], Meta(min_length=9, max_length=9)]
_Size = Annotated[float, Meta(ge=0.0, le=5000.0)]


class ImageConfig(FileTable, frozen=True):
    """How the images of a data set are taken; the help of options is the documentation."""

    cameras: Annotated[Literal[1, 2, 4], Meta(description="Number of cameras around the table: 1, 2 or 4.")] = 1
    width: Annotated[int, Meta(ge=32, le=1280, description="Width of an image, in pixels.")] = 640
    height: Annotated[int, Meta(ge=32, le=960, description="Height of an image, in pixels.")] = 480
    focal_px: Annotated[_Size, Meta(description="Focal length in pixels; 0: 1.25 times the width.")] = 0.0
    distance_mm: Annotated[
        float, Meta(ge=100.0, le=5000.0, description="Distance of the cameras from the assembly, in mm.")
    ] = 900.0
    camera_error_mm: Annotated[
        _Size, Meta(description="Error of the published camera positions, in mm (1 sigma per axis).")
    ] = 0.0
    camera_error_deg: Annotated[
        _Size, Meta(description="Error of the published camera orientations, in degrees (1 sigma per axis).")
    ] = 0.0
    depth_noise_mm: Annotated[
        _Size, Meta(description="Noise of a depth pixel at 1 m, in mm (1 sigma); grows with the squared depth.")
    ] = 1.0
    detection_error_px: Annotated[
        _Size, Meta(description="Error of position and size of the default detections, in pixels (1 sigma).")
    ] = 0.0
    video_hz: Annotated[
        float,
        Meta(ge=0.0, le=50.0, description="Images between operations for each second, to track parts; 0: none."),
    ] = 0.0
    marks: Annotated[bool, Meta(description="Print coloured marks on the parts, so that their faces differ.")] = False
    no_rgb: Annotated[bool, Meta(description="Write depth and masks only, which needs no graphics.")] = False
    randomise: Annotated[bool, Meta(description="Vary camera poses, lights and table colours by trial.")] = False


class ImageEntry(FileTable, frozen=True):
    """What an image shows."""

    operation: Annotated[int, Meta(ge=1)]
    """The operation that ended before the image was taken, from 1."""
    camera: Annotated[int, Meta(ge=0)]


class SceneEntry(FileTable, frozen=True):
    """The trial of a scene."""

    scenario: Text
    """Its name or file."""
    seed: Annotated[int, Meta(ge=0)]
    clearance_mm: Finite
    parts: dict[Text, _Id]
    """Part -> number of its object; parts of one shape and colour are one object."""
    images: dict[_Key, ImageEntry]
    """Number of an image -> what it shows."""


class ImageDescription(FileTable, frozen=True):
    """All entries of `apo_trials.json`."""

    schema: Literal["apo-bench/images/1"]
    split: Text
    """Folder of the scenes: `test` or `val`."""
    human_error_scale: Finite
    secret_seed: Text | None
    """Hash of the secret seed that the trials were drawn with; None for trials that anyone can draw."""
    options: ImageConfig
    centers_mm: dict[_Key, Triple]
    """Number of an object -> origin of its model, the middle of its bounding box, in the frame of the part."""
    scenes: dict[_Key, SceneEntry]

    def offset(self, number: int) -> Array:
        """The pose of the model of an object in the frame of its part, (4, 4), [m]."""
        return pose.at(1e-3 * np.array(self.centers_mm[str(number)]))


def read_image_description(folder: Path) -> ImageDescription:
    """Read `apo_trials.json` in the folder of a data set.

    Raises:
        InputError: There is no such file, or it deviates from its schema.
    """
    path = folder / DESCRIPTION
    description = read_typed(path, ImageDescription, "description of images", syntax="json", limit=_LARGEST_BYTES)
    for number, scene in description.scenes.items():
        unknown = sorted({str(each) for each in scene.parts.values()} - {*description.centers_mm})
        require(not unknown, f"{path}, scenes, {number}: centers_mm has no object {', '.join(unknown)}; add it.")
    return description


def find_images(path: Path) -> Path:
    """The folder of the data set in which a file lies.

    Raises:
        InputError: No folder above the file holds `apo_trials.json`.
    """
    for folder in path.resolve().parents[:_LEVELS]:
        if (folder / DESCRIPTION).is_file():
            return folder
    raise InputError(
        f"'{path}' lies in no data set of images; move it into the folder that `apo-bench dataset make --format bop` "
        f"wrote, which holds {DESCRIPTION}."
    )


def list_image_files(results: Path) -> tuple[Path, ...]:
    """The files of a data set of images without which its results file cannot be read: trials and cameras.

    Raises:
        InputError: The results file lies in no data set of images.
    """
    folder = find_images(results)
    return folder / DESCRIPTION, *sorted(folder.glob(f"*/*/{CAMERAS}"))


class PublishedCamera(msgspec.Struct, frozen=True):
    """The camera of an image as published, other keys ignored; the true one differs by the error of its calibration."""

    cam_K: _NineNumbers
    cam_R_w2c: _NineNumbers
    cam_t_w2c: Triple
    depth_scale: Finite = 1.0
    """[mm] of one step in a depth image."""

    @property
    def T_world_camera(self) -> Array:
        """(4, 4), axes of OpenCV, [m]."""
        return pose.inverse(pose.rigid(np.reshape(self.cam_R_w2c, (3, 3)), 1e-3 * np.array(self.cam_t_w2c)))

    @property
    def K(self) -> Array:
        """(3, 3), the middle of the first pixel is at (0, 0), [pixels]."""
        return np.reshape(self.cam_K, (3, 3))


def read_cameras(folder: Path) -> Mapping[int, PublishedCamera]:
    """Read the cameras of a scene: number of an image -> its camera.

    Args:
        folder: Of the scene.

    Raises:
        InputError: The file is missing or deviates from the format.
    """
    path = folder / CAMERAS
    entries = read_typed(path, dict[_Key, PublishedCamera], "cameras of a scene", syntax="json", limit=_LARGEST_BYTES)
    for image, camera in entries.items():
        is_rigid = pose.is_rigid(camera.T_world_camera[None])[0]
        require(is_rigid, f"{path}, image {image}, cam_R_w2c: a rotation matrix is needed.")
    return {int(image): camera for image, camera in entries.items()}
