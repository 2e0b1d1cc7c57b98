"""What a trial is asked for and what its row says: shared by all that makes rows and all that reads them.

Other rooms import from here; the folder of a sweep is in `run`.
"""

from apo_bench.records.limits import CORRECTOR_LIMIT_S, USUAL_LIMITS, Limits
from apo_bench.records.method import is_own, knows_relations, knows_truth, may_look, parsed, with_simulated
from apo_bench.records.outcomes import STAGES, sentence
from apo_bench.records.relations import GIVEN, RECOGNISED, SHIFT_MM, WRONG, relations_name
from apo_bench.records.robot_error import NO_ROBOT_ERROR, checked_robot_error, robot_sigmas
from apo_bench.records.row import (
    LONGEST_SENTENCE,
    REQUIRED,
    ROW_FIELDS,
    FreedSet,
    MovedInHand,
    Predicted,
    Row,
    finite,
    look_up,
)
from apo_bench.records.salt import Salt, check_same_salt, one_salt, read_salt, salt_of_sweep, with_salt
from apo_bench.records.setting_columns import KEY, Key, in_python, row_key, setting_columns, settings_of, trial_key
from apo_bench.records.setting_info import SettingInfo
from apo_bench.records.settings import (
    ENV_ID,
    LEVEL,
    RANGE,
    ROW,
    SETTINGS,
    USUAL,
    Name,
    TrialSettings,
    check,
    check_together,
    level_pair,
    refuse_noise,
)
from apo_bench.records.short_names import (
    CORRECTOR,
    CORRECTORS,
    FOREIGN_ARMS,
    METHODS,
    RESIDUALS,
    SIMULATED,
    UNCORRECTED,
    WRONG_RELATIONS,
)
from apo_bench.records.thresholds import MEANINGS, Criteria, Meaning, Thresholds

__all__ = (
    "CORRECTOR",
    "CORRECTORS",
    "CORRECTOR_LIMIT_S",
    "ENV_ID",
    "FOREIGN_ARMS",
    "GIVEN",
    "KEY",
    "LEVEL",
    "LONGEST_SENTENCE",
    "MEANINGS",
    "METHODS",
    "NO_ROBOT_ERROR",
    "RANGE",
    "RECOGNISED",
    "REQUIRED",
    "RESIDUALS",
    "ROW",
    "ROW_FIELDS",
    "SETTINGS",
    "SHIFT_MM",
    "SIMULATED",
    "STAGES",
    "UNCORRECTED",
    "USUAL",
    "USUAL_LIMITS",
    "WRONG",
    "WRONG_RELATIONS",
    "Criteria",
    "FreedSet",
    "Key",
    "Limits",
    "Meaning",
    "MovedInHand",
    "Name",
    "Predicted",
    "Row",
    "Salt",
    "SettingInfo",
    "Thresholds",
    "TrialSettings",
    "check",
    "check_same_salt",
    "check_together",
    "checked_robot_error",
    "finite",
    "in_python",
    "is_own",
    "knows_relations",
    "knows_truth",
    "level_pair",
    "look_up",
    "may_look",
    "one_salt",
    "parsed",
    "read_salt",
    "refuse_noise",
    "relations_name",
    "robot_sigmas",
    "row_key",
    "salt_of_sweep",
    "sentence",
    "setting_columns",
    "settings_of",
    "trial_key",
    "with_salt",
    "with_simulated",
)
