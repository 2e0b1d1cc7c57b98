"""Correction of an observation by its face contacts. Knows no simulator and never meets the truth.

"The paper", and every number of an equation or section without another source, is T. Suehiro and K. Ikeuchi, "Towards
an Assembly Plan from Observation: Fine localization based on face contact constraints". `apo_bench.assembly.equations`
writes its contact equations out, `solvers.newton` its solver.

What one correction by `contact` calls, in the folder `contact` unless another is named:

    correctors.correct                      the public call: checks, and projects round faces to planes
      contact.ContactCorrector.together     many at once; alone what is large, or states tails or shared errors
        contact._correct
          problem.problem_of                contacts become equations (solvers.projected_contacts), noise becomes L
          solved.solve                      the nearest poses with rank, covariance and test
            solvers.gauss_newton._nearest   the loop; each iteration linearises the equations, then takes the shortest z
                                            on them (solvers.linear_step, solvers.sparse)
            squared_length.chi_squares      the squared length of the correction
            solved._describe                gaps, rank and covariance (solvers.posterior)
            solved._describe_in_full        instead, where contacts contradict each other, or with inequalities, play or
                                            tails; squared_length.relaxed_chi_square runs the loop again
          contact._report                   the Correction, if nothing is doubtful; otherwise
          contact._in_doubt                 not converged, the test fails, a pose turned far, faces look the same way
            starts.best_start               other starts, each solved as above; none if only the test has failed
            suspects.suspects               each relation left out in turn, if the test fails; `drop` then leaves it out
            contact._report                 the Correction
            checks.status.check_facing      `inconsistent` where faces look the same way

`solvers` solves equations; `checks` validates and tests corrections. `baselines` holds the correctors that `contact` is
compared with (`paper` is the method as it was published). `robust` is the corrector that rejects outliers, and
`calibration` estimates the errors of the robot from contact probing. The files outside these folders are the public
calls.
"""
