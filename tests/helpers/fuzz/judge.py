"""The judge: what a run of the engine says, beside the independent solver, in units of the scene's condition.

Each number compared has a scale: speeds the largest impact speed V, forces the largest force, and so on. An error is
|difference| / max(scale · max(1, κ), response), where κ is the largest response of a velocity over V, and `response`
that of this number itself, per unit relative change of gaps, velocities and masses (moved by about 4e-12, by random
amounts and not only random signs, or the time of flight gap/speed would not move in one case of four). What is less
than the spacing of doubles at the number itself is no error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

import granular as gr
from tests.helpers.fuzz.arithmetic import DIGITS, DOUBLE, LONG, LOOSE, Arithmetic
from tests.helpers.fuzz.laws import Rounded
from tests.helpers.fuzz.scenes import Case
from tests.helpers.fuzz.solver import Solution, solve
from tests.helpers.fuzz.stored_truth import Truth, scales

SHIFT = 4e-12
SHIFTS = 3
FALLS_SHORT = 1e-12
ROUNDING, OF_A_STEP = 2e-14, 3e-17
"""Of both programs, which no estimate of the truncation can know; and what each step of the engine adds to it."""
STEPS = 40_000
ROUNDINGS, AT_MOST = 6, 1e-10
"""Of a user's law, so many are tried where a run falls short; and how much they may amount to."""


@dataclass
class Verdict:
    """What became of a case: ok, short (falls short), refused, or unjudged (ill-conditioned); why, and by how much."""

    kind: str
    why: str = ""
    error: float = 0.0
    condition: float = math.nan
    tier: str = "double"
    estimate: float = math.nan
    final: float = math.nan
    rounding: float = ROUNDING
    spacing: float = 0.0
    notes: list[str] = field(default_factory=list)

    @property
    def below(self) -> bool:
        """Whether error_estimate is less than the error of the final velocities, rounding apart."""
        return self.final - self.spacing > (self.estimate + self.rounding) * max(1.0, self.condition)

    @property
    def beyond(self) -> bool:
        """Whether error_estimate is more than a thousand times the error."""
        return self.estimate * max(1.0, self.condition) > 1e3 * self.final + 1e-15


def truth(case: Case, arithmetic: Arithmetic = DOUBLE, shifts: int = SHIFTS, compiled: bool = True) -> Truth | None:
    """Solve a case and find its condition; None if a shift changes the sequence of contacts, or rounding does."""
    solution = solve(case, arithmetic, most=STEPS, compiled=compiled)
    if solution.status == "tired":
        return None
    pairs, numbers = observed(case, solution)
    if grazes(numbers):
        return None
    scale = scales(case, numbers)
    if case.until == "separated" and drifts(numbers, scale):
        return None
    response = {name: np.zeros_like(x) for name, x in numbers.items()}
    rng = np.random.default_rng(1)
    base = numbers if arithmetic is DOUBLE else observed(case, solve(case, most=STEPS))[1]
    for _ in range(shifts):
        other = solve(case, LOOSE, shift(case, rng), most=STEPS, compiled=compiled)
        if other.status != solution.status:
            return None
        pairs_too, moved = observed(case, other)
        if pairs_too != pairs or any(moved[k].shape != base[k].shape for k in moved):
            return None
        for name, x in moved.items():
            response[name] = np.hypot(response[name], np.nan_to_num(x - base[name]) / SHIFT)
    speeds = [response[name] / scale[name] for name in ("velocity", "v_in", "v_out")]
    condition = max([float(np.nanmax(x)) for x in speeds if x.size and not np.isnan(x).all()], default=0.0)
    return Truth(solution.status, pairs, numbers, scale, response, condition)


def grazes(numbers: dict[str, Any]) -> bool:
    """Whether balls part or meet at a speed of rounding, as those that fall from a touch at rest and come back to it.

    Whether they do is then a question of rounding, and so is the number of contacts.
    """
    closing, parting = (numbers[name][:, 0] - numbers[name][:, 1] for name in ("v_in", "v_out"))
    fastest = np.nanmax(abs(np.concatenate([closing, parting])), initial=0.0)
    return bool(((abs(parting) < 1e-9 * fastest) | ((closing != 0.0) & (abs(closing) < 1e-9 * fastest))).any())


def drifts(numbers: dict[str, Any], scale: dict[str, Any]) -> bool:
    """Whether balls go side by side at the end except for rounding: whether they approach, nobody knows."""
    rates = np.diff(numbers["velocity"][-1])
    return bool(((rates != 0.0) & (abs(rates) < 1e-12 * scale["velocity"])).any())


def shift(case: Case, rng: Any) -> Any:
    """Relative changes of gaps, velocities and masses; balls that touch and move together go on doing so."""
    n = len(case.mass)
    changes = [rng.standard_normal(k) * SHIFT for k in (len(case.gap), n, n)]  # a ring has one gap more
    for c in range(n - 1):
        if case.velocity[c] == case.velocity[c + 1] and case.gap[c] <= 0.0:
            changes[1][c + 1] = changes[1][c]
    return changes


