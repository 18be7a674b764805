"""Small runs through the package, and the files that each run executes."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Run = Callable[[], Any]
COMPARE_SCRIPT = """
import json
import math, sys
import granular as gr
scene = gr.scenes.three_balls(gap=1e-4)
law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
str(gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2)))
print(json.dumps([getattr(one, "__file__", None) for name, one in sys.modules.items() if name.startswith("granular")]))
"""


def two_balls(gr: Any) -> Any:
    """Two balls that collide in free flight."""
    return gr.Scene([1.0, 0.5], [0.1, 0.1], [0.1], [1.0, 0.0])


def hard_collision(gr: Any) -> Run:
    """One collision of hard spheres."""
    scene = two_balls(gr)
    return lambda: gr.edmd.simulate(scene, gr.ConstantRestitution(0.8), t_end=0.3, engine="sorted").contacts


def isolated_contact(gr: Any) -> Run:
    """One isolated contact of soft spheres."""
    scene, law = two_balls(gr), gr.LinearDashpot(1e6, 10.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def own_law(gr: Any) -> Run:
    """One isolated contact under the law of docs/guide/your-own-law.md."""

    @dataclass(frozen=True)
    class Stiffening:
        k: float
        s: float
        gamma: float

        def force(self, xi: float, xi_dot: float, pair: Any) -> float:
            ratio = xi / self.s
            return self.k * xi * (1.0 + ratio * ratio) + self.gamma * xi_dot

    scene, law = two_balls(gr), Stiffening(5e7, 1e-3, 100.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def island(gr: Any) -> Run:
    """Three soft balls that touch at the same time."""
    scene, law = gr.Scene([1.0] * 3, [0.1] * 3, [0.1, 0.0], [1.0, 0.0, 0.0]), gr.LinearDashpot(1e6, 10.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def driven_contact(gr: Any) -> Run:
    """Soft ball that bounces on a shaken floor."""
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.1], [0.0, 0.0], 9.81, floor=gr.walls.Sine(1e-3, 20.0))
    law = gr.LinearDashpot(1e6, 10.0)
    return lambda: gr.md.simulate(scene, law, t_end=0.3, engine="plain").contacts


def comparison(gr: Any) -> Run:
    """Comparison of both engines on two balls, with the report as text."""
    scene, law = two_balls(gr), gr.LinearDashpot(1e6, 10.0)
    return lambda: str(gr.compare(scene, law=law))


SMALL_RUNS: dict[str, Callable[[Any], Run]] = {
    "a hard collision": hard_collision, "an isolated soft contact": isolated_contact, "an own law": own_law,
    "an island": island, "a driven soft contact": driven_contact, "compare of two balls": comparison}


def executed_files(prepare: Callable[[Any], Run], tree: Path) -> set[str]:
    """Files of the package below `tree` whose functions a run calls.

    A first run performs all imports and creates all tables.
    """
    import granular as gr

    run, called, package = prepare(gr), set(), str(tree / "granular") + "/"
    run()

    def note(frame: Any, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(package) and not code.co_name.startswith("<"):
            called.add(code.co_filename.removeprefix(package))

    sys.setprofile(note)
    try:
        run()
    finally:
        sys.setprofile(None)
    return called


def loaded_files(tree: Path) -> list[str]:
    """Files below `tree` that `compare` of three dashpot balls imports.

    Numba is disabled.
    """
    script = "import sys; sys.modules['numba'] = None\n" + COMPARE_SCRIPT
    shown = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True, cwd=tree)
    paths = [Path(one) for one in json.loads(shown.stdout.splitlines()[-1]) if one]
    return [path.relative_to(tree).as_posix() for path in paths if path.is_relative_to(tree)]
