"""Sources of the contacts that a corrector gets, by the names that records use.

`given`             the correct contacts
`false-negative`    one contact is missing
`false-positive`    one contact too many
`shifted:3`         one face is 3 mm away from where the model of its part has it
`detected`          detected in the observed poses; `detected-jointly` estimates contacts and poses together
`module:name`       your own function
"""

import math
from types import MappingProxyType

from apo_bench.errors import require, require_known, require_text

WRONG_CONTACTS = MappingProxyType(
    {
        "false-negative": "apo_bench.perception.observation.wrong_contacts:missed",
        "false-positive": "apo_bench.perception.observation.wrong_contacts:false",
        "shifted": "apo_bench.perception.observation.wrong_contacts:Shifted",
    }
)
"""Sources of wrong contacts."""
GIVEN = "given"
"""The correct contacts, which come with the demonstration."""
WRONG = tuple(WRONG_CONTACTS)
DETECTED = ("detected", "detected-jointly")
_KINDS = (GIVEN, *WRONG, *DETECTED)
SHIFT_MM = 2.0
_LARGEST_SHIFT_MM = 50.0


def normalise_contact_source(text: str) -> str:
    """The canonical name of a contact source: `shifted` is `shifted:2`, `shifted:3.0` is `shifted:3`.

    Raises:
        InputError: A size that is not allowed.
    """
    kind, _, size = text.partition(":")
    if kind != "shifted":
        return text
    try:
        size_mm = float(size or SHIFT_MM)
    except ValueError:
        size_mm = math.nan
    require(
        0.0 < size_mm <= _LARGEST_SHIFT_MM,
        f"the contact source '{text}' was given; a size above 0 and up to {_LARGEST_SHIFT_MM:g} mm is allowed: "
        "shifted:3.",
    )
    return f"shifted:{size_mm:g}"


def checked_contact_source(text: str) -> str:
    """The canonical name of a contact source; raise an `InputError` if there is no such source."""
    require_text("contact source", text)
    name = normalise_contact_source(text)
    require(
        name.partition(":")[0] not in _KINDS or name in _KINDS or name.startswith("shifted:"),
        f"the contact source '{text}' was given; only shifted has a size, as in shifted:3.",
    )
    if ":" not in name:
        require_known("contact source", name, _KINDS, rest=" Or give your own as 'package.module:name'.")
    return name
