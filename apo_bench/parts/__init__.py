"""Part files become solids with named faces; needs no simulator."""

from apo_bench.parts.load import load_part, part_names, part_path

__all__ = ["load_part", "part_names", "part_path"]
