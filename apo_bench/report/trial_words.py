"""How a trial ended, in a few words."""

from apo_bench.records.row import Row

FAILED = "failed"
RIGHT = "right"
LOOSE = "loosely right"
EXCLUDED = "excluded"
OTHERWISE = "right, not as demonstrated"


def verdict(row: Row) -> str:
    """How a trial ended, in a word or two."""
    if row["success"] is None:
        return EXCLUDED
    if row["success"]:
        return RIGHT if row["as_demonstrated"] else OTHERWISE
    return LOOSE if row["loose_success"] else FAILED


def why(row: Row) -> str:
    """`attach: force_stop, operation 3`; nothing where nothing failed."""
    if row["failure_stage"] is None:
        return ""
    where = "" if row.get("failure_operation") is None else f", operation {row['failure_operation']}"
    return f"{row['failure_stage']}: {row['failure_code']}{where}"
