"""Write ``recorded.json``: scenes solved by an independent solver.

``python -m bench.stability.recorded`` takes two minutes. The scenes are drawn to resemble scenes that once failed, and
are solved by the solver of tests/helpers/fuzz in long doubles. The unit of a number is its scale times the condition
number of the scene. The condition number is the change of the result over the change of gaps, velocities and masses.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[2]))

import numpy as np

from bench.stability.line import COMPARED_FIELDS
from tests.helpers.fuzz.arithmetic import LONG
from tests.helpers.fuzz.judge import truth
from tests.helpers.fuzz.laws import Spec
from tests.helpers.fuzz.scenes import Case
from tests.helpers.fuzz.stored_truth import Truth

OUTPUT_PATH = Path(__file__).with_suffix(".json")
DRAWS_PER_KIND = 14
MAX_CONTACTS = 10
"""Maximum number of contacts of a scene."""


def chosen_cases() -> Iterator[tuple[str, Case]]:
    """Yield the scenes in which the defects were found."""
    yield "second contact inside an overlap", case([1.0] * 3, [-0.1, 0.0], [-0.2497, 0.0, -1.0],
                                                   [Spec("TsujiHertz", (1.0, 0.5))] * 2, 5.0)
    yield "own law", case([1.0] * 3, [0.4, 0.5], [0.7, -0.1, -0.7],
                          [Spec("WaltonBraun", (1.0, 2.0)), Spec("Hertz", (1.0,))])
    yield "reloading", case([1.0] * 3, [0.9, 0.3], [0.5, 0.0, -0.5], [Spec("WaltonBraun", (1.0, 4.0))] * 2)
    yield "simultaneous contacts", case([1.0] * 4, [0.06] * 3, np.linspace(1.0, -1.0, 4).tolist(), [
        Spec("TsujiHertz", (1.0, 0.1)), Spec("PowerLaw", (1.0, 2.0)), Spec("Hertz", (1.0,))], 30.0)
    yield "steep law", case([1.0] * 3, [0.3] * 2, [1.0, -0.1, -0.1], [Spec("PowerLaw", (1.0, 3.3))] * 2)


def case(mass: list[float], gap: list[float], velocity: list[float], laws: list[Spec],
         t_end: float | None = None) -> Case:
    """Case without gravity."""
    return Case(tuple(mass), tuple(gap), tuple(velocity), 0.0, tuple(laws), t_end)


def drawn_case(kind: str, seed: int) -> Case:
    """Random scene of a kind, with three to five balls that collide almost together."""
    rng = np.random.default_rng([SCENE_KINDS.index(kind), seed])
    n = int(rng.integers(3, 6))
    mass = [round(x, 2) for x in 10.0 ** rng.uniform(-0.5, 0.5, n)]
    if rng.random() < 0.3:
        mass[0] = math.inf
    gap = [round(x, 3) for x in rng.uniform(0.02, 0.6, n - 1)]
    velocity = [round(x, 2) for x in np.sort(rng.uniform(-1.0, 1.0, n))[::-1]]
    if kind == "simultaneous contacts":
        gap, velocity = [gap[0]] * (n - 1), np.linspace(1.0, -1.0, n).tolist()
        mass = [1.0] * n
    if mass[0] == math.inf:
        velocity[0] = 0.0
    if kind.startswith("second"):
        return pulled_apart(rng, mass, gap, velocity)
    return case(mass, gap, velocity, [law_of(kind, rng) for _ in gap])


def pulled_apart(rng: Any, mass: list[float], gap: list[float], velocity: list[float]) -> Case:
    """Case in which a clipped contact is pushed together again.

    The lowest pair overlaps and separates so fast that its force is clipped. The next ball then pushes the pair
    together.
    """
    k, alpha, overlap = 1.0, float(round(rng.uniform(0.3, 1.0), 2)), float(round(rng.uniform(0.05, 0.4), 2))
    m_eff = 1.0 / (1.0 / mass[0] + 1.0 / mass[1])
    bare = k * overlap**1.25 / (alpha * math.sqrt(m_eff * k))
    velocity[0] = 0.0 if mass[0] == math.inf else velocity[0]
    velocity[1] = velocity[0] + bare * float(rng.uniform(1.1, 3.0))
    velocity[2:] = [velocity[1] - 1.0 - i for i in range(len(velocity) - 2)]
    gap[0], gap[1] = -overlap, float(rng.choice([0.0, 0.02, 0.05]))
    return case(mass, gap, velocity, [Spec("TsujiHertz", (k, alpha))] * len(gap))


def law_of(kind: str, rng: Any) -> Spec:
    """Law of contacts that last about a second."""
    k, zeta = float(round(10.0 ** rng.uniform(-0.5, 1.0), 2)), float(round(rng.uniform(0.02, 0.5), 2))
    p = float(rng.choice([1.25, 2.2, 2.7, 3.3, 4.1, 4.5, 6.0]))
    if kind == "reloading":
        return Spec("WaltonBraun", (k, k * float(round(rng.uniform(1.2, 6.0), 1))))
    if kind == "steep law":
        return Spec(str(rng.choice(["PowerLaw", "PlainPower"])), (k, p))
    if kind == "kinked law":
        if rng.random() < 0.5:
            return Spec("TwoStiffnesses", (k, k * float(round(10.0 ** rng.uniform(-1.0, 1.0), 2)), 0.1))
        return Spec("TwoDampings", (k, zeta, 3.0 * zeta))
    own = [Spec("PlainHertz", (k,)), Spec("PlainPower", (k, min(p, 3.3))), Spec("PlainDashpot", (k, zeta)),
           Spec("PlainViscoelastic", (k, zeta))]
    built_in = [Spec("TsujiHertz", (k, zeta)), Spec("Hertz", (k,)), Spec("PowerLaw", (k, 4.0 / 3.0)),
                Spec("LinearDashpot", (k, zeta)), Spec("WaltonBraun", (k, 2.0 * k))]
    some = own if kind == "own law" else built_in[:4] if kind == "simultaneous contacts" else own + built_in
    return some[int(rng.integers(len(some)))]


SCENE_KINDS = ["second contact inside an overlap", "own law", "own laws beside built-in ones", "reloading",
               "simultaneous contacts", "steep law", "kinked law"]


def is_suitable(kind: str, one: Truth | None) -> bool:
    """Whether a drawn scene is well conditioned, finished and of its kind.

    Scenes with contacts at rounding speed are rejected.
    """
    if one is None or one.status != "quiet" or len(one.pairs) > MAX_CONTACTS or one.condition > 300.0:
        return False
    closing, parting = one.numbers["v_in"] @ [1.0, -1.0], one.numbers["v_out"] @ [-1.0, 1.0]
    if min(abs(closing).min(), abs(parting).min()) < 1e-4:
        return False
    second = (closing < 0.0) & (one.numbers["t_begin"] > 0.0)
    return bool(second.any()) if kind.startswith("second") else len(one.pairs) > 2


def entry(kind: str, one: Case) -> dict[str, Any]:
    """Entry of the file for one case."""
    exact = truth(one, LONG)
    assert exact is not None
    unit = {}
    for name in ("velocity", *COMPARED_FIELDS):
        allowed = np.fmax(exact.scale[name] * max(1.0, exact.condition), exact.response[name])
        unit["final" if name == "velocity" else name] = float(f"{np.max(allowed):.3g}")
    return {
        "kind": kind, "mass": [None if m == math.inf else m for m in one.mass], "gap": list(one.gap),
        "velocity": list(one.velocity), "laws": [[law.name, *law.numbers] for law in one.laws], "t_end": one.t_end,
        "unit": unit, "final": exact.numbers["velocity"][-1].tolist(), "pair": exact.pairs,
        **{name: exact.numbers[name].ravel().tolist() for name in COMPARED_FIELDS},
    }


def main() -> None:
    """Solve all scenes and write the file."""
    entries = [entry(kind, one) for kind, one in chosen_cases()]
    for kind in SCENE_KINDS:
        made = seed = 0
        while made < DRAWS_PER_KIND:
            one, seed = drawn_case(kind, seed), seed + 1
            if is_suitable(kind, truth(one)):
                entries.append(entry(kind, one))
                made += 1
                print(kind, seed, flush=True)
    lines = ",\n".join(json.dumps(one, allow_nan=False) for one in entries)
    OUTPUT_PATH.write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
