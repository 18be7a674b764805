"""Golden data for the teaching page: 500 random settings of its sliders, run by Python. Writes golden.json.

    python tests/app/page/make_golden.py
"""

import json
import math
import re
from pathlib import Path

import numpy as np

import granular as gr
from granular.comparison import outcome as outcomes

CASES = 500
RULES = ("right", "random", "newton", "poisson", "reflect")
SLIDERS = {
    "three-balls": {"ratio": (0.5, 50.0, "log"), "height": (0.15, 2.0, "linear")},
    "ball-stack": {"n": (2, 8, "whole"), "massRatio": (0.1, 1.0, "log"), "height": (0.15, 2.0, "linear")},
    "newtons-cradle": {"n": (2, 9, "whole"), "moving": (1, 8, "whole"), "speed": (0.1, 3.0, "linear")},
}
GAP = (1e-7, 0.1, "log")
COMMON = {"gap": GAP, "eps": (0.1, 1.0, "linear"), "k": (4e3, 1e9, "log")}
BALL = {"m": (1e-3, 2.0, "log"), "r": (2e-3, 0.15, "log"), "t": (1e-5, 0.03, "log"), "e": (0.1, 1.0, "linear"),
        "air": (0, 1, "whole")}
REAL = {
    "real-balls": {"gap": GAP, "height": (0.15, 2.0, "linear"), "rule": (0, 1, "whole"), "bounces": (1, 2, "whole")}
    | {f"{name}{i}": spec for i in (1, 2) for name, spec in BALL.items()},
    "bouncing-ball": {"height": (0.15, 2.0, "linear")} | {f"{name}1": spec for name, spec in BALL.items()},
}
SHIFT = 1e-13
PATIENCE = 150_000
"""Collisions of hard spheres that the page makes, a few less."""
NOT_FIRM = {"status": "ended", "velocity": None, "sequence": None, "rise": None, "span": None}


def settings(random, name):
    """Return random settings: of the gaps a tenth touch and a tenth are wide, a fifth of ε is 1."""
    specs = REAL[name] if name in REAL else COMMON | SLIDERS[name]
    values = {key: slider(random, *spec) for key, spec in specs.items()}
    elastic = random.random() < 0.2
    values |= {key: 1.0 for key in values if key in ("eps", "e1", "e2") and elastic}
    if "gap" in values:
        values["gap"] = {0: 0.0, 1: 1e-2}.get(int(random.integers(10)), values["gap"])
    if "moving" in values:
        values["moving"] = min(values["moving"], values["n"] - 1)
    return values


def slider(random, low, high, scale):
    """Return what the page makes of one of the 1001 places of a slider: three digits."""
    if scale == "whole":
        return int(random.integers(low, high + 1))
    share = int(random.integers(1001)) / 1000
    return float(f"{low * (high / low) ** share if scale == 'log' else low + share * (high - low):.3g}")


def scene_of(name, v):
    """Return the scene, and when it stops."""
    if name in REAL:
        lower, *upper = balls_of(v)
        scene = gr.scenes.real_balls(lower, *(upper or [None]), gap=v.get("gap", 0.0), height=v["height"])
        return scene, gr.until.contact(pair=0, nth=v["bounces"] + 1 if upper else 4)
    if name == "three-balls":
        scene = gr.scenes.three_balls(radii=(0.1, 0.1 / v["ratio"]), gap=v["gap"], height=v["height"])
        return scene, gr.until.contact(pair=0, nth=2)
    if name == "ball-stack":
        scene = gr.scenes.ball_stack(n=v["n"], mass_ratio=v["massRatio"], gap=v["gap"], height=v["height"])
    else:
        scene = gr.scenes.newtons_cradle(n=v["n"], moving=v["moving"], gap=v["gap"], speed=v["speed"])
    return scene, gr.until.separated()


def balls_of(v):
    """Return the balls of a setting, bottom to top."""
    return [
        gr.balls.Ball(v[f"m{i}"], v[f"r{i}"], v[f"t{i}"], v[f"e{i}"], filled=bool(v[f"air{i}"]))
        for i in "12" if f"m{i}" in v
    ]


def contacts_of(name, v, n):
    """Return stiffness and restitution of each pair."""
    if name not in REAL:
        return [v["k"]] * n, [v["eps"]] * n
    lower, *upper = balls_of(v)
    both = [gr.balls.contact(lower, ball, gr.balls.RULES[v["rule"]]) for ball in upper]
    return [lower.stiffness, *(c.stiffness for c in both)], [lower.restitution, *(c.restitution for c in both)]


def compared(name, v, ties, shift=0.0):
    """Return the comparison that `granular compare` makes; `shift`: with all that is given shifted by so much."""
    scene, end = scene_of(name, v)
    t_end = 10.0 * math.sqrt(2.0 * scene.gravity * float(scene.gap[0])) / scene.gravity if scene.gravity else None
    sign, (k, eps) = (-1.0) ** np.arange(scene.n - 1), contacts_of(name, v, scene.n_pairs)
    eps = [e * (1.0 - shift) for e in eps]
    scene = scene.replace(gap=scene.gap * (1.0 + shift * sign), velocity=scene.velocity * (1.0 + shift))
    law = [gr.LinearDashpot.from_restitution(*of, p) for *of, p in zip(eps, k, scene.pairs, strict=True)]
    return gr.compare(scene, law, gr.ConstantRestitution(eps), until=end, t_end=t_end, ties=ties)


