"""Which trials name code of somebody's own, which is imported to run them: `package.module:name`.

A file is data. What rows or `run.json` name is never imported unless it comes with the package, or a person says that
the folder is trusted.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from apo_bench.records.short_names import FAILURES, FOREIGN_ARMS, RESIDUALS, WRONG

DATA_PREFIXES: Mapping[str, tuple[str, ...]] = {
    "method": (),
    "arm": FOREIGN_ARMS,
    "noise": (RESIDUALS, *(f"{name}:" for name in FAILURES)),
    "relations": tuple(f"{kind}:" for kind in WRONG),
}
"""Column -> how names with a colon begin that are data, and no code."""
_MOST = 3
"""Names in the sentence."""


def own_code(row: Mapping[str, Any]) -> tuple[str, ...]:
    """What of a row is code of somebody's own; files of noise and scenarios are data."""
    names = [row[column] for column, data in DATA_PREFIXES.items() if is_own_code(row[column], data)]
    return tuple(dict.fromkeys(names))


def is_own_code(name: str, data: tuple[str, ...]) -> bool:
    """Whether a name is `module:name`, and none that begins as one of the `DATA_PREFIXES`."""
    return ":" in name and not name.startswith(data)


def left_out(rows: Iterable[Mapping[str, Any]]) -> str:
    """The sentence on failed trials that are not run again for a picture; empty if there are none."""
    of_rows = [own for row in rows if row["success"] is False and (own := own_code(row))]
    if not of_rows:
        return ""
    names = list(dict.fromkeys(name for own in of_rows for name in own))
    more = f" and {len(names) - _MOST} more" * (len(names) > _MOST)
    many = "1 failed trial names" if len(of_rows) == 1 else f"{len(of_rows):,} failed trials name"
    return (
        f"{many} code that does not come with the package ({', '.join(names[:_MOST])}{more}); a report runs it only "
        "with --trust-code"
    )
