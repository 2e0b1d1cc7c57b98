"""Find user code, `package.module:name`, among the names in a record.

A record is data: code that it names is imported only if it comes with the package.
"""

from collections.abc import Mapping
from typing import Any

from apo_bench.records.contact_sources import WRONG

FOREIGN_ARMS = ("menagerie:", "robosuite:")
"""Prefixes of the arms of other collections; the name that follows is looked up there, and never imported."""
FAILURES = (
    *("flips", "stale", "swaps", "rays", "displaced-view"),
    *("latency", "depth-scale", "merged", "cad-scale", "mirrored-yaw"),
)
"""Noise models in which a camera fails now and then; their stated covariance is that of an observation without failure.

Rates may follow the name, as in `flips:p=0.1/r=0.5`.
"""
RESIDUALS = "empirical:"
"""Prefix of the name of a noise model that draws from a file of residuals."""
ESTIMATES = "poses:"
"""Prefix of a results file of a pose estimator, in place of a noise model; `::` and a noise file may follow."""
DATA_PREFIXES: Mapping[str, tuple[str, ...]] = {
    "method": (),
    "arm": FOREIGN_ARMS,
    "noise": (RESIDUALS, ESTIMATES, *(f"{name}:" for name in FAILURES)),
    "contact_source": tuple(f"{kind}:" for kind in WRONG),
}
"""Column -> prefixes of names with a colon that are no code."""


def list_user_code(record: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of user code in a record; files of noise models and scenarios are data, not code."""
    names = [record[column] for column in DATA_PREFIXES if is_user_code(column, record[column])]
    return tuple(dict.fromkeys(names))


def is_user_code(column: str, name: str) -> bool:
    """Return whether a name in a column is `module:name`, and begins with none of the `DATA_PREFIXES`."""
    return ":" in name and not name.startswith(DATA_PREFIXES[column])
