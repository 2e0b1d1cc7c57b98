"""Which trials name code of somebody's own, which is imported to run them: `package.module:name`.

A file is data. What rows or `run.json` name is never imported unless it comes with the package, or a person says that
the folder is trusted.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from apo_bench.records.relations import WRONG
from apo_bench.records.short_names import FOREIGN_ARMS, RESIDUALS

_MOST = 3
"""Names in the sentence."""


def own_code(row: Mapping[str, Any]) -> tuple[str, ...]:
    """What of a row is code of somebody's own; files of noise and scenarios are data."""
    found = [row[name] for name in ("method", "arm") if ":" in (row.get(name) or "")]
    found = [name for name in found if not name.startswith(FOREIGN_ARMS)]
    noise = row["noise"]
    relations = row["relations"]
    found += [noise] * (":" in noise and not noise.startswith(RESIDUALS))
    found += [relations] * (":" in relations and relations.partition(":")[0] not in WRONG)
    return tuple(dict.fromkeys(found))


def left_out(rows: Iterable[Mapping[str, Any]]) -> str:
    """The sentence on failed trials that are not run again for a picture; empty if there are none."""
    met = [own for row in rows if row["success"] is False and (own := own_code(row))]
    if not met:
        return ""
    names = list(dict.fromkeys(name for own in met for name in own))
    more = f" and {len(names) - _MOST} more" * (len(names) > _MOST)
    many = "1 failed trial names" if len(met) == 1 else f"{len(met):,} failed trials name"
    return (
        f"{many} code that does not come with the package ({', '.join(names[:_MOST])}{more}); a report runs it only "
        "with --trust-code"
    )
