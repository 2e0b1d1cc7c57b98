"""Read the symmetries of objects from `models_info.json` of the BOP format."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from apo_bench.errors import InputError
from apo_bench.formats.bop import LARGEST_MM
from apo_bench.geometry import Array, make_rotation_about_axis, pose
from apo_bench.io import convert_typed, read_typed

LARGEST_MODELS_BYTES = 64_000_000
_PLACES = ("models_info.json", "models/models_info.json", "models_eval/models_info.json")  # beside or above the truth
_LEVELS = 4  # folders above the truth in which a dataset has its models
_TURNS = 360  # turns about a continuous axis


class _Continuous(msgspec.Struct, frozen=True):
    axis: tuple[float, float, float]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


class _Model(msgspec.Struct, frozen=True):
    """The symmetries of an object, in mm; other keys are ignored."""

    symmetries_discrete: list[list[float]] = []
    symmetries_continuous: list[_Continuous] = []


class ObjectSymmetry(NamedTuple):
    """The displacements after which an object looks the same."""

    images: Array
    """(m, 4, 4), the identity first, [mm]; turns about a continuous axis in steps of a degree."""


def find_models_info(truth: str | Path) -> Path | None:
    """Return the `models_info.json` of the dataset that holds a truth file or folder; None if there is none."""
    folder = Path(truth).resolve()
    for above in (folder, *folder.parents[:_LEVELS]):
        for place in _PLACES:
            if (above / place).is_file():
                return above / place
    return None


def read_symmetries(path: str | Path) -> Mapping[int, ObjectSymmetry]:
    """Return the symmetries of each object that has any.

    Raises:
        InputError: The file deviates from the format, or a symmetry is no rigid displacement.
    """
    models = read_typed(path, dict[str, object], "models_info.json", syntax="json", limit=LARGEST_MODELS_BYTES)
    found = {}
    for name, value in models.items():
        model = convert_typed(value, _Model, f"{path}, {name}")
        discrete = [np.eye(4)]
        for numbers in model.symmetries_discrete:
            if len(numbers) != 16 or not pose.is_rigid(np.reshape(numbers, (1, 4, 4)))[0] or max(numbers) > LARGEST_MM:
                raise InputError(f"{path}, {name}, symmetries_discrete: 16 numbers of a rigid displacement are needed.")
            discrete.append(np.reshape(numbers, (4, 4)))
        images = np.array(discrete)
        for each in model.symmetries_continuous:
            length = float(np.linalg.norm(each.axis))
            if not length > 0.0:
                raise InputError(f"{path}, {name}, symmetries_continuous: an axis that is not zero is needed.")
            axis = np.array(each.axis) / length
            turns = np.array(
                [
                    make_rotation_about_axis(np.array(each.offset), axis, angle)
                    for angle in np.radians(np.arange(_TURNS))
                ]
            )
            images = (images[:, None] @ turns[None]).reshape(-1, 4, 4)
        if len(images) > 1 and name.isdigit():
            found[int(name)] = ObjectSymmetry(images)
    return found
