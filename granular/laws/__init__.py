"""Force laws of soft contacts; F ≥ 0 repels. The engine, never the law, clips F at zero and gates it on ξ > 0.
May be skipped: names of the package only.
"""

from functools import partial
from typing import TYPE_CHECKING

from granular._moved import attribute
from granular.laws.contact_law import ForceLaw, LawWithMemory, PairLaw as PairLaw, resolve as resolve

if TYPE_CHECKING:
    from granular.laws.dashpot import LinearDashpot
    from granular.laws.hertz import Hertz, TsujiHertz, ViscoelasticHertz
    from granular.laws.springs import PowerLaw, WaltonBraun
    from granular.laws.statics import MatchedEnd

__all__ = [
    "ForceLaw", "Hertz", "LawWithMemory", "LinearDashpot", "MatchedEnd", "PowerLaw", "TsujiHertz", "ViscoelasticHertz",
    "WaltonBraun",
]
__dir__ = __all__.copy
_HOMES = {
    "Hertz": "hertz", "LinearDashpot": "dashpot", "MatchedEnd": "statics", "PowerLaw": "springs", "TsujiHertz": "hertz",
    "ViscoelasticHertz": "hertz", "WaltonBraun": "springs",
}
"""Laws, which are loaded when they are first asked for."""
__getattr__ = partial(attribute, "laws", _HOMES)