def case(name, v, ties, rises=True):
    """Return a golden case, with rises if they are wanted.

    Numbers that a shift of all that is given by 1e-13 changes are left out: None. So is what Python does not decide:
    without a speed of the first collision, and under other tie rules where its clock cannot tell apart two collisions
    of what is nearly a collapse, which the page's rates can; what takes longer than the page has patience for; and
    where hard spheres that stick part at rounding.
    """
    report, twin = compared(name, v, ties), compared(name, v, ties, SHIFT)
    told = answer_of(report)
    runs = {engine: firm(outcome(report, engine, rises), outcome(twin, engine, rises)) for engine in ("soft", "hard")}
    decided = report.impact_speed > 0.0 and (ties == "left" or not report.hard.stats["zooms"])
    short = len(report.settled.contacts) < PATIENCE
    decided = decided and short
    if not decided:
        runs["hard"] = NOT_FIRM | {"status": None}
    if math.isnan(report.error) or not short:  # a run that stopped early is not gone on with, nor is the other
        runs["soft"] = NOT_FIRM | {"status": None}
    loose = part_at_rounding(report)
    if not decided or told != answer_of(twin) or (loose and told["kind"] != "forever"):
        told = dict.fromkeys(told)
    if v.get("bounces") == 2:
        runs = {engine: run | {"rise": None} for engine, run in runs.items()}  # only the first bounce is asked there
    same = decided and not loose and abs(report.error - twin.error) < 1e-10 * max(1.0, report.error)  # nan is not
    counts = counts_of(report) if decided and counts_of(report) == counts_of(twin) else None
    leaves = departure_of(report) if same and ball_of(report) == ball_of(twin) else None
    return {"scene": name, "values": v, "ties": ties, **told, "error": report.error if same else None,
            "leaves": leaves, "counts": counts, **runs}


def departure_of(report):
    """Ball that decides an error above 1 %, and the velocities in m/s, soft and hard, with which it leaves."""
    one = report.deciding
    return [one.ball, one.soft_velocity, one.hard_velocity] if one and report.error > outcomes.ERROR_LIMIT else None


def ball_of(report):
    """Return the ball that decides the error, or None."""
    return report.deciding and report.deciding.ball


def part_at_rounding(report):
    """Whether hard spheres carried on after a collapse end at less than the speed at which they stick, but not at 0."""
    slow = np.abs(outcomes.separation_speeds(report.continued[0])) / gr.measures.fastest_approach(report.hard)
    return report.settled is not report.hard and bool(((slow > 0.0) & (slow < 1e-8)).any())


def counts_of(report):
    """Return numbers of soft and hard contacts, pair by pair; None where hard spheres all but collapse, or stop."""
    if report.settled is not report.hard or math.isnan(report.error):
        return None
    return [[pair.soft_contacts, pair.hard_contacts] for pair in report.pairs]


def answer_of(report):
    """Return the answer, its kind, and the numbers it tells: pair, soft and hard contacts, or how many contacts."""
    sentence, answer = report.verdict, report.answer.name
    kind = next((kind for part, kind in KINDS if part in sentence), answer)
    said = re.search(r"pair (floor|\d+)–\w+ has (\d+) contacts?, not (\d+)|separate after (\d+) contact", sentence)
    if kind == "forever" and report.hard.stats["verdict"] == "proved":  # of which pairs: the page has no proofs
        said = None
    return {
        "answer": answer,
        "kind": kind,
        "said": said and [int(number.replace("floor", "0")) for number in said.groups() if number],
    }


KINDS = (
    ("collide forever", "forever"), ("radius under their weight", "sinks"), (", not ", "counts"),
    ("an error of", "off"), ("outcomes differ by", "off"), ("though contacts overlap", "yes, overlap"),
)


def outcome(report, engine, rises):
    """Return what the page is held against, of one engine: contacts that count, final velocities, rises, time span."""
    run, cut = report.continued[engine == "soft"], getattr(report, engine)
    if cut.status.name in ("collapse", "bounded", "max_events", "unstable"):
        return NOT_FIRM | {"status": "early"}
    rise, = none_for_nan(np.array([report.rises[engine == "soft"] if rises else math.nan]))
    log = run.contacts
    last = float(np.nanmax(np.append(log["t_end"], log["t_begin"])))
    order = np.argsort(log["t_begin"], kind="stable") if engine == "hard" else np.lexsort([log["pair"], log["t_begin"]])
    sequence = "".join(str(c) for c in log["pair"][order])
    u = none_for_nan(outcomes.leaving_velocities(run))
    return {"status": "ended", "velocity": u, "sequence": sequence, "rise": rise, "span": last}


def firm(one, other):
    """Return an outcome without what differs in its twin."""
    if one["status"] != other["status"]:
        return NOT_FIRM | {"status": None}
    if one["status"] == "early":
        return one
    u, v = (np.array(x["velocity"], dtype=float) for x in (one, other))
    same = sorted(one["sequence"]) == sorted(other["sequence"]) and (np.isnan(u) == np.isnan(v)).all()
    if not same or np.nanmax(np.abs(u - v), initial=0.0) > 1e-9 or abs(one["span"] - other["span"]) > 1e-9:
        return NOT_FIRM
    heights = None not in (one["rise"], other["rise"]) and abs(one["rise"] - other["rise"]) < 1e-6
    return one if heights else one | {"rise": None}


def none_for_nan(values):
    return [None if math.isnan(x) else x for x in values.tolist()]


def main():
    random = np.random.default_rng(20110413)
    names, cases = [*SLIDERS, *REAL], []
    for i in range(CASES):
        name = names[i % len(names)]
        v = settings(random, name)
        rules = [rule for rule in RULES if name not in REAL or rule not in ("newton", "reflect")]
        ties = "left" if random.random() < 0.75 else rules[int(random.integers(len(rules)))]
        cases.append(case(name, v, ties))
    rows = ",\n".join(json.dumps(one) for one in cases)
    Path(__file__).with_name("golden.json").write_text(f"[\n{rows}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
