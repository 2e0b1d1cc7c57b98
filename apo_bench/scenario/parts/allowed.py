"""Limits of parts, and names that are allowed."""

import re

FACE_OR_PART_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What parts, boxes and faces may be called: names that stay unambiguous in `part.face` and in a scene."""
LONGEST_FACE_NAME = 64
LARGEST_M = 10.0
"""No coordinate in a part is larger."""
THINNEST_M = 0.0005
"""Half of the least thickness of a box or a cylinder."""
WIDEST_M = 0.1
"""Largest radius of a cylinder, which is cut into sides."""
MOST_PIECES = 2000
"""Of a part."""
MOST_CORNERS_IN_ALL = 40_000
"""Of all pieces of a part."""
MOST_FACES = 1000
DENSITY = (1.0, 25_000.0)
"""Least and largest, [kg/m^3]."""
LIGHTEST_KG = 1e-4
HEAVIEST_KG = 1e6
LARGEST_PART_BYTES = 4_000_000
"""Of a part file, and of the file next to it."""


def is_name(text: str) -> bool:
    """Whether a part, a piece or a face may be called so."""
    return len(text) <= LONGEST_FACE_NAME and FACE_OR_PART_NAME.fullmatch(text) is not None
