"""Compare the library with the reference judge on many questions.

    python -m tests.helpers.soak_answers FILE [NUMBER [SECONDS]]

Each line of FILE is one finished question, so that an interrupted soak continues where it stopped. The summary has the
number of disagreements, of false yes (the library alone says yes) and of false no (the judge alone says yes).
"""

import json
import math
import os
import sys
import time
from itertools import count
from pathlib import Path

import granular as gr
from tests.helpers.judge import Judge
from tests.helpers.judged_flights import wrong_flights
from tests.helpers.scenes_of_outcomes import OUTCOME_KINDS, outcome_question
from tests.helpers.scenes_to_judge import KINDS, question

SLOW_KINDS = {"threshold": 20, "pile_hit": 5, "sine": 5, "piecewise": 5, "resting": 5, "drop": 3, "thermal": 2}
"""Of these kinds only every n-th seed is used."""
MAX_EVENTS, SAME_ERROR = 20_000, 1e-3


def all_questions(first=5000):
    """Pairs (kind, seed) without end, all kinds in turn."""
    for seed in count(first):
        for kind in (*OUTCOME_KINDS, *KINDS):
            if (seed - first) % SLOW_KINDS.get(kind, 1) == 0:
                yield kind, seed


def question_of(kind, seed):
    """Scene, laws, rule and end of a question of either generator."""
    if kind in OUTCOME_KINDS:
        return outcome_question(kind, seed)
    scene, law, t_end = question(kind, seed)
    return scene, law, None, t_end


def compared(kind, seed):
    """One question answered by the library and by the judge, as a record of the file."""
    scene, law, rule, t_end = question_of(kind, seed)
    began = time.perf_counter()
    report = gr.compare(scene, law, *([rule] if rule else []), t_end=t_end, max_events=MAX_EVENTS)
    judge = Judge(scene, report.law, report.rule, t_end, max_events=MAX_EVENTS)
    own = judge.judge()
    wrong = 0
    if "yes" in (report.answer.name, own.answer) and hasattr(judge, "logs"):
        unit = dict.fromkeys(range(scene.n), 0.0)
        for pairs, part in own.components.items():
            unit |= {body: part.unit for c in pairs for body in judge.bodies(c)}
        wrong = len(wrong_flights(*judge.logs, judge, unit))
    reasons = sorted({part.reason for part in own.components.values()})
    return {"kind": kind, "seed": seed, "library": report.answer.name, "judge": own.answer, "verdict": report.verdict,
            "library_error": report.error, "judge_error": float(own.error), "reasons": reasons,
            "wrong_flights": wrong, "seconds": round(time.perf_counter() - began, 2)}


def errors_agree(record):
    one, other = (float("nan" if record[name] is None else record[name]) for name in ("library_error", "judge_error"))
    both_nan = math.isnan(one) and math.isnan(other)
    return both_nan or math.isclose(one, other, rel_tol=SAME_ERROR, abs_tol=1e-6)


def summary(records):
    done = [r for r in records if "failure" not in r]
    differ = [r for r in done if r["library"] != r["judge"]]
    false_yes = [r for r in differ if r["library"] == "yes"]
    false_no = [r for r in differ if r["judge"] == "yes"]
    errors = [r for r in done if r["library"] == r["judge"] in ("yes", "no") and not errors_agree(r)]
    wrong = [r for r in done if r["wrong_flights"]]
    lines = [f"{len(records)} questions, {len(records) - len(done)} failures, {len(differ)} disagreements, "
             f"{len(false_yes)} false yes, {len(false_no)} false no, {len(errors)} other errors, "
             f"{len(wrong)} with wrong flights after a yes"]
    for name, found in (("false yes", false_yes), ("false no", false_no), ("disagreement", differ), ("error", errors),
                        ("wrong flights", wrong), ("failure", [r for r in records if "failure" in r])):
        lines += [f"{name}: {json.dumps(r)}" for r in found[:20]]
    return "\n".join(lines)


def main(path, number=2000, seconds=math.inf):
    file = Path(path)
    records = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    finished, began = {(r["kind"], r["seed"]) for r in records}, time.monotonic()
    with file.open("a") as log:
        for kind, seed in all_questions():
            if len(records) >= number or time.monotonic() - began > seconds:
                break
            if (kind, seed) in finished:
                continue
            try:
                record = compared(kind, seed)
            except Exception as failure:  # a failure is a result of the soak
                record = {"kind": kind, "seed": seed, "failure": repr(failure)}
            records.append(record)
            log.write(json.dumps(record) + "\n")
            log.flush()
    print(summary(records))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main(sys.argv[1], *(of(value) for of, value in zip((int, float), sys.argv[2:], strict=False)))
