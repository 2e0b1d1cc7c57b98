"""Generated scenarios: a seed draws the parts, contacts, order and grasps of an assembly."""

from apo_bench.scenario.generated.families import FAMILIES
from apo_bench.scenario.generated.names import (
    complete_name,
    generate_assembly,
    is_generated,
    make_generated_file,
    write_generated,
)

__all__ = ("FAMILIES", "complete_name", "generate_assembly", "is_generated", "make_generated_file", "write_generated")
