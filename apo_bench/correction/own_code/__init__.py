"""Correctors of somebody's own, in a process that sees the observation and nothing else."""
