"""Write the poses of all copies of parts in a CAD file to a file of poses."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from apo_bench.geometry import pose
from apo_bench.importers.cad.solids import SolidPlace, clean_title, make_part_name
from apo_bench.io import write_file


def name_places(parts: Mapping[str, Iterable[SolidPlace]]) -> list[tuple[str, str, SolidPlace]]:
    """Return part, unique name and place of each copy.

    Args:
        parts: Part -> its places.
    """
    used: set[str] = set()
    copies = []
    for part, places in parts.items():
        for place in places:
            name = make_part_name(place.name, used)
            used.add(name)
            copies.append((part, name, place))
    return copies


def write_places(places: Iterable[tuple[str, str, SolidPlace]], folder: Path, source: str) -> Path:
    """Write `poses.toml`, which `scenario new` reads together with the part files, and return its path.

    Args:
        places: Part, name and place of each copy.
        source: Names of the CAD files, for the header.
    """
    lines = [f"# where {source} has its parts".replace("\n", " ")]
    for part, name, place in places:  # [mm], as CAD files are imported
        packed = pose.pack(place.T)
        lines += ["", "[[pose]]", f'part = "{part}"', f'name = "{name}"']
        lines += [f"title = {json.dumps(clean_title(place.name), ensure_ascii=False)}"] * (name != place.name)
        lines.append(f"at_mm = {_format_list(packed[:3])}")
        lines.append(f"quaternion_wxyz = {_format_list(packed[3:])}")
        if place.color is not None:
            lines.append(f"color = {_format_list(np.round(place.color, 4))}")
        lines += ["held = true  # by a fastener that was left out"] * place.held
    path = folder / "poses.toml"
    write_file(path, "\n".join(lines) + "\n")
    return path


def _format_list(values: Iterable[float]) -> str:
    """Return a TOML list of numbers without rounding noise."""
    return "[" + ", ".join(f"{round(float(x), 12) + 0.0:.12g}" for x in values) + "]"
