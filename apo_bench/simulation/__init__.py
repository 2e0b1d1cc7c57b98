"""Simulate demonstrations and replays with MuJoCo and mink: scenes, human hands, the arm, pictures.

The execution of a plan, in the order of reading:

- `execution/controller.py`: `replay`, the steps of the schedule one after the other.
- `execution/prepare.py`: a step becomes a `Transfer` (grips, lines, guards).
- `execution/carry_out.py`: one operation as motions of the tip. `execution/fingers.py` grips and releases,
  `execution/search.py` presses into a hole and searches for it.
- `robot/robot.py`: a line of the tip becomes joint targets. `follow` calls `_run`, that `_tick`, which calls `mj_step`
  for each target; a search steps in `servo_step`.

Hands that demonstrate: `human/demonstration.py`, `human/hands.py`.
"""

from apo_bench.mjcf.lazy_graphics import import_mujoco

import_mujoco()
