"""Names of the sources of a corrector's contacts, as records have them.

`given`             the correct contacts
`false-negative`    one contact is missing
`false-positive`    one contact too many
`face-offset:3mm`   one face lies 3 mm off the face of the part's model
`detected`          detected in the observed poses; `detected-jointly` estimates contacts and poses together
`module:name`       your own function
"""

import math
from types import MappingProxyType

from apo_bench.errors import require, require_known, require_text

WRONG_CONTACTS = MappingProxyType(
    {
        "false-negative": "apo_bench.perception.observation.wrong_contacts:omit_contact",
        "false-positive": "apo_bench.perception.observation.wrong_contacts:add_contact",
        "face-offset": "apo_bench.perception.observation.wrong_contacts:FaceOffset",
    }
)
"""Sources of wrong contacts -> the function or class that makes them."""
GIVEN = "given"
"""The correct contacts, which come with the demonstration."""
WRONG = tuple(WRONG_CONTACTS)
DETECTED = ("detected", "detected-jointly")
_KINDS = (GIVEN, *WRONG, *DETECTED)
FACE_OFFSET_MM = 2.0
"""Default offset of `face-offset`."""
_LARGEST_OFFSET_MM = 50.0  # largest offset


def normalise_contact_source(text: str) -> str:
    """Return the canonical name of a contact source: `face-offset:3.0mm` becomes `face-offset:3mm`.

    Raises:
        InputError: The offset is not allowed.
    """
    kind, _, size = text.partition(":")
    if kind != "face-offset":
        return text
    offset_mm = parse_face_offset(text) if size else FACE_OFFSET_MM
    return f"face-offset:{offset_mm:g}mm"


def parse_face_offset(text: str) -> float:
    """Return the offset in `face-offset:3mm`, [mm].

    Raises:
        InputError: The offset has no unit, is no number, or is out of range.
    """
    size = text.partition(":")[2]
    try:
        offset_mm = float(size.removesuffix("mm")) if size.endswith("mm") else math.nan
    except ValueError:
        offset_mm = math.nan
    require(
        0.0 < offset_mm <= _LARGEST_OFFSET_MM,
        f"contact source '{text}': the offset must be above 0 and at most {_LARGEST_OFFSET_MM:g} mm, with its unit, as "
        "in face-offset:3mm.",
    )
    return offset_mm


def check_contact_source(text: str) -> str:
    """Return the canonical name of a contact source, or raise an `InputError` if there is no such source."""
    require_text("contact source", text)
    name = normalise_contact_source(text)
    require(
        name.partition(":")[0] not in _KINDS or name in _KINDS or name.startswith("face-offset:"),
        f"contact source '{text}': only face-offset takes a size, as in face-offset:3mm.",
    )
    if ":" not in name:
        require_known("contact source", name, _KINDS, rest=" Or give your own as 'package.module:name'.")
    return name
