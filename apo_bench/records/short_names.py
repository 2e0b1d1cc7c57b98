"""Everything that rows and the command line call by a short name, and where it is: names alone, nothing is imported.

Whoever needs the object behind a name asks `apo_bench.names.resolve`.
"""

from types import MappingProxyType

CORRECTORS = MappingProxyType(
    {
        "contact": "apo_bench.correction.contact.contact:contact",
        "contact-refuse": "apo_bench.correction.contact.contact:contact_refuse",
        "contact-drop": "apo_bench.correction.contact.contact:contact_drop",
        "contact-robust": "apo_bench.correction.robust.robust:contact_robust",
        "learned-set": "apo_bench.correction.learned.correctors:learned_set",
        "contact-fast": "apo_bench.correction.contact.contact:contact_fast",
        "paper": "apo_bench.correction.baselines.paper:paper",
        "paper-track": "apo_bench.correction.baselines.track:paper_track",
        "last-only": "apo_bench.correction.baselines.ablations:last_only",
        "minimal": "apo_bench.correction.baselines.ablations:minimal",
        "no-history": "apo_bench.correction.baselines.no_history:no_history",
        "no-disappeared": "apo_bench.correction.baselines.ablations:no_disappeared",
        "snap": "apo_bench.correction.baselines.snap:snap",
        "least-squares": "apo_bench.correction.baselines.least_squares:least_squares",
        "penalty": "apo_bench.correction.baselines.penalty:penalty",
    }
)
"""The correctors that need an observation and nothing else."""
CORRECTOR = "contact-robust"
"""The corrector where none is asked for."""
LOOKING = ("contact-robust",)
"""Correctors that can ask to see operations again."""
SIMULATED = MappingProxyType({"settle": "apo_bench.simulation.scene.settling:settle"})
"""Correctors that need a simulator; `correct` does not know them, a trial does."""
UNCORRECTED = ("oracle", "none", "by-heart")
"""Plans without a corrector: the truth, what was seen, the scenario's own goals where they fit best what was seen."""
METHODS = (*UNCORRECTED, *CORRECTORS, *SIMULATED)
"""What a robot can be told to do: a plan without a corrector, or by one."""
WRONG_RELATIONS = MappingProxyType(
    {
        "missed": "apo_bench.observation.relations:missed",
        "false": "apo_bench.observation.relations:false",
        "shifted": "apo_bench.observation.relations:Shifted",
    }
)
"""Wrong relations that a corrector is told."""
FOREIGN_ARMS = ("menagerie:", "robosuite:")
"""How the arms of other collections begin; what follows is looked up there, and never imported."""
FAILURES = ("flips", "stale", "swaps", "rays", "displaced-view")
"""Noise models in which a camera fails now and then: the covariance that is stated is that of what is no failure. Rates
may follow the name, as in `flips:p=0.1/r=0.5`."""
RESIDUALS = "empirical:"
"""Begins the name of a noise that draws from a file of residuals."""
