"""The file forms of demonstrations, observations and plans."""

from __future__ import annotations

from apo_bench.moved import moved_names

__getattr__ = moved_names(
    __name__,
    {name: f"json_forms.{name}" for name in ("demonstration_form", "observation_form", "plan_form", "write_form")}
    | {name: f"json_reading.{name}" for name in ("read_demonstration", "read_plan")}
    | {"read_observation": "json_reading.read_json_observation"},
)
