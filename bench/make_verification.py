"""Make the reference answers for other people's codes: ``python -m bench.make_verification`` (some minutes).

Writes ``granular/studies/verification.json``: every answer from a solver of 34 digits, printed
with 17 (`bench.reference`), and its condition number κ = Σ |∂ln answer / ∂ln input| over all
inputs that are not 0, by central differences of the engine.
The solitary wave is the fixed point of `granular.waves`, right to 13 digits.
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
"""Relative step of the differences for condition numbers."""
ANSWER_DIGITS, WAVE_DIGITS = 17, 13
Numbers = dict[str, tuple[str, Any]]
"""Answers: the unit and the value of each quantity."""


@dataclass(frozen=True)
class Run:
    """One run of a case: where it starts, its laws, when it ends, and what is asked of it."""

    scene: gr.Scene
    laws: tuple[Any, ...]
    t_end: float
    asked: str

    def answers(self, contacts: Any, gap: Any, velocity: Any) -> Numbers:
        """What is asked, of a solution by the reference or by an engine."""
        return dict(ANSWER_KINDS[self.asked](self, contacts, gap, velocity))

    def by_engine(self) -> Numbers:
        """The answers of `granular.md`."""
        run = gr.md.simulate(self.scene, self.laws, t_end=self.t_end)
        return self.answers(rows(run), run.gap[-1], run.velocity[-1])

    def by_reference(self) -> Numbers:
        """The answers of the solver with 34 digits; with 28 they agree to 20."""
        solutions = (reference.solve(self.scene, self.laws, t_end=self.t_end, digits=digits) for digits in (34, 28))
        best, other = (self.answers(one.contacts, one.gap, one.velocity) for one in solutions)
        assert all(abs(value - other[name][1]) <= 1e-20 * abs(value) for name, (_, value) in best.items())
        return best

    def varied(self) -> Iterator[tuple[Run, Run]]:
        """This run with each of its numbers a little larger, and a little smaller."""
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
        """κ of every answer."""
        here, total = self.by_engine(), dict.fromkeys(self.by_engine(), 0.0)
        for up, down in self.varied():
            one, other = up.by_engine(), down.by_engine()
            for name in total:
                difference = float(one[name][1]) - float(other[name][1])
                total[name] += abs(difference) / (2.0 * RELATIVE_STEP * abs(float(here[name][1]) or math.inf))
        return total


@dataclass(frozen=True)
class Row:
    """A contact of an engine, as the reference has them."""

    pair: int
    t_begin: float
    t_end: float | None
    v_out: tuple[float, float] | None


def rows(run: gr.Trajectory) -> list[Row]:
    """The contacts of a run, by the names of the reference."""
    ended = np.isfinite(run.contacts["t_end"])
    return [Row(int(row["pair"]), float(row["t_begin"]), float(row["t_end"]) if done else None,
                tuple(map(float, row["v_out"])) if done else None)
            for row, done in zip(run.contacts, ended, strict=True)]


def sequence(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """Onset and end of every contact, and the velocities after it."""
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
    """The end of the last contact, and all velocities then."""
    yield "end of the last contact", ("s", max(row.t_end for row in contacts))
    for i, v in enumerate(velocity):
        yield f"velocity of ball {i} after it", ("m/s", v)


def bounce(run: Run, contacts: Any, gap: Any, velocity: Any) -> Iterator[tuple[str, tuple[str, Any]]]:
    """What a ball dropped on a floor does, and how much lower it rises than after an instantaneous bounce."""
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
    """Heights and velocities at the end."""
    height = run.scene.origin
    for i in range(1, len(run.scene.mass) - 1):
        height = height + run.scene.radius[i - 1] + gap[i - 1] + run.scene.radius[i]
        yield f"height of the centre of ball {i}", ("m", height)
        yield f"velocity of ball {i}", ("m/s", velocity[i])


ANSWER_KINDS = {"sequence": sequence, "last": last_contact, "bounce": bounce, "state": final_state}


def dashpots(scene: gr.Scene, restitution: float, k: float) -> tuple[Any, ...]:
    """Clipped dashpots of one k and ε in all pairs."""
    return tuple(gr.LinearDashpot.from_restitution(restitution, k=k, pair=pair) for pair in scene.pairs)


def unclipped_damping(restitution: float) -> float:
    """ζ = -ln ε / √(π² + ln² ε), by which codes without clipping choose a dashpot."""
    return -math.log(restitution) / math.hypot(math.pi, math.log(restitution))


def three_balls() -> Run:
    """The base scene of Müller & Pöschel, from the instant at which the lower ball touches the floor."""
    radius, v = np.array([0.0, 0.1, 0.01]), -math.sqrt(2.0 * 9.81 * 0.5)
    mass = [math.inf, *(900.0 * 4.0 / 3.0 * math.pi * r**3 for r in radius[1:])]
    scene = gr.Scene(mass, radius, [0.0, 1e-4], [0.0, v, v], 9.81)
    return Run(scene, dashpots(scene, 0.7, 5e7), 2e-3, "sequence")


def dropped_ball(restitution: float, k: float) -> Run:
    """A ball of 0.2 m and 2600 kg/m³ whose centre is 0.5 m above a floor."""
    mass = 2600.0 * math.pi / 6.0 * 0.2**3
    scene = gr.Scene([math.inf, mass], [0.0, 0.1], [0.4], [0.0, 0.0], 9.81)
    return Run(scene, dashpots(scene, restitution, k), 0.4, "bounce")


def squeezed_balls() -> Run:
    """Two balls of 1 mm between walls 1.8 mm apart, one above the other."""
    r, k, zeta = 5e-4, 1000.0, unclipped_damping(0.8)
    mass = [math.inf, *(rho * 4.0 / 3.0 * math.pi * r**3 for rho in (20000.0, 10000.0)), math.inf]
    scene = gr.Scene(mass, [0.0, r, r, 0.0], [-5e-5, -1e-4, -5e-5], [0.0] * 4, 9.81)
    laws = tuple(gr.LinearDashpot(k, 2.0 * zeta * math.sqrt(k * pair.m_eff)) for pair in scene.pairs)
    return Run(scene, laws, 1e-3, "state")


def ring() -> Run:
    """Two balls of 1 kg on a ring with 1 m of room, one at 1 m/s: ε = 0.9, k = 1e4 N/m, ten contacts."""
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
        "A ball is dropped on a floor: how much lower it rises because its contact lasts.",
        "set-up: MFIX verification case DEM02", {
            **{f"k 5e5, restitution {eps}": dropped_ball(eps, 5e5) for eps in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)},
            "k 5e4, restitution 0.5": dropped_ball(0.5, 5e4)}),
    "squeezed-balls": (
        "Two balls squeezed between a floor and a ceiling: three contacts at once.",
        "set-up: MFIX verification case DEM03", {"after 1 ms": squeezed_balls()}),
    "solitary-wave": (
        "The wave in a long row of touching Hertz balls, F = A ξ^(3/2), m = A = 1: exact for the discrete row.",
        "English & Pego, Proc. Am. Math. Soc. 133, 1763 (2005), equation solved anew", {}),
    "ring-of-two": (
        "Two balls on a ring meet ten times, on either side in turn.",
        "set-up: our own", {"restitution 0.9": ring()}),
    "touching-cradle": (
        "Newton's cradle of five balls that touch: who leaves how fast depends on the law.",
        "set-up: Herrmann & Schmälzle, Am. J. Phys. 49, 761 (1981)", {
            "springs": cradle(gr.LinearDashpot(1e6)), "Hertz": cradle(gr.Hertz(1e9))}),
}
CONVENTIONS = [
    "SI units; heights and velocities are positive upwards (to the right); body 0 is the lowest (the left one).",
    "A mass of Infinity is a wall. Gaps are between surfaces, negative where balls overlap; they are exact.",
    "F acts on a pair of overlap ξ > 0: LinearDashpot k ξ + γ ξ̇, Hertz k ξ^(3/2), where ξ̇ > 0 on approach.",
    "Forces are clipped: F < 0 counts as 0, so a damped contact ends before its overlap does.",
    "k and γ belong to the pair, not to a ball: no division by the effective mass, no springs in series.",
    "Walls pull on nobody and do not move; time 0 is that of the set-up; pair c joins bodies c and c + 1 (on a ring "
    "the last pair joins the last body and body 0).",
]


def set_up(run: Run) -> dict[str, Any]:
    """What another code needs to run it; read by `tests/test_verification.py` too."""
    scene = run.scene
    out: dict[str, Any] = {name: getattr(scene, name).tolist() for name in ("mass", "radius", "gap", "velocity")}
    laws = [{"type": type(law).__name__, **asdict(law)} for law in run.laws]
    return out | {"gravity": scene.gravity, "ring": scene.ring, "law": laws, "t_end": run.t_end}


def solved_answers(run: Run) -> list[dict[str, Any]]:
    """Answers with their conditions."""
    import mpmath

    conditions = run.conditions()
    return [{"quantity": name, "value": mpmath.nstr(mpmath.mpf(value), ANSWER_DIGITS, min_fixed=-4, max_fixed=6),
             "unit": unit, "digits": ANSWER_DIGITS, "condition": float(f"{conditions[name]:.2g}")}
            for name, (unit, value) in run.by_reference().items()]


def wave() -> list[dict[str, Any]]:
    """What is asked of the solitary wave."""
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
