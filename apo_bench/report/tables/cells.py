"""Tables with one line per cell: success rates with their intervals, pairs of methods over the same seeds, gaps of the
contacts as seen and as planned, what robots felt about themselves."""

from collections.abc import Callable, Sequence

from apo_bench.records import TrialSettings, feels, knows_relations, knows_truth, may_look
from apo_bench.report.tables.table import (
    Column,
    Table,
    interval_columns,
    level_text,
    millimetres,
    place_columns,
    rate_columns,
)
from apo_bench.statistics import (
    Cell,
    FeltSummary,
    GapSummary,
    Paired,
    failures,
    percent,
    percents,
    points,
    share,
    signed,
)


def cell_table(cells: Sequence[Cell]) -> Table:
    """Axes that are as usual in every cell are left to files."""
    met: dict[str, Callable[[Cell], bool]] = {
        "noise": lambda c: not knows_truth(c.method),
        "relations": lambda c: knows_relations(c.method),
        "looks": lambda c: may_look(c.method),
        "robot_error": lambda c: True,
        "wrench": lambda c: feels(c.method),
        "stated_error": lambda c: feels(c.method),
        "abstain": lambda c: True,
    }

    abstains = any(c.abstain for c in cells)
    promises = any(c.promised is not None for c in cells)

    def axis(name: str, usual: str | float) -> Column:
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
            axis("wrench", TrialSettings.wrench),
            axis("stated_error", TrialSettings.stated_error),
            axis("abstain", 0.0),
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
            Column("abstained", "abstained" * abstains),
            Column(
                "wrong_when_executed", "wrong when executed" * abstains, text=lambda c: percent(c.wrong_when_executed)
            ),
            Column("promised", "promised" * promises, text=lambda c: percent(c.promised)),
            Column("brier"),
            Column("as_demonstrated", value=lambda c: c.demonstrated),
            Column("as_demonstrated_rate", value=lambda c: c.demonstrated_rate),
            Column("", "as demonstrated", text=lambda c: percent(c.demonstrated_rate)),
            Column("loose_successes"),
            Column("loose_rate", "loose", text=lambda c: percent(c.loose_rate)),
            Column("excluded"),
            Column("failures", "failures", lambda c: failures(c, 99), failures, words=True),
        ),
    )


def pair_table(pairs: Sequence[Paired]) -> Table:
    """One line per cell, method and reference."""
    return Table(
        pairs,
        (
            *place_columns(),
            Column("reference", "against", words=True),
            Column("", "level", text=level_text),
            Column("pairs", "pairs"),
            Column("only_method"),
            Column("only_reference"),
            Column(
                "",
                "right: both, it alone, other alone, neither",
                text=lambda p: f"{p.both}, {p.only_method}, {p.only_reference}, {p.neither}",
            ),
            Column("difference", "difference [points]", text=lambda p: points(p.difference, p.interval)),
            *interval_columns(lambda p: p.interval),
            Column("p_mcnemar", "p (adjusted)", lambda p: p.p, _p),
            Column("p_adjusted"),
            *rate_columns(
                lambda p: p.recovered,
                ("reference_failed", "recovered", "recovery_rate", "recovery_low_95", "recovery_high_95"),
            ),
            Column("", "recovered", text=lambda p: share(p.recovered)),
            *rate_columns(
                lambda p: p.harmed, ("reference_right", "harmed", "harm_rate", "harm_low_95", "harm_high_95")
            ),
            Column("", "harmed", text=lambda p: share(p.harmed)),
            Column("planned"),
            Column("free_difference_mm", "free error, difference [mm]", lambda p: p.free_mm, _free),
            *interval_columns(lambda p: p.free_interval, "free_low_95_mm", "free_high_95_mm"),
        ),
        "No method shares a cell with `none` or `paper`, with which methods are paired.",
        (
            "Over the same seeds: at how many of them both methods were right, one alone, or neither; the difference "
            "of their success rates in points with Tango's score interval for paired proportions; McNemar's exact "
            "p-value, and in brackets the same adjusted for all comparisons of the sweep (Holm); *recovered*, the "
            "share of the seeds at which the other failed that it mended; *harmed*, the share of the seeds at which "
            "the other was right that it spoilt; and the mean difference of the errors of their planned goals in "
            "directions that contacts leave free, over seeds at which both had a plan, with Student's t interval "
            "(intervals are of 95 %). Negative errors are smaller than the other's. With no discordant pair an "
            "interval still reaches 384 / (n + 3.84) points to both sides: below 3 from 125 on."
        ),
    )


