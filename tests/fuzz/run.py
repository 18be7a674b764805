"""Run the fuzz from the command line, and print what falls short.

    python tests/fuzz/run.py --seeds 0:1000              a table of failures by kind and law, with seeds
    python tests/fuzz/run.py --seeds 1354                one seed, with its scene
    python tests/fuzz/run.py --seeds 0:200 --law Tsuji   only scenes in which such a law occurs
    options: --plain (interpreted engine), --long (judge every dispute again in long doubles, not only those
    below 1e-9), --digits (dispute at 34 digits), --tol 1e-30
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]

from fuzz.judge import Verdict, judge  # noqa: E402
from fuzz.scenes import generate  # noqa: E402


def main() -> None:
    """Parse, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0:100", help="a seed, or first:beyond")
    parser.add_argument("--law", default="", help="only scenes with a law of such a name")
    parser.add_argument("--plain", action="store_true")
    parser.add_argument("--long", action="store_true")
    parser.add_argument("--digits", action="store_true")
    parser.add_argument("--tol", type=float, default=1e-16)
    options = parser.parse_args()
    first, _, beyond = options.seeds.partition(":")
    seeds = range(int(first), int(beyond) if beyond else int(first) + 1)
    warnings.simplefilter("ignore")
    if not options.plain:
        _compile()
    found: dict[tuple[str, str, str], list[tuple[float, int]]] = defaultdict(list)
    verdicts, began = [], time.perf_counter()
    for seed in seeds:
        case = generate(seed)
        if options.law and not any(options.law.lower() in one.name.lower() for one in case.laws):
            continue
        tic = time.perf_counter()
        verdict = _judged(case, options)
        took = time.perf_counter() - tic
        verdicts.append(verdict)
        if verdict.kind != "ok":
            what = verdict.why.split(" ")[0] if verdict.kind == "short" else verdict.why[:90]
            law = case.names
            if "of pair" in verdict.why:
                law = case.laws[int(verdict.why.rpartition(" ")[2])].name
            found[verdict.kind, law, what].append((verdict.error, seed))
            print(f"{seed:6d} {verdict.kind:8s} {case.names:18s} κ={verdict.condition:8.2g} "
                  f"{verdict.error:8.1e} {verdict.tier:6s} est={verdict.estimate:7.1e} {verdict.why[:100]}", flush=True)
        if took > 20.0:
            print(f"{seed:6d} took {took:.0f} s", flush=True)
        if len(seeds) == 1:
            print(case, verdict, sep="\n")
    report(found, verdicts, time.perf_counter() - began)


def report(found: dict[tuple[str, str, str], list[tuple[float, int]]], verdicts: list[Verdict], took: float) -> None:
    """Print the table."""
    print(f"\n{len(verdicts)} scenes in {took:.0f} s: " + ", ".join(
        f"{sum(v.kind == kind for v in verdicts)} {kind}" for kind in ("ok", "short", "refused", "unjudged")))
    fine = [v for v in verdicts if v.kind == "ok" and v.final == v.final]
    low, high = [v for v in fine if v.below], [v for v in fine if v.beyond]
    print(f"error_estimate: below the error in {len(low)}, more than 1e3 times it (+ 1e-15) in {len(high)} "
          f"of {len(fine)}")
    for (kind, law, what), cases in sorted(found.items()):
        worst = max(error for error, _ in cases)
        print(f"{kind:9s} {law:18s} {what:12s} {len(cases):4d}  worst {worst:8.1e}  seeds "
              + " ".join(str(seed) for _, seed in sorted(cases, reverse=True)[:12]))


def _judged(case, options) -> Verdict:
    try:
        name = "plain" if options.plain else "auto"
        infinite = float("inf")
        long, digits = infinite if options.long else 1e-9, infinite if options.digits else 0.0
        return judge(case, long, digits, options.tol, name)
    except Exception as error:
        return Verdict("short", f"{type(error).__name__}: {error}", float("inf"))


def _compile() -> None:
    """Have the engine's machine code in memory, so that engine "auto" uses it."""
    import granular as gr

    gr.md.simulate(gr.Scene([1.0, 1.0], [0.0, 0.0], [0.1], [1.0, 0.0]), gr.Hertz(1.0), engine="compiled")


if __name__ == "__main__":
    main()
