"""Pictures, tables and JSON objects of plans, corrections, robots and noise models."""
