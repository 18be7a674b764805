"""Derivatives of outcomes at random scenes by solvers of many digits, and what `gr.sensitivity` says of them.

Soft spheres are judged by `bench.reference`, hard ones by a solver of a page: central differences at
2⁻³⁰ of the parameter. What the solvers have in common with the package is the scene as given, no more.
"""

import json
import math
from itertools import product
from pathlib import Path

import mpmath as mp
import numpy as np

import granular as gr
from bench.reference import taylor
from granular.laws.contact_law import resolve
from granular.scene.places import speed_scale, with_fitted_walls
from granular.studies.sweeps.plan import make_plan
from tests.helpers.own_laws import OwnDashpot
from tests.helpers.scenes_to_judge import KINDS, end_of, laws_of, scene_of

STEP, DIGITS, MOST = 2.0**-30, 20, 6
mp.mp.dps = 40
TRUTHS = Path(__file__).parents[1] / "reference" / "slopes.jsonl"


def question(kind, seed, end=None):
    """A case of a number, whether hard spheres are asked, and more random numbers; its end, if that is known."""
    rng = np.random.default_rng([KINDS.index(kind), seed, 31])
    scene, span = scene_of(kind, rng)
    law = laws_of(rng, scene)
    hard = seed % 3 == 2 and kind not in ("sine", "piecewise", "pendula", "thermal", "resting", "touching", "ring")
    rule = gr.ConstantRestitution(float(rng.uniform(0.5, 1.0)))
    if end is not None:
        return gr.Case(scene, law, rule, t_end=end), hard, rng
    end = end_of(rng, scene, law, rule, span)
    run = gr.edmd.simulate(scene, rule, t_end=end) if hard else gr.md.simulate(scene, law, t_end=end)
    if len(run.contacts) > MOST:
        end = float(0.5 * (run.contacts["t_begin"][MOST - 1] + run.contacts["t_begin"][MOST]))
    return gr.Case(scene, law, rule, t_end=end), hard, rng


def hard_speeds(case):
    """Velocities of hard spheres at the end, in 40 digits, and the order of their collisions."""
    many = mp.MPContext()
    many.dps = 40
    scene, eps = case.scene, many.mpf(case.rule.restitution)
    n, wall = scene.n, scene.is_wall
    v, gap = [many.mpf(x) for x in scene.velocity.tolist()], [many.mpf(x) for x in scene.gap.tolist()]
    light = [many.zero if wall[i] else 1 / many.mpf(float(scene.mass[i])) for i in range(n)]
    fall = [many.zero if wall[i] else -many.mpf(scene.gravity) for i in range(n)]
    left, order = many.mpf(case.t_end), []
    while True:
        soonest, hit = left, None
        for c in range(n - 1):
            u, a = v[c + 1] - v[c], fall[c + 1] - fall[c]
            square = u * u - 2 * a * gap[c]
            if a == 0:
                t = -gap[c] / u if u < 0 else many.inf
            elif square < 0:
                continue
            elif gap[c] == 0:
                t = many.zero if u < 0 else (-2 * u / a if a < 0 else many.inf)
            else:
                roots = [(-u - s * many.sqrt(square)) / a for s in (-1, 1)]
                t = min((r for r in roots if r >= 0), default=many.inf)
            if t < soonest:
                soonest, hit = t, c
        gap = [gap[c] + soonest * (v[c + 1] - v[c]) + (fall[c + 1] - fall[c]) * soonest**2 / 2 for c in range(n - 1)]
        v, left = [x + a * soonest for x, a in zip(v, fall, strict=True)], left - soonest
        if hit is None:
            return v, order
        order.append(hit)
        gap[hit] = many.zero
        kick = (1 + eps) * (v[hit + 1] - v[hit]) / (light[hit] + light[hit + 1])
        v[hit], v[hit + 1] = v[hit] + kick * light[hit], v[hit + 1] - kick * light[hit + 1]


