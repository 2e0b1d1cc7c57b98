"""What `run.json` and a line of `timing.jsonl` may say, checked when read and written; rows are in `row`."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any

from msgspec import Meta

from apo_bench.records.key import KEY
from apo_bench.records.row import ROW_FIELDS
from apo_bench.records.settings import Name

_Text = Annotated[str, Meta(max_length=100_000)]
_Plain = None | bool | int | float | _Text
_Listed = list[_Plain | list[_Plain]]
_Inner = _Plain | _Listed | dict[Name, _Plain | _Listed]
Said = _Plain | list[_Plain | list[_Plain] | dict[Name, _Inner]] | dict[Name, _Inner]
"""Any value of `run.json`: no deeper than one that a sweep writes."""
_Texts = dict[Name, _Text]
_Limits = dict[Name, Annotated[float, Meta(gt=0.0, le=1e9)] | None]
"""Wall times [s]; null where there was no limit."""
RUN_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        "schema": Name,
        "grids": list[dict[Name, _Inner]],
        "files": _Texts,
        "content": _Texts,
        "versions": _Texts,
        "python": _Text,
        "platform": _Text,
        "command": _Text,
        "salt": _Text,
        "limits": _Limits,
        "code": _Texts,
    }
)
"""Of `run.json`: all may be missing, and what else stands there is shown as it is."""
_Seconds = Annotated[float, Meta(ge=0.0, le=1e9)]
TIMING_FIELDS: Mapping[str, Any] = MappingProxyType(
    {
        **{name: ROW_FIELDS[name] for name in KEY},
        "compile_s": _Seconds,
        "demonstrate_s": _Seconds,
        "trial_s": _Seconds,
        "host": Name,
        "worker": int | Name,
    }
)
"""Of a line of `timing.jsonl`."""
