"""Collisions of balls on a line, simulated and compared as hard and soft spheres.

`compare` runs a `Scene` with both models: hard spheres collide instantaneously (`edmd.simulate`), and soft spheres
exert a contact force (`md.simulate`). `threshold`, `sweep`, `ensemble` and `sensitivity` study parameters of a scene.
All quantities are in SI units, and upwards is positive.

>>> import granular as gr
>>> scene = gr.scenes.three_balls(gap=1e-2)
>>> law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
>>> print(gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2)).verdict)
Yes: every contact is binary (certified), and outcomes agree within 0.2 % of the fastest impact.

Start with: `scene/`, `laws/`, `run/`, `_engine/`, `edmd/`, `md/`, `comparison/`.
Support modules: `app/`, `cases/`, `studies/`.
"""

from typing import TYPE_CHECKING

from granular._engine.package import CROSS_ROOM_LOADERS, VERSION, attributes

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
    from granular.run.recordings import read_recording
    from granular.run.trajectory import Status, Trajectory, load
    from granular.scene import Pair, Scene, walls
    from granular.studies import adiabatic, contacts
    from granular.studies.calibration import calibrate
    from granular.studies.extremes import stability
    from granular.studies.frontiers import frontier
    from granular.studies.sweeps.ensembles import ensemble
    from granular.studies.sweeps.run import sweep
    from granular.studies.sweeps.sensitivities import sensitivity
    from granular.studies.sweeps.sensitivity_report import Sensitivity
    from granular.studies.threshold_result import Threshold
    from granular.studies.thresholds import threshold

__version__ = VERSION
__all__ = [
    "Answer", "Case", "Comparison", "ConstantRestitution", "Hertz", "LinearDashpot", "MatchedEnd", "Pair",
    "PowerLaw", "Scene", "Sensitivity", "Status", "TabulatedRestitution", "ThorntonRestitution", "Threshold",
    "Trajectory", "TsujiHertz", "ViscoelasticHertz", "WaltonBraun", "adiabatic", "balls", "binary", "calibrate",
    "cases", "compare", "contacts", "edmd", "ensemble", "export", "frontier", "load", "materials", "md", "measures",
    "read_recording", "restitution_of", "scenes", "sensitivity", "stability", "sweep", "theory", "threshold",
    "until", "walls", "waves",
]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.studies.adiabatic": "adiabatic",
    "granular.cases.balls": "balls",
    "granular.studies.calibration": "calibrate",
    "granular.md.binary": "binary restitution_of",
    "granular.cases": "cases",
    "granular.cases.case": "Case",
    "granular.comparison.answer": "Answer",
    "granular.comparison.run": "Comparison compare",
    "granular.studies.contacts": "contacts",
    "granular.edmd": "edmd",
    "granular.run.export": "export",
    "granular.studies.extremes": "stability",
    "granular.studies.frontiers": "frontier",
    "granular.laws": "Hertz LinearDashpot MatchedEnd PowerLaw TsujiHertz ViscoelasticHertz WaltonBraun",
    "granular.cases.materials": "materials",
    "granular.md": "md",
    "granular.comparison.measures": "measures",
    "granular.laws.rules": "ConstantRestitution TabulatedRestitution ThorntonRestitution",
    "granular.scene": "Pair Scene",
    "granular.cases.scenes": "scenes",
    "granular.studies.sweeps.ensembles": "ensemble",
    "granular.studies.sweeps.sensitivity_report": "Sensitivity",
    "granular.studies.sweeps.run": "sweep",
    "granular.studies.sweeps.sensitivities": "sensitivity",
    "granular.laws.theory": "theory",
    "granular.studies.threshold_result": "Threshold",
    "granular.studies.thresholds": "threshold",
    "granular.run.recordings": "read_recording",
    "granular.run.trajectory": "Status Trajectory load",
    "granular.run.until": "until",
    "granular.scene.walls": "walls",
    "granular.md.waves": "waves",
})
_load_isolation = attributes(__name__, {"granular.md.isolation": "Durations"})
CROSS_ROOM_LOADERS["contact_durations"] = lambda: _load_isolation("Durations")
