"""How often plans with a score succeeded: of generated assemblies, by `python -m benchmarks.promise`.

Between two scores the rate is interpolated.
"""

SCORES = (
    0.0000,
    0.0026,
    0.1671,
    0.3096,
    0.5183,
    0.6742,
    0.7316,
    0.7447,
    0.7730,
    0.8098,
    0.8614,
    0.9081,
    0.9248,
    0.9440,
    0.9744,
)
RATES = (
    0.0185,
    0.0309,
    0.0962,
    0.2500,
    0.4038,
    0.5385,
    0.5962,
    0.7115,
    0.7308,
    0.8269,
    0.8654,
    0.9038,
    0.9423,
    0.9435,
    0.9538,
)