def observed(case: Case, run: Solution | gr.Trajectory) -> tuple[list[int], dict[str, Any]]:
    """Pair of each contact, sorted by pair and time, and all numbers that are compared, as doubles."""
    if isinstance(run, Solution):
        table = np.array([[float(x) for x in row] for row in run.rows]).reshape(-1, 11)
        to_the_end, n = run.status == "time", len(case.gap)
        kept = zip(case.samples or (), run.samples, strict=True)
        samples = [(t, row) for t, row in kept if to_the_end or t < float(run.time)]
        ends = [(float(run.time), np.concatenate([run.overlap, run.rate, run.rate, run.velocity]))]
        rows = samples if samples and to_the_end else samples + ends
        time = np.array([float(t) for t, _ in rows])
        gap = np.array([[-float(x) for x in row[:n]] for _, row in rows])
        velocity = np.array([[float(x) for x in row[3 * n :]] for _, row in rows])
    else:
        c = run.contacts
        table = np.column_stack([c["pair"], c["t_begin"], c["t_end"], c["duration"], c["v_in"], c["v_out"],
                                 c["xi_max"], c["force_max"], c["impulse"]])
        some = slice(None) if case.samples is not None else slice(-1, None)
        time, gap, velocity = run.time[some], run.gap[some], run.velocity[some]
    table = table[np.lexsort((table[:, 1], table[:, 0]))]
    fastest = float(np.nanmax(abs(table[:, 4:8]), initial=0.0))
    at_rest = abs(table[:, 4] - table[:, 5]) < 1e-12 * fastest
    faint = np.isnan(table[:, 2]) | at_rest  # woken at the very end, or rocked by rounding: has it begun? nobody knows
    momentum = min(case.mass) * abs(table[:, 4] - table[:, 5]).max(initial=0.0)
    table = table[~(faint & (table[:, 10] < 1e-10 * max(momentum, table[:, 10].max(initial=0.0))))]
    numbers = {"velocity": velocity, "v_in": table[:, 4:6], "v_out": table[:, 6:8], "time": time, "gap": gap}
    for i, name in ((1, "t_begin"), (2, "t_end"), (3, "duration"), (8, "xi_max"), (9, "force_max"), (10, "impulse")):
        numbers[name] = table[:, i]
    if case.t_end is None and case.until is None:  # quiet: nothing happens any more, it may end at any time
        del numbers["time"], numbers["gap"]
    return table[:, 0].astype(int).tolist(), numbers


def distance(one: Truth, pairs: list[int], numbers: dict[str, Any]) -> tuple[str, float]:
    """The worst number and its error."""
    if pairs != one.pairs:
        return f"contacts {_counts(pairs)} for {_counts(one.pairs)}", math.inf
    worst = ("", 0.0)
    for name, wanted in one.numbers.items():
        got = numbers[name]
        if got.shape != wanted.shape:
            return f"{name} has {got.shape} for {wanted.shape}", math.inf
        if (np.isnan(got) != np.isnan(wanted)).any():
            return f"{name} nan", math.inf
        allowed = np.fmax(one.scale[name] * max(1.0, one.condition), one.response[name])
        beyond_rounding = np.fmax(abs(got - wanted) - np.spacing(abs(wanted)), 0.0)
        errors = np.nan_to_num(beyond_rounding / allowed, nan=0.0)
        error = errors.max(initial=0.0)
        if error > worst[1]:
            row = int(errors.argmax()) * len(errors) // errors.size
            of_log = name not in ("velocity", "time", "gap")
            worst = (name + (f" of pair {pairs[row]}" if of_log else ""), float(error))
    return worst


def _counts(pairs: list[int]) -> list[int]:
    return np.bincount(pairs).tolist() if pairs else []


def engine(case: Case, **options: Any) -> gr.Trajectory:
    """Run the engine on a case."""
    until = case.until
    if isinstance(until, tuple):
        until = gr.until.contact(*until)
    elif until == "separated":
        until = gr.until.separated()
    laws = options.pop("laws", None) or [one.law() for one in case.laws]
    options = {"samples": case.samples, "t_end": case.t_end, "until": until} | options
    return gr.md.simulate(case.scene(), laws, **options)


