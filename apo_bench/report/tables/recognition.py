"""Precision and recall of recognised contacts over the noise."""

from collections.abc import Sequence

from apo_bench.report.tables.saying import percents, rate_columns
from apo_bench.report.tables.table import Column, Table
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.recognition import Recognition

RECOGNITION_NOTE = (
    "Contacts that were recognised, against those of the scenario: how many demonstrations had all right and none too "
    "many; how many of the recognised contacts are right (precision), and of the right ones were recognised (recall)."
)
NONE = "No method was told relations that were recognised."


def recognition_table(found: Sequence[Recognition]) -> Table:
    """One line per place."""
    return Table(found, _COLUMNS, NONE)


def _axis(name: str, called: str = "") -> Column:
    return Column(called or name, value=lambda r: getattr(r.place, name))


def _level(r: Recognition) -> str:
    return level_label(r.place.level, r.place.level_deg, r.place.noise)


def _noise(r: Recognition) -> str:
    return r.place.noise if r.place.eye == "noise" else r.place.eye


def _percent(x: float | None) -> str | None:
    return None if x is None else f"{100 * x:.2f} %"


_COLUMNS = (
    _axis("scenario")._replace(head="scenario", words=True),
    _axis("noise")._replace(head="noise", text=_noise, words=True),
    _axis("eye"),
    _axis("relations")._replace(head="relations", words=True),
    _axis("careless")._replace(head="careless", words=True),
    _axis("level", "level_mm")._replace(head="level", text=_level),
    _axis("level_deg"),
    Column("demonstrations"),
    Column("complete", "all right", text=lambda r: f"{r.complete} of {r.demonstrations}"),
    *rate_columns(lambda r: r.all_right, ("", "", "rate", "low_95", "high_95")),
    Column("", "95 % interval", text=lambda r: percents(r.all_right.interval)),
    Column("right"),
    Column("missed"),
    Column("false"),
    Column("precision", "precision", text=lambda r: _percent(r.precision)),
    Column("recall", "recall", text=lambda r: _percent(r.recall)),
    Column("", "missed", text=lambda r: r.missed),
    Column("", "false", text=lambda r: r.false),
)
