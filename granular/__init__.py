"""Balls on a line as hard spheres and as soft spheres: may these collisions be treated as instantaneous?
May be skipped: the public names, and where they stand.

>>> import granular as gr
>>> scene = gr.scenes.three_balls()
>>> law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
>>> report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))
>>> report.pairs[1].hard_contacts, report.pairs[1].soft_contacts
(1, 4)
"""

from typing import TYPE_CHECKING

from granular._engine.about import VERSION
from granular._engine.lazy import attributes

if TYPE_CHECKING:
    from granular import cases, edmd, md
    from granular.cases import balls, materials, scenes
    from granular.cases.case import Case
    from granular.comparison import measures
    from granular.comparison.answer import Answer
    from granular.comparison.run import Comparison, compare
    from granular.laws import (
        Hertz,
        LinearDashpot,
        MatchedEnd,
        PowerLaw,
        TsujiHertz,
        ViscoelasticHertz,
        WaltonBraun,
        theory,
    )
    from granular.laws.rules import ConstantRestitution, TabulatedRestitution, ThorntonRestitution
    from granular.md import binary, waves
    from granular.md.binary import restitution_of
    from granular.run import export, until
    from granular.run.trajectory import Status, Trajectory, load
    from granular.scene import Pair, Scene, walls
    from granular.studies import adiabatic
    from granular.studies.extremes import stability
    from granular.studies.frontiers.run import frontier
    from granular.studies.sweeps.ensembles import ensemble
    from granular.studies.sweeps.gradients import Sensitivity
    from granular.studies.sweeps.run import sweep
    from granular.studies.sweeps.sensitivities import sensitivity
    from granular.studies.thresholds.result import Threshold
    from granular.studies.thresholds.run import threshold

__version__ = VERSION
__all__ = [
    "Answer", "Case", "Comparison", "ConstantRestitution", "Hertz", "LinearDashpot", "MatchedEnd", "Pair",
    "PowerLaw", "Scene", "Sensitivity", "Status", "TabulatedRestitution", "ThorntonRestitution", "Threshold",
    "Trajectory", "TsujiHertz", "ViscoelasticHertz", "WaltonBraun", "adiabatic", "balls", "binary",
    "cases", "compare", "edmd", "ensemble", "export", "frontier", "load", "materials", "md", "measures",
    "restitution_of", "scenes", "sensitivity", "stability", "sweep", "theory", "threshold", "until", "walls", "waves",
]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.studies.adiabatic": "adiabatic",
    "granular.cases.balls": "balls",
    "granular.md.binary": "binary restitution_of",
    "granular.cases": "cases",
    "granular.cases.case": "Case",
    "granular.comparison.answer": "Answer",
    "granular.comparison.run": "Comparison compare",
    "granular.edmd": "edmd",
    "granular.run.export": "export",
    "granular.studies.extremes": "stability",
    "granular.studies.frontiers.run": "frontier",
    "granular.laws": "Hertz LinearDashpot MatchedEnd PowerLaw TsujiHertz ViscoelasticHertz WaltonBraun",
    "granular.cases.materials": "materials",
    "granular.md": "md",
    "granular.comparison.measures": "measures",
    "granular.laws.rules": "ConstantRestitution TabulatedRestitution ThorntonRestitution",
    "granular.scene": "Pair Scene",
    "granular.cases.scenes": "scenes",
    "granular.studies.sweeps.ensembles": "ensemble",
    "granular.studies.sweeps.gradients": "Sensitivity",
    "granular.studies.sweeps.run": "sweep",
    "granular.studies.sweeps.sensitivities": "sensitivity",
    "granular.laws.theory": "theory",
    "granular.studies.thresholds.result": "Threshold",
    "granular.studies.thresholds.run": "threshold",
    "granular.run.trajectory": "Status Trajectory load",
    "granular.run.until": "until",
    "granular.scene.walls": "walls",
    "granular.md.waves": "waves",
})
