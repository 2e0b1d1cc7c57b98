"""Read part files into solids with named faces."""

from apo_bench.scenario.parts.load import find_part_path, list_part_names, load_part
from apo_bench.scenario.parts.part_file import PartFile, read_part

__all__ = ["PartFile", "find_part_path", "list_part_names", "load_part", "read_part"]