def _p(p: Paired) -> str | None:
    both = [f"{x:.3f}" if x >= 0.001 else "< 0.001" for x in (p.p, p.p_adjusted) if x is not None]
    return "{} ({})".format(*both) if len(both) == 2 else None


def _free(p: Paired) -> str | None:
    if p.free_mm is None:
        return None
    ends = [signed(x, 3) for x in p.free_interval or ()]
    between = f" ({' to '.join(ends)})" if ends else ""
    return f"{signed(p.free_mm, 3)}{between}, n {p.planned}"


def gap_table(gaps: Sequence[GapSummary]) -> Table:
    """One line per cell."""
    return Table(
        gaps,
        (
            *place_columns(),
            Column("", "level", text=level_text),
            Column("trials", "n"),
            Column("seen_5", value=lambda g: g.seen.low),
            Column("seen_median_mm", "as seen [mm]", lambda g: g.seen.median, lambda g: millimetres(g.seen.median)),
            Column("seen_95", value=lambda g: g.seen.high),
            Column("planned_5", value=lambda g: g.planned.low),
            Column(
                "planned_median_mm",
                "as planned [mm]",
                lambda g: g.planned.median,
                lambda g: millimetres(g.planned.median),
            ),
            Column(
                "planned_95", "95 % are below [mm]", lambda g: g.planned.high, lambda g: millimetres(g.planned.high)
            ),
        ),
        note=(
            "The largest distance of any face from the one it should touch, as it was seen and as the method planned "
            "it: medians, and in the drawing bands from the 5th to the 95th percentile of the trials. What is below "
            "0.001 mm is drawn there. `none` plans what was seen."
        ),
    )


def felt_table(summaries: Sequence[FeltSummary]) -> Table:
    """One line per cell of a robot that feels."""

    def size(name: str, head: str, of: Callable[[FeltSummary], float | None]) -> Column:
        return Column(name, head, of, lambda s: None if (x := of(s)) is None else f"{x:.2f}")

    return Table(
        summaries,
        (
            *place_columns(),
            Column("", "level", text=level_text),
            Column("trials", "n"),
            Column("touches", "touches", text=lambda s: f"{s.touches:.1f}"),
            Column("refused", "refused"),
            size("drawn_mm", "drawn with [mm]", lambda s: s.drawn[0]),
            size("stated_mm", "stated [mm]", lambda s: s.told and s.told[0]),
            size("felt_mm", "felt [mm]", lambda s: s.felt_mm),
            size("sure_mm", "sure to [mm]", lambda s: s.sure_mm),
            size("drawn_deg", "drawn with [deg]", lambda s: s.drawn[1]),
            size("stated_deg", "stated [deg]", lambda s: s.told and s.told[1]),
            size("felt_deg", "felt [deg]", lambda s: s.felt_deg),
            size("sure_deg", "sure to [deg]", lambda s: s.sure_deg),
        ),
        "No robot felt.",
        (
            "How far the base of a robot that feels (`+feel`) is off at the middle of the goals: by what its error was "
            "drawn with, by what it was told, as it felt in the end, and how far that may be wrong, as it says itself. "
            "All are root mean squares of vectors: the square root of three times a standard deviation per axis. "
            "*Refused* are touches that contradicted the others, of all trials together."
        ),
    )
