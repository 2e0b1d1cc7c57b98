"""Scenes, hands, the arm, replays and pictures, by MuJoCo and mink.

How a plan is carried out, to be read in this order: `execution/controller.py` (`replay`, one step of the schedule after
the other), `execution/prepare.py` (a step becomes a `Transfer`: grips, lines, guards), `execution/carry_out.py` (one
operation, as motions of the tip; gripping and letting go are in `execution/fingers.py`, pressing into a hole and
searching for it in `execution/search.py`), `robot/robot.py` (a line of the tip becomes joint targets: `follow` calls
`_run`, that `_tick`, and there is `mj_step`, once for each target; a search steps in `servo_step`).
Hands that demonstrate: `human/demonstration.py`, `human/hands.py`.
"""

from apo_bench.mjcf.lazy_graphics import import_mujoco

import_mujoco()
