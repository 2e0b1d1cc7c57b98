"""Generated assemblies: a seed draws parts, contacts, order and grasps."""

from apo_bench.scenario.generated.families import FAMILIES
from apo_bench.scenario.generated.names import (
    generate_assembly,
    generated_file,
    is_generated,
    whole_name,
    write_generated,
)

__all__ = ("FAMILIES", "generate_assembly", "generated_file", "is_generated", "whole_name", "write_generated")