def form_of(law, c, scene):
    """(k, p, γ, d) of a law of pair c, without the rounding of γ that Tsuji's law has."""
    if isinstance(law, OwnDashpot):
        return law.k, 1.0, law.gamma, 0.0
    k, p, gamma, d = resolve(law, scene.pairs[c]).form
    if isinstance(law, gr.TsujiHertz):
        mobility = sum(0 if math.isinf(scene.mass[i]) else 1 / mp.mpf(float(scene.mass[i])) for i in scene.bodies(c))
        gamma = mp.mpf(law.alpha) * mp.sqrt(mp.mpf(law.k) / mobility)
    return k, p, gamma, d


def soft_speeds(case):
    """Velocities of soft spheres at the end, and the order of their contacts."""
    laws = case.law if isinstance(case.law, (list, tuple)) else [case.law] * case.scene.n_pairs
    forms = [form_of(law, c, case.scene) for c, law in enumerate(laws)]
    found = taylor.solve(with_fitted_walls(case.scene, 0.0, case.t_end), forms, None, case.t_end, DIGITS)
    events = sorted((t, row.pair) for row in found.contacts for t in (row.t_begin, row.t_end) if t is not None)
    return list(found.velocity), [pair for _, pair in events]


def natural(value, scene):
    """What a parameter changes by; only velocities are asked for where they are 0."""
    return abs(value) or speed_scale(scene) or 1.0


def reference(case, hard, name, value):
    """The derivative of all velocities by a parameter; None if the order of contacts changes that near."""
    plan = make_plan(case, {name: [value]}, (), {}, {})
    h = STEP * 2.0 ** math.floor(math.log2(natural(value, case.scene)))
    (above, one), (below, other) = (
        (hard_speeds if hard else soft_speeds)(plan.case((value + side * h,))) for side in (1.0, -1.0))
    if one != other:
        return None
    return np.array([float((a - b) / (2 * mp.mpf(h))) for a, b in zip(above, below, strict=True)])


def truth_of(kind, seed):
    """Parameter, end and true derivatives of a question; "truth" is None if contacts change their order that near."""
    case, hard, rng = question(kind, seed)
    result = "hard_v_final" if hard else "v_final"
    found = gr.sensitivity(case, result)
    drawn = ("floor.temperature", "mass[1]") if kind == "thermal" else ()  # in floats by the twin too
    names = [name for name, p in found.parameters.items() if name not in drawn
             and not name.startswith("radius") and "exponent" not in name and (p or not name.startswith("gap"))]
    name = str(rng.choice(names))
    truth = reference(case, hard, name, found.parameters[name])
    return {"kind": kind, "seed": seed, "t_end": case.t_end, "result": result, "name": name,
            "condition": [x if math.isfinite(x) else None for x in found.condition[result].tolist()],
            "truth": None if truth is None else truth.tolist()}


def judged(row):
    """How far off the derivatives of all velocities are: rows (error, own estimate, condition), in sizes of the
    velocity and per relative change of the parameter; nan where they are not given."""
    case, _, _ = question(row["kind"], row["seed"], row["t_end"])
    name, result = row["name"], row["result"]
    found = gr.sensitivity(case, result, name)
    p, size = found.parameters[name], found._starts[0].scales
    slope = p if p > 0.0 else 1.0
    scale = natural(p, case.scene) / slope / size
    error = np.abs(found.gradient[result][name] - np.array(row["truth"]) * slope) * scale
    condition = np.array([x or math.nan for x in row["condition"]])
    rows = np.stack([error, found.error[result][name] * scale, np.fmax(1.0, condition)], axis=1)
    return rows[~case.scene.is_wall]


def tell(scenes=range(20)):
    """Append the truths that the file does not have yet, one line each: they take hours in all."""
    known = {(row["kind"], row["seed"]) for row in rows()}
    with TRUTHS.open("a", encoding="utf-8") as file:
        for seed, kind in product(scenes, KINDS):
            if (kind, seed) not in known:
                print(json.dumps(truth_of(kind, seed)), file=file, flush=True)


def rows():
    """The truths that are known."""
    lines = TRUTHS.read_text(encoding="utf-8").splitlines() if TRUTHS.exists() else []
    return [json.loads(line) for line in lines]


if __name__ == "__main__":
    tell()
