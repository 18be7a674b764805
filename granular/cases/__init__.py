"""Ready-made scenes, materials and balls, and complete cases from TOML files.

A case is a scene with its force law, collision rule and stop condition. `make` returns a ready-made case, and `load`
reads a case from a file.

Support modules: `balls`, `build`, `case`, `materials`, `ready`, `scenes/`, `toml`.
"""

from typing import TYPE_CHECKING

from granular._engine.package import attributes

if TYPE_CHECKING:
    from granular.cases.case import Case
    from granular.cases.ready import about, make, names, options
    from granular.cases.toml import dumps, load, loads, save

__all__ = ["Case", "about", "dumps", "load", "loads", "make", "names", "options", "save"]
__dir__ = __all__.copy
__getattr__ = attributes(__name__, {
    "granular.cases.case": "Case",
    "granular.cases.ready": "about make names options",
    "granular.cases.toml": "dumps load loads save",
})
