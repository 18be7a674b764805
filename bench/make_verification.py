"""Write the reference answers for other programs to verification.json.

`python -m bench.make_verification` takes some minutes and writes ``granular/studies/verification.json``. Each
answer comes from a solver of 34 digits (`bench.reference`) and is printed with 17 digits. The condition number of an
answer is κ = Σ |∂ln answer / ∂ln input| over all non-zero inputs, from central differences of the engine. The solitary
wave is the fixed point of `granular.waves`, correct to 13 digits.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import granular as gr
from bench import reference
from granular.laws import dashpot
from granular.studies import verification

OUTPUT_PATH = Path(verification.__file__).with_suffix(".json")
RELATIVE_STEP = 1e-5
"""Relative step of the central differences for condition numbers."""
ANSWER_DIGITS, WAVE_DIGITS = 17, 13
Numbers = dict[str, tuple[str, Any]]
"""Unit and value of each answer, by quantity."""


@dataclass(frozen=True)
class Run:
    """One run of a case: initial state, laws, end time, and kind of answers."""

    scene: gr.Scene
    laws: tuple[Any, ...]
    t_end: float
    kind: str

    def answers(self, contacts: Any, gap: Any, velocity: Any) -> Numbers:
        """Answers from a solution by the reference or by an engine."""
        return dict(ANSWER_KINDS[self.kind](self, contacts, gap, velocity))

    def by_engine(self) -> Numbers:
        """Answers of `granular.md`."""
        run = gr.md.simulate(self.scene, self.laws, t_end=self.t_end)
        return self.answers(rows(run), run.gap[-1], run.velocity[-1])

    def by_reference(self) -> Numbers:
        """Answers of the solver with 34 digits.

        A second solution with 28 digits must agree to 20 digits.
        """
        solutions = (reference.solve(self.scene, self.laws, t_end=self.t_end, digits=digits) for digits in (34, 28))
        best, other = (self.answers(one.contacts, one.gap, one.velocity) for one in solutions)
        assert all(abs(value - other[name][1]) <= 1e-20 * abs(value) for name, (_, value) in best.items())
        return best

    def varied(self) -> Iterator[tuple[Run, Run]]:
        """Yield this run with each input increased and decreased by `RELATIVE_STEP`."""
        for name in ("mass", "gap", "velocity", "gravity"):
            value = np.atleast_1d(getattr(self.scene, name))
            for i in np.flatnonzero((value != 0.0) & np.isfinite(value)):
                pair = []
                for sign in (1.0, -1.0):
                    other = value.copy()
                    other[i] *= 1.0 + sign * RELATIVE_STEP
                    changed = {name: other[0] if name == "gravity" else other}
                    pair.append(replace(self, scene=replace(self.scene, **changed)))
                yield pair[0], pair[1]
        for c, law in enumerate(self.laws):
            for name, number in asdict(law).items():
                if number != 0.0:
                    changed = [replace(law, **{name: number * (1.0 + sign * RELATIVE_STEP)}) for sign in (1.0, -1.0)]
                    up, down = ((*self.laws[:c], one, *self.laws[c + 1:]) for one in changed)
                    yield replace(self, laws=up), replace(self, laws=down)

    def conditions(self) -> dict[str, float]:
        """Condition number κ of every answer."""
        here, total = self.by_engine(), dict.fromkeys(self.by_engine(), 0.0)
        for up, down in self.varied():
            one, other = up.by_engine(), down.by_engine()
            for name in total:
                difference = float(one[name][1]) - float(other[name][1])
                total[name] += abs(difference) / (2.0 * RELATIVE_STEP * abs(float(here[name][1]) or math.inf))
        return total


@dataclass(frozen=True)
class Row:
    """Contact of an engine, with the field names of the reference."""

    pair: int
    t_begin: float
    t_end: float | None
    v_out: tuple[float, float] | None


def rows(run: gr.Trajectory) -> list[Row]:
    """Contacts of a run, with the field names of the reference."""
    ended = np.isfinite(run.contacts["t_end"])
    return [Row(int(row["pair"]), float(row["t_begin"]), float(row["t_end"]) if done else None,
                tuple(map(float, row["v_out"])) if done else None)
            for row, done in zip(run.contacts, ended, strict=True)]


def sequence(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Onset and end of every contact, and the velocities after each contact."""
    seen: dict[int, int] = {}
    for row in contacts:
        nth = seen[row.pair] = seen.get(row.pair, 0) + 1
        where = f"pair {row.pair}, contact {nth}"
        if row.t_begin != 0.0:
            yield f"{where}: onset", ("s", row.t_begin)
        if row.t_end is not None:
            yield f"{where}: end", ("s", row.t_end)
            for side, v in zip(("lower", "upper"), row.v_out, strict=True):
                if v != 0.0:
                    yield f"{where}: velocity of the {side} body after it", ("m/s", v)


