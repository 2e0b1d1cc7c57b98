"""The topology of an assembly, and the goals that flow over it, in the words of the paper. No solver, no simulator."""

from __future__ import annotations

from apo_bench.moved import moved_names

_MOVED = ("Assembly", "Contact", "Gap", "ODL", "Operation", "PartFace", "Relation", "Term", "inverted", "product")
__getattr__ = moved_names(__name__, {name: f"topology.{name}" for name in (*_MOVED, "simplified", "spelled")})
