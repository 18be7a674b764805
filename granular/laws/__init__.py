"""Force laws of soft contacts; F ≥ 0 repels. The engine, never the law, clips F at zero and gates it on ξ > 0.
May be skipped: names of the package only.
"""

from granular.laws.contact_law import ForceLaw, LawWithMemory, PairLaw as PairLaw, resolve as resolve
from granular.laws.dashpot import LinearDashpot
from granular.laws.hertz import Hertz, TsujiHertz, ViscoelasticHertz
from granular.laws.springs import PowerLaw, WaltonBraun
from granular.laws.statics import MatchedEnd

__all__ = [
    "ForceLaw", "Hertz", "LawWithMemory", "LinearDashpot", "MatchedEnd", "PowerLaw", "TsujiHertz", "ViscoelasticHertz",
    "WaltonBraun",
]
