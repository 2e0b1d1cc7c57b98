"""What `python benchmarks/corrector.py` measures, one idea per file."""