def last_contact(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """End of the last contact, and all velocities at that time."""
    yield "end of the last contact", ("s", max(row.t_end for row in contacts))
    for i, v in enumerate(velocity):
        yield f"velocity of ball {i} after it", ("m/s", v)


def bounce(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Contact and rise of a ball dropped on a floor.

    The rise is also compared with the rise after an instantaneous bounce.
    """
    (row,), scene = contacts, run.scene
    g, r, v, law = scene.gravity, float(scene.radius[1]), velocity[1], run.laws[0]
    eps = dashpot.restitution(law.gamma / (2.0 * math.sqrt(law.k * float(scene.mass[1]))))
    rise, fall = gap[0] + v * v / (2.0 * g), float(scene.gap[0])
    yield "onset", ("s", row.t_begin)
    yield "end", ("s", row.t_end)
    yield "velocity after it", ("m/s", row.v_out[1])
    yield "height of the centre at the top", ("m", rise + r)
    if eps < 1.0:
        hard = fall * eps * eps + r
        yield "height less that of an instantaneous bounce", ("%", 100.0 * (rise + r - hard) / hard)


def final_state(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Heights and velocities at the end of the run."""
    height = run.scene.origin
    for i in range(1, len(run.scene.mass) - 1):
        height = height + run.scene.radius[i - 1] + gap[i - 1] + run.scene.radius[i]
        yield f"height of the centre of ball {i}", ("m", height)
        yield f"velocity of ball {i}", ("m/s", velocity[i])


ANSWER_KINDS = {"sequence": sequence, "last": last_contact, "bounce": bounce, "state": final_state}


def dashpots(scene: gr.Scene, restitution: float, k: float) -> tuple[Any, ...]:
    """Clipped dashpots with one k and one ε in all pairs."""
    return tuple(gr.LinearDashpot.from_restitution(restitution, k=k, pair=pair) for pair in scene.pairs)


def unclipped_damping(restitution: float) -> float:
    """Damping ratio ζ = -ln ε / √(π² + ln² ε) of a dashpot without clipping.

    Codes that do not clip the force choose their dashpots by this formula.
    """
    return -math.log(restitution) / math.hypot(math.pi, math.log(restitution))


def three_balls() -> Run:
    """Base scene of Müller & Pöschel, starting at the first floor contact."""
    radius, v = np.array([0.0, 0.1, 0.01]), -math.sqrt(2.0 * 9.81 * 0.5)
    mass = [math.inf, *(900.0 * 4.0 / 3.0 * math.pi * r**3 for r in radius[1:])]
    scene = gr.Scene(mass, radius, [0.0, 1e-4], [0.0, v, v], 9.81)
    return Run(scene, dashpots(scene, 0.7, 5e7), 2e-3, "sequence")


def dropped_ball(restitution: float, k: float) -> Run:
    """Ball of diameter 0.2 m and 2600 kg/m³ with its centre 0.5 m above a floor."""
    mass = 2600.0 * math.pi / 6.0 * 0.2**3
    scene = gr.Scene([math.inf, mass], [0.0, 0.1], [0.4], [0.0, 0.0], 9.81)
    return Run(scene, dashpots(scene, restitution, k), 0.4, "bounce")


def squeezed_balls() -> Run:
    """Two balls of diameter 1 mm, one above the other, between walls 1.8 mm apart."""
    r, k, zeta = 5e-4, 1000.0, unclipped_damping(0.8)
    mass = [math.inf, *(rho * 4.0 / 3.0 * math.pi * r**3 for rho in (20000.0, 10000.0)), math.inf]
    scene = gr.Scene(mass, [0.0, r, r, 0.0], [-5e-5, -1e-4, -5e-5], [0.0] * 4, 9.81)
    laws = tuple(gr.LinearDashpot(k, 2.0 * zeta * math.sqrt(k * pair.m_eff)) for pair in scene.pairs)
    return Run(scene, laws, 1e-3, "state")


def ring() -> Run:
    """Two balls of 1 kg on a ring with a free length of 1 m, one ball at 1 m/s.

    The run has ε = 0.9, k = 1e4 N/m and ten contacts.
    """
    scene = gr.Scene([1.0, 1.0], [0.1, 0.1], [0.3, 0.7], [1.0, 0.0], ring=True)
    return Run(scene, dashpots(scene, 0.9, 1e4), 16.0, "sequence")


def cradle(law: Any) -> Run:
    """Five touching balls of 1 kg, the first at 1 m/s."""
    scene = gr.Scene([1.0] * 5, [0.05] * 5, [0.0] * 4, [1.0, 0.0, 0.0, 0.0, 0.0])
    return Run(scene, (law,) * 4, 0.01, "last")


CASES: dict[str, tuple[str, str, dict[str, Run]]] = {
    "three-balls": (
        "A basketball and a tennis ball fall on a floor, 0.1 mm apart: the sequence of contacts.",
        "Müller & Pöschel, Phys. Rev. E 83, 041304 (2011), base scene", {"restitution 0.7": three_balls()}),
    "bouncing-sphere": (
        "A ball dropped on a floor: loss of rebound height by the finite contact duration.",
        "set-up: MFIX verification case DEM02", {
            **{f"k 5e5, restitution {eps}": dropped_ball(eps, 5e5) for eps in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)},
            "k 5e4, restitution 0.5": dropped_ball(0.5, 5e4)}),
    "squeezed-balls": (
        "Two balls squeezed between a floor and a ceiling: three simultaneous contacts.",
        "set-up: MFIX verification case DEM03", {"after 1 ms": squeezed_balls()}),
    "solitary-wave": (
        "Solitary wave in a long row of touching Hertz balls, F = A ξ^(3/2), m = A = 1: exact for the discrete row.",
        "English & Pego, Proc. Am. Math. Soc. 133, 1763 (2005), equation solved again", {}),
    "ring-of-two": (
        "Two balls on a ring collide ten times, alternately on either side.",
        "set-up: this project", {"restitution 0.9": ring()}),
    "touching-cradle": (
        "Newton's cradle of five touching balls: the final velocities depend on the force law.",
        "set-up: Herrmann & Schmälzle, Am. J. Phys. 49, 761 (1981)", {
            "springs": cradle(gr.LinearDashpot(1e6)), "Hertz": cradle(gr.Hertz(1e9))}),
}
CONVENTIONS = [
    "SI units. Heights and velocities are positive upwards (to the right). Body 0 is the lowest (leftmost) body.",
    "A mass of Infinity denotes a wall. Gaps are distances between surfaces, negative for overlaps, and exact.",
    "A pair with overlap ξ > 0 has the force k ξ + γ ξ̇ (LinearDashpot) or k ξ^(3/2) (Hertz), with ξ̇ > 0 on approach.",
    "Forces are clipped: F < 0 is replaced by 0, so a damped contact ends before its overlap ends.",
    "k and γ belong to the pair, not to a ball: no division by the effective mass, no springs in series.",
    "Walls do not attract and do not move. Time 0 is the time of the set-up. Pair c joins bodies c and c + 1 (on a "
    "ring the last pair joins the last body and body 0).",
]


def set_up(run: Run) -> dict[str, Any]:
    """Input of a run for another program.

    `tests/cases/test_verification.py` reads it as well.
    """
    scene = run.scene
    out: dict[str, Any] = {name: getattr(scene, name).tolist() for name in ("mass", "radius", "gap", "velocity")}
    laws = [{"type": type(law).__name__, **asdict(law)} for law in run.laws]
    return out | {"gravity": scene.gravity, "ring": scene.ring, "law": laws, "t_end": run.t_end}


def solved_answers(run: Run) -> list[dict[str, Any]]:
    """Answers with their condition numbers."""
    import mpmath

    conditions = run.conditions()
    return [{"quantity": name, "value": mpmath.nstr(mpmath.mpf(value), ANSWER_DIGITS, min_fixed=-4, max_fixed=6),
             "unit": unit, "digits": ANSWER_DIGITS, "condition": float(f"{conditions[name]:.2g}")}
            for name, (unit, value) in run.by_reference().items()]


def wave() -> list[dict[str, Any]]:
    """Answers about the solitary wave."""
    found = gr.waves.SolitaryWave(1.5)
    answers = {"speed (balls a second) over (largest overlap)^(1/4)": found.speed,
               "speed (balls a second) over (largest velocity)^(1/5)":
               found.speed / found.peak_velocity ** 0.2}
    answers |= {f"width of the force above {share:g} of its peak, in diameters": found.width(share)
                for share in (0.5, 0.01, 0.001)}
    return [{"quantity": name, "value": f"{value:.{WAVE_DIGITS}g}", "unit": "1", "digits": WAVE_DIGITS,
             "condition": 1.0} for name, value in answers.items()]


def main() -> None:
    """Write the file."""
    out: dict[str, Any] = {"conventions": CONVENTIONS, "cases": {}}
    for name, (about, source, runs) in CASES.items():
        print(name, flush=True)
        written_runs = {title: {"set-up": set_up(run), "answers": solved_answers(run)} for title, run in runs.items()}
        written_runs = written_runs or {"exponent 3/2": {"set-up": {"exponent": 1.5}, "answers": wave()}}
        out["cases"][name] = {"about": about, "source": source, "runs": written_runs}
    OUTPUT_PATH.write_text(json.dumps(out, indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    main()
