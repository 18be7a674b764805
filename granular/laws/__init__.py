"""Force laws of soft contacts, restitution rules of hard spheres, closed forms.

A law returns the force F, where F ≥ 0 is repulsive. The engine clips F at zero and applies it only for overlaps ξ > 0.

Start with: `contact_law`, `dashpot`.
Support modules: `hertz`, `kinds`, `rules`, `springs`, `theory`, `viscoelastic_restitution`.
"""

from granular.laws.contact_law import ForceLaw, LawWithMemory, PairLaw as PairLaw, resolve as resolve
from granular.laws.dashpot import LinearDashpot
from granular.laws.hertz import Hertz, TsujiHertz, ViscoelasticHertz
from granular.laws.springs import MatchedEnd, PowerLaw, WaltonBraun

__all__ = [
    "ForceLaw", "Hertz", "LawWithMemory", "LinearDashpot", "MatchedEnd", "PowerLaw", "TsujiHertz", "ViscoelasticHertz",
    "WaltonBraun",
]
