"""What a corrector is told of the contacts, by the names that rows use.

`given`             the right ones
`missed`, `false`   one too few, one too many
`shifted:3`         one face is not where the model of its part says, by 3 mm
`recognised`        found in what was seen; `recognised-fixed`, `recognised-twice`, `recognised-jointly` in other ways
`module:name`       a function of somebody's own
"""

import math

from apo_bench.errors import InputError, require, require_text, unknown
from apo_bench.records.short_names import WRONG_RELATIONS

GIVEN = "given"
"""The contacts come with the demonstration, and are right."""
WRONG = tuple(WRONG_RELATIONS)
RECOGNISED = ("recognised", "recognised-fixed", "recognised-twice", "recognised-jointly")
_KINDS = (GIVEN, *WRONG, *RECOGNISED)
SHIFT_MM = 2.0
_LARGEST_SHIFT_MM = 50.0


def relations_name(text: str) -> str:
    """How rows spell it: `shifted` stands for 2 mm, `shifted:3.0` is `shifted:3`.

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
        f"the relations '{text}' were given; a size above 0 and up to {_LARGEST_SHIFT_MM:g} mm is allowed: shifted:3.",
    )
    return f"shifted:{size_mm:g}"


def checked_relations(text: str) -> str:
    """The relations as rows spell them; raise an `InputError` unless there are such."""
    require_text("relations", text)
    name = relations_name(text)
    require(
        name.partition(":")[0] not in _KINDS or name in _KINDS or name.startswith("shifted:"),
        f"the relations '{text}' were given; only shifted has a size, as in shifted:3.",
    )
    if ":" not in name and name not in _KINDS:
        raise InputError(unknown("kind of relations", text, _KINDS) + " Or give your own as 'package.module:name'.")
    return name
