"""A tracker's log becomes an observation: formats, frames, rests, operations."""
