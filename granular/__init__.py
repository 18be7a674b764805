"""Balls on a line as hard spheres and as soft spheres: may these collisions be treated as instantaneous?
May be skipped: the public names, and where they stand.

>>> import granular as gr
>>> scene = gr.scenes.three_balls()
>>> law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
>>> report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))
>>> report.pairs[1].hard_contacts, report.pairs[1].soft_contacts
(1, 4)
"""

import sys
from typing import TYPE_CHECKING, Any

from granular import _moved, until
from granular._about import VERSION
from granular.rules import ConstantRestitution, TabulatedRestitution, ThorntonRestitution
from granular.scene import Pair, Scene
from granular.trajectory import Status, Trajectory

if TYPE_CHECKING:
    from granular import (
        adiabatic,
        balls,
        binary,
        cases,
        edmd,
        export,
        materials,
        md,
        measures,
        scenes,
        theory,
        walls,
        waves,
    )
    from granular.binary import restitution_of
    from granular.cases import Case
    from granular.comparison import Answer, Comparison, compare
    from granular.extremes import stability
    from granular.frontiers import frontier
    from granular.laws import Hertz, LinearDashpot, MatchedEnd, PowerLaw, TsujiHertz, ViscoelasticHertz, WaltonBraun
    from granular.sweeps import Sensitivity, ensemble, sensitivity, sweep
    from granular.thresholds import Threshold, threshold

load = Trajectory.load

__version__ = VERSION

__all__ = [
    "Answer", "Case", "Comparison", "ConstantRestitution", "Hertz", "LinearDashpot", "MatchedEnd", "Pair",
    "PowerLaw", "Scene", "Sensitivity", "Status", "TabulatedRestitution", "ThorntonRestitution", "Threshold",
    "Trajectory", "TsujiHertz", "ViscoelasticHertz", "WaltonBraun", "adiabatic", "balls", "binary", "cases",
    "compare", "edmd", "ensemble", "export", "frontier", "load", "materials", "md", "measures", "restitution_of",
    "scenes", "sensitivity", "stability", "sweep", "theory", "threshold", "until", "walls", "waves",
]

_HOMES = {
    "Answer": "comparison", "Case": "cases", "Comparison": "comparison", "compare": "comparison",
    "restitution_of": "binary", "frontier": "frontiers", "stability": "extremes", "sweep": "sweeps",
    "Sensitivity": "sweeps", "ensemble": "sweeps", "sensitivity": "sweeps",
    "Threshold": "thresholds", "threshold": "thresholds", "Hertz": "laws", "LinearDashpot": "laws",
    "MatchedEnd": "laws", "PowerLaw": "laws", "TsujiHertz": "laws", "ViscoelasticHertz": "laws", "WaltonBraun": "laws",
}
"""Where names stand that are no modules."""

__dir__ = __all__.copy
sys.meta_path.append(_moved.Moved())


def __getattr__(name: str) -> Any:
    """Load engines, laws and upper floors when they are first asked for: a run of one engine does not need the rest."""
    from importlib import import_module

    if name not in __all__:
        raise AttributeError(f"module 'granular' has no attribute {name!r}")
    module = import_module(f"granular.{_HOMES.get(name, name)}")
    return getattr(module, name) if name in _HOMES else module
