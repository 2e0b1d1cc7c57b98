"""Find the symmetries of tracked objects from the shapes of the parts of a scenario."""

from collections.abc import Mapping

import numpy as np

from apo_bench.formats.bop_models import ObjectSymmetry
from apo_bench.geometry import Solid, pose
from apo_bench.importers.recording.folding import list_images
from apo_bench.importers.recording.objects_file import ObjectsFile

_TURNS = 360  # turns about an axis of revolution


def find_object_symmetries(objects: ObjectsFile, solids: Mapping[str, Solid]) -> Mapping[int, ObjectSymmetry]:
    """Return the symmetries of each object whose part has any, in the frame of its model, by the number of the object.

    Args:
        solids: Shapes of parts by name.
    """
    found = {}
    for part, tracked in objects.parts.items():
        for name in tracked.ids:
            M = tracked.others.get(name, tracked.T_model_part)
            images = M @ list_images(solids[part], np.eye(4), _TURNS) @ pose.inverse(M)
            images[:, :3, 3] *= 1e3  # [mm]
            if name.isdigit() and len(images) > 1:
                found[int(name)] = ObjectSymmetry(images)
    return found
