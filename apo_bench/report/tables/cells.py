"""The cells of a sweep: success rates with their intervals."""

from collections.abc import Callable, Sequence

from apo_bench.records.method import knows_relations, knows_truth, may_look
from apo_bench.report.tables.table import Column, Table, interval_columns, level_text, rate_columns
from apo_bench.statistics.rate_text import failures, percent, percents
from apo_bench.statistics.rates import Cell


def cell_table(cells: Sequence[Cell]) -> Table:
    """Axes that are as usual in every cell are left to files."""
    met: dict[str, Callable[[Cell], bool]] = {
        "noise": lambda c: not knows_truth(c.method),
        "relations": lambda c: knows_relations(c.method),
        "looks": lambda c: may_look(c.method),
        "robot_error": lambda c: True,
    }

    def axis(name: str, usual: str | int) -> Column:
        unusual = any(getattr(c, name) != usual for c in cells)
        return Column(name, name * unusual, text=lambda c: getattr(c, name) if met[name](c) else "any", words=True)

    return Table(
        cells,
        (
            Column("scenario", "scenario", words=True),
            Column("clearance_mm", "clearance", text=lambda c: f"{c.clearance_mm:g} mm", words=True),
            axis("noise", "isotropic"),
            axis("relations", "given"),
            Column("careless", "careless", text=lambda c: "any" if knows_truth(c.method) else c.careless, words=True),
            Column("level_mm", "level", value=lambda c: c.level, text=level_text, words=True),
            Column("level_deg"),
            Column("tightness"),
            Column("method", "method", words=True),
            Column("grasp"),
            Column("fidelity"),
            axis("looks", 0),
            axis("robot_error", "none"),
            Column("", "success", text=lambda c: percent(c.rate)),
            Column("", "95 % interval", text=lambda c: percents(c.interval)),
            Column("trials", "n"),
            Column("successes"),
            Column("rate"),
            *interval_columns(lambda c: c.interval),
            *rate_columns(
                lambda c: c.executed,
                ("executed", "", "executed_rate", "executed_low_95", "executed_high_95"),
            ),
            Column("as_demonstrated", value=lambda c: c.demonstrated),
            Column("as_demonstrated_rate", value=lambda c: c.demonstrated_rate),
            Column("", "as demonstrated", text=lambda c: percent(c.demonstrated_rate)),
            Column("loose_successes"),
            Column("loose_rate", "loose", text=lambda c: percent(c.loose_rate)),
            Column("excluded"),
            Column("failures", "failures", lambda c: failures(c, 99), failures, words=True),
        ),
    )
