"""Table of success rates of plans by score, from generated assemblies; rates between two scores are interpolated.

`python -m benchmarks.predicted_success` writes this file.
"""

SCORES = (
    0.0001,
    0.0448,
    0.2593,
    0.4986,
    0.6592,
    0.7054,
    0.7624,
    0.7967,
    0.8467,
    0.8970,
    0.9133,
    0.9271,
    0.9454,
    0.9550,
    0.9709,
    0.9772,
)
RATES = (
    0.0185,
    0.0926,
    0.3148,
    0.3519,
    0.5370,
    0.7222,
    0.7407,
    0.7593,
    0.7778,
    0.8704,
    0.9074,
    0.9321,
    0.9502,
    0.9551,
    0.9808,
    0.9808,
)
