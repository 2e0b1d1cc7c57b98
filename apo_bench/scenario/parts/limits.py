"""Limits of parts, and names that are allowed."""

import re

FACE_OR_PART_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Names of parts, pieces and faces that stay unambiguous in `part.face` and in a scene."""
LONGEST_FACE_NAME = 64
"""Largest number of characters of a name."""
LARGEST_M = 10.0
"""Largest absolute coordinate in a part."""
THINNEST_M = 0.0005
"""Least half thickness of a box or a cylinder."""
WIDEST_M = 0.1
"""Largest radius of a cylinder, which is approximated by flat sides."""
MOST_PIECES = 2000
"""Largest number of pieces of a part."""
MOST_CORNERS_IN_ALL = 40_000
"""Largest number of corners of all pieces of a part."""
MOST_FACES = 1000
"""Largest number of faces of a part."""
DENSITY = (1.0, 25_000.0)
"""Least and largest density, [kg/m^3]."""
LIGHTEST_KG = 1e-4
"""Least mass of a part."""
HEAVIEST_KG = 1e6
"""Largest mass of a part."""
LARGEST_PART_BYTES = 4_000_000
"""Largest size of a part file, and of the TOML file next to it."""


def is_name(text: str) -> bool:
    """True if a part, a piece or a face may have this name."""
    return len(text) <= LONGEST_FACE_NAME and FACE_OR_PART_NAME.fullmatch(text) is not None
