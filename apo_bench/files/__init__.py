"""The file forms of demonstrations, observations and plans."""

from __future__ import annotations

from apo_bench.moved import moved_names

_MOVED = ("demonstration_form", "observation_form", "plan_form", "read_demonstration", "read_plan", "write_form")
__getattr__ = moved_names(
    __name__,
    {name: f"json_forms.{name}" for name in _MOVED} | {"read_observation": "json_forms.read_json_observation"},
)
