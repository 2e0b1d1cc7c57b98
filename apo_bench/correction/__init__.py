"""Correction of an observation by its face contacts. Knows no simulator and never meets the truth.

How one round of `contact` works, in the order of its calls:

1. `contact.ContactCorrector.together`: what is done with an observation, and with what is in doubt.
2. `problem.problem_of`: contacts become equations (`solvers/laid.py`, `solvers/compact.py`), noise becomes L.
3. `solvers/gauss_newton.py`, `_nearest`: the loop. Each turn is one step of `solvers/linear_step.py`: linearise the
   equations (Eq. 14), then the shortest z on them; `solvers/kernels.py` does the same in loops for a compiler.
4. `solved.solve`: what the nearest goals leave open, their rank and covariance (`solvers/posterior.py`), and the test.
5. `contact._report`; or `starts.best_start` and `suspects.suspects`, if the test fails or a goal has turned far.

`correctors.correct` is the door for all correctors, `baselines` what `contact` is compared with (`paper` is the method
as it was published), `robust` the one that doubts observations, `own_code` the processes of correctors of one's own.
"""
