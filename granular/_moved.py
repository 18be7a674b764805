"""What is loaded when it is first asked for; modules under the names that they had before, found for one release.
May be skipped: no physics.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

NOW = {
    "workprecision": "frontiers", "components": "outcome", "other_ties": "end_time", "tie_rules": "end_time",
    "laws.power": "laws.springs", "laws.walton_braun": "laws.springs", "laws.matched_end": "laws.statics",
    "laws.check": "laws.kinds", "thresholds.criteria": "thresholds.result", "comparison.restitution": "binary",
    "md.stability": "md.time_step",
    "walls.sine": "walls.formulas", "walls.piecewise": "walls.formulas", "waves.space_time": "waves.sensors",
}
"""Where a module of `granular` has gone; one within a room is named with a dot, such as "laws.power"."""


def attribute(room: str, homes: Mapping[str, str], name: str) -> Any:
    """Return a name of a room from the module there that is its home; or a module, as the attribute that it was when
    rooms loaded all that they hold."""
    if name in homes:
        return getattr(import_module(f"granular.{room}.{homes[name]}"), name)
    if not name.startswith("_"):
        with suppress(ModuleNotFoundError):
            return import_module(f"granular.{room}.{name}")
    raise AttributeError(f"module 'granular.{room}' has no attribute {name!r}")


class Moved(MetaPathFinder, Loader):
    """Finds the modules of `NOW` under their old names."""

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Know the old names; the import system asks here last."""
        return ModuleSpec(name, self) if name.startswith("granular.") and name[9:] in NOW else None

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of today in its place."""
        now = f"granular.{NOW[module.__name__[9:]]}"
        warnings.warn(f"{module.__name__} is now {now}; the old name goes with the next release.",
                      DeprecationWarning, stacklevel=2)
        sys.modules[module.__name__] = import_module(now)