def judge(
    case: Case, long: float = math.inf, digits: float = 0.0, tol: float = 1e-16, name: str = "auto"
) -> Verdict:
    """Run engine and solver on a case, and compare.

    What falls short by less than `long`, or differs from its estimate, is judged again in long doubles, and what falls
    short by less than `digits` at 34 digits.
    """
    one = truth(case)
    if one is None:
        return Verdict("unjudged", "ill-conditioned")
    try:
        run = engine(case, tol=tol, engine=name, max_steps=20_000)
    except ValueError as refusal:
        return Verdict("refused", str(refusal))
    verdict = compare(case, one, run)
    for tier, wanted in ((LONG, long), (DIGITS, digits)):
        doubtful = tier is LONG and verdict.kind == "ok" and (verdict.below or verdict.beyond)
        if doubtful or (verdict.kind == "short" and verdict.error < wanted):
            better = truth(case, tier)
            if better is None:
                return Verdict("unjudged", "ill-conditioned")
            verdict = compare(case, better, run)
            verdict.tier = tier.name
    return verdict


def compare(case: Case, one: Truth, run: gr.Trajectory) -> Verdict:
    """Judge a run by the truth."""
    pairs, numbers = observed(case, run)
    status = run.status.name
    estimate = float(run.stats["error_estimate"])
    rounding = ROUNDING + OF_A_STEP * run.stats["steps"]
    verdict = Verdict("ok", condition=one.condition, estimate=estimate, rounding=rounding)
    if status != one.status:
        if status == "resting" and one.status == "time":
            return _resting(case, one, run, pairs, numbers, verdict)
        verdict.kind, verdict.why, verdict.error = "short", f"status {status} for {one.status}", math.inf
        return verdict
    verdict.why, verdict.error = distance(one, pairs, numbers)
    if verdict.error > FALLS_SHORT:
        verdict.kind = "short"
    else:
        last, wanted = numbers["velocity"][-1], one.numbers["velocity"][-1]
        worst = int(abs(last - wanted).argmax())
        verdict.final, verdict.spacing = (
            float(x[worst]) / one.scale["velocity"] for x in (abs(last - wanted), np.spacing(abs(wanted)))
        )
    if verdict.kind == "ok" and (unbalanced := momentum_error(case, run)) > 1e-12:
        verdict.kind, verdict.why, verdict.error = "short", "momentum of the log", unbalanced
    return verdict


def judged_by_roundings(case: Case, one: Truth, verdict: Verdict, **options: Any) -> Verdict:
    """The verdict, ok if it falls short by no more than other roundings of laws that users wrote make of this scene.

    No stored condition knows them: where a ball comes back to the touch again and again, by a law that does not say its
    power, they amount to more than those of the inputs.
    """
    laws = [spec.law() for spec in case.laws]
    known = [type(law).__module__.startswith("granular") for law in laws]
    if verdict.kind == "ok" or all(known) or not verdict.error < AT_MOST:
        return verdict
    for seed in range(ROUNDINGS):
        rounded = [law if said else Rounded(law, seed) for law, said in zip(laws, known, strict=True)]
        other = compare(case, one, engine(case, laws=rounded, **options))
        if verdict.error < 3.0 * other.error < 3.0 * AT_MOST:
            return replace(verdict, kind="ok", notes=[*verdict.notes, f"the law's roundings make {other.error:.1e}"])
    return verdict


def _resting(case: Case, one: Truth, run: gr.Trajectory, pairs: list[int], numbers: dict[str, Any],
             verdict: Verdict) -> Verdict:
    """A run that ends early at rest is right if the truth has no event after its end."""
    stop = float(run.time[-1])
    events = np.concatenate([one.numbers["t_begin"], one.numbers["t_end"]])
    if pairs != one.pairs or (np.nan_to_num(events, nan=0.0) > stop * (1.0 + 1e-9)).any():
        verdict.kind, verdict.why, verdict.error = "short", "resting, but contacts follow", math.inf
        return verdict
    same = {k: v for k, v in one.numbers.items() if k in ("t_begin", "v_in", "t_end", "v_out")}
    verdict.why, verdict.error = distance(
        Truth(one.status, one.pairs, same, one.scale, one.response, one.condition), pairs, numbers
    )
    verdict.kind = "short" if verdict.error > FALLS_SHORT else "ok"
    verdict.notes.append("resting before t_end")
    return verdict


def momentum_error(case: Case, run: gr.Trajectory) -> float:
    """Worst imbalance of a ball's momentum with the logged impulses and its weight, over their sizes."""
    mass, worst = np.array(case.mass), 0.0
    impulse = np.zeros(len(case.gap))
    np.add.at(impulse, run.contacts["pair"], run.contacts["impulse"])
    t = float(run.time[-1])
    for b, m in enumerate(mass):
        if math.isfinite(m):
            below, above = impulse[b - 1] if b > 0 else 0.0, impulse[b] if b < len(impulse) else 0.0
            gain = m * (run.velocity[-1, b] - case.velocity[b] + case.gravity * t)
            size = max(below, above, m * abs(run.velocity[-1]).max(), m * abs(case.velocity[b]), m * case.gravity * t)
            worst = max(worst, abs(gain - below + above) / (size or 1.0))
    return float(worst)
