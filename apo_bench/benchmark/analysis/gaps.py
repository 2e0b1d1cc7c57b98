"""The largest gap of the contacts, as seen and as planned: percentiles over the trials of a cell."""

import numpy as np

from apo_bench.benchmark.analysis.line import Line
from apo_bench.benchmark.analysis.place import by_place
from apo_bench.benchmark.analysis.rates import Records
from apo_bench.records import uses_contacts
from apo_bench.records.run.trials import trials_of

_PERCENTILES = {"5": 5.0, "median_mm": 50.0, "95": 95.0}


def gaps(records: Records) -> list[Line]:
    """One line per cell of a method that corrects, of its trials that had a plan, sorted as `tally` sorts; [mm]."""
    trials = trials_of(records)
    known = ~np.isnan(trials.number("gap_before_mm")) & ~np.isnan(trials.number("gap_after_mm"))
    cells = by_place(trials.where(known & trials.holds("method", uses_contacts)))
    return [
        {
            "place": place,
            "trials": len(own),
            **{
                f"seen_{name}": float(np.percentile(own.number("gap_before_mm"), q)) for name, q in _PERCENTILES.items()
            },
            **{
                f"planned_{name}": float(np.percentile(own.number("gap_after_mm"), q))
                for name, q in _PERCENTILES.items()
            },
        }
        for place, own in cells.items()
    ]
