"""Part files, and the solids with named faces that they describe."""

from apo_bench.scenario.parts.load import load_part, part_names, part_path
from apo_bench.scenario.parts.part_file import PartFile, read_part

__all__ = ["PartFile", "load_part", "part_names", "part_path", "read_part"]
