"""Make the stored truths of 300 scenes, which every test run compares with.

    python tests/fuzz/make_truths.py

A few of each law, of moderate size; each solved in doubles and again in long doubles, which must agree. The stored
numbers are those of the long doubles, rounded to doubles.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]

from fuzz.arithmetic import LONG  # noqa: E402
from fuzz.judge import distance, to_json, truth  # noqa: E402
from fuzz.scenes import generate  # noqa: E402
from fuzz.solver import solve  # noqa: E402

STORE = Path(__file__).with_name("truths.json")
SCENES = 300
OF_ONE_KIND = {"mixed": 60}
LEFT_OUT = {385}
"""A row of balls that falls on a floor too soft to feel: whether they press each other is a question of rounding."""
STEPS = 250
"""Steps of the solver beyond which a scene takes the engine too long for every test run."""


def main() -> None:
    """Collect scenes seed by seed until there are enough."""
    kept, kinds, seed = [], Counter(), 0
    while len(kept) < SCENES:
        seed += 1
        case = generate(seed)
        if seed in LEFT_OUT:
            continue
        if kinds[case.names] >= OF_ONE_KIND.get(case.names, 16) or solve(case).steps > STEPS:
            continue
        one = truth(case)
        if one is None:
            continue
        better = truth(case, LONG)
        what, error = distance(better, one.pairs, one.numbers)
        if error > 1e-13:
            print(f"seed {seed}: doubles and long doubles differ by {error:.1e} in {what}")
            continue
        kinds[case.names] += 1
        kept.append({"seed": seed, "case": case.to_json(), "truth": to_json(better)})
        print(f"{len(kept)} {seed} {case.names} {error:.1e}", flush=True)
    text = "[\n" + ",\n".join(json.dumps(one, separators=(",", ":")) for one in kept) + "\n]\n"
    STORE.write_text(text)
    print(f"{STORE.stat().st_size} bytes", dict(kinds))


if __name__ == "__main__":
    main()
