"""Static types of what `apo_bench` exports; `__init__.py` imports each name when it is first asked for."""

from apo_bench.assembly.correction_record import Correction as Correction
from apo_bench.assembly.demonstration import Demonstration as Demonstration
from apo_bench.assembly.demonstration import Layout as Layout
from apo_bench.assembly.observation import Observation as Observation
from apo_bench.assembly.plan import Plan as Plan
from apo_bench.assembly.reached import ReplayResult as ReplayResult
from apo_bench.assembly.topology import Assembly as Assembly
from apo_bench.benchmark.evaluation import evaluate as evaluate
from apo_bench.benchmark.rate_table import RateTable as RateTable
from apo_bench.benchmark.sweeps.grid import SweepConfig as SweepConfig
from apo_bench.benchmark.sweeps.sweep import run_sweep as run_sweep
from apo_bench.correction.batches import correct_many as correct_many
from apo_bench.correction.contact.contact import ContactCorrector as ContactCorrector
from apo_bench.correction.correctors import correct as correct
from apo_bench.correction.explanation import explain as explain
from apo_bench.envs.corrected import Corrected as Corrected
from apo_bench.envs.flatten import Flatten as Flatten
from apo_bench.errors import InputError as InputError
from apo_bench.formats.observation import read_observation as read_observation
from apo_bench.importers.from_python import check_scenario as check_scenario
from apo_bench.importers.from_python import import_assembly as import_assembly
from apo_bench.importers.from_python import import_part as import_part
from apo_bench.judging.verdict import Verdict as Verdict
from apo_bench.judging.verdict import judge as judge
from apo_bench.perception.detection.contacts import detect_contacts as detect_contacts
from apo_bench.perception.observation.observing import observe as observe
from apo_bench.records.settings import TrialConfig as TrialConfig
from apo_bench.records.thresholds import Criteria as Criteria
from apo_bench.scenario.file import load_scenario as load_scenario
from apo_bench.scenario.layout import draw_layout as draw_layout
from apo_bench.scenario.saving import save_scenario as save_scenario
from apo_bench.scenario.scenario import Scenario as Scenario
from apo_bench.simulation.arms.arm import Arm as Arm
from apo_bench.simulation.arms.building import read_arm as read_arm
from apo_bench.simulation.execution.controller import replay as replay
from apo_bench.simulation.human.demonstration import demonstrate as demonstrate
from apo_bench.simulation.scene.render import Film as Film
from apo_bench.simulation.scene.render import aim_camera as aim_camera
from apo_bench.simulation.scene.render import draw_picture as draw_picture
from apo_bench.simulation.scene.scene import Scene as Scene
from apo_bench.simulation.scene.scene import build_scene as build_scene
from apo_bench.simulation.scene.show import show_scenario as show_scenario
from apo_bench.trial.fitting import fit_plan as fit_plan
from apo_bench.trial.run import run_trial as run_trial

__version__: str
