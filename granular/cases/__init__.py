"""Cases: a scene with its law, rule and stop condition, by name or from a TOML file.
May be skipped: names of the package only.
"""

from granular.cases.case import Case
from granular.cases.ready import about, make, names, options
from granular.cases.toml import dumps, load, loads, save

__all__ = ["Case", "about", "dumps", "load", "loads", "make", "names", "options", "save"]
