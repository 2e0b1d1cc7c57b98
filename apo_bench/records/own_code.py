"""Find code of the user, `package.module:name`, among the names in a record.

A record is data: what it names is imported only if it comes with the package.
"""

from collections.abc import Mapping
from typing import Any

from apo_bench.records.contact_sources import WRONG

FOREIGN_ARMS = ("menagerie:", "robosuite:")
"""How the arms of other collections begin; what follows is looked up there, and never imported."""
FAILURES = ("flips", "stale", "swaps", "rays", "displaced-view")
"""Noise models in which a camera fails now and then: the covariance that is stated is that of what is no failure. Rates
may follow the name, as in `flips:p=0.1/r=0.5`."""
RESIDUALS = "empirical:"
"""Begins the name of a noise that draws from a file of residuals."""
DATA_PREFIXES: Mapping[str, tuple[str, ...]] = {
    "method": (),
    "arm": FOREIGN_ARMS,
    "noise": (RESIDUALS, *(f"{name}:" for name in FAILURES)),
    "contact_source": tuple(f"{kind}:" for kind in WRONG),
}
"""Column -> how names with a colon begin that are data."""


def own_code(record: Mapping[str, Any]) -> tuple[str, ...]:
    """The code of the user that a record names; files of noise and scenarios are data."""
    names = [record[column] for column in DATA_PREFIXES if is_own_code(column, record[column])]
    return tuple(dict.fromkeys(names))


def is_own_code(column: str, name: str) -> bool:
    """Whether a name in a column is `module:name`, and has none of the `DATA_PREFIXES`."""
    return ":" in name and not name.startswith(DATA_PREFIXES[column])
