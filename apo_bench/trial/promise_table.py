"""How often plans with a score succeeded: of generated assemblies, by `python -m benchmarks.promise`.

Between two scores the rate is interpolated.
"""

SCORES = (0.0, 1.0)
RATES = (0.0, 1.0)
