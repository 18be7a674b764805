"""`stability`: methods on a scene that is made stiff, close, damped and unequal.

It shows which methods stay right, and which errors are reported.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import check, files
from granular._engine.progress import shown
from granular._engine.reports import HARD_COLOUR, PAGE, Report, aligned, canvas, number
from granular.cases.case import Case
from granular.laws.contact_law import resolve
from granular.md.fixed.integrators import INTEGRATORS
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.studies.frontier_methods import Task, contacts_of, errors
from granular.studies.frontiers import rounding_level
from granular.studies.reference_events import Reference
from granular.studies.sweeps.plan import planned
from granular.studies.sweeps.results import CELL_ERRORS
from granular.studies.sweeps.subject import SceneLike

STABILITY_METHODS = ("located", *INTEGRATORS)
STEPS_PER_CONTACT = (8, 32, 128)
"""Numbers of fixed steps per shortest contact of the given scene.

The method's own choice of dt is tried as well.
"""
MAX_STEPS = 200_000
"""Maximum number of steps of a run."""
VERDICT_SIGNS = {"flagged": "!", "wrong": "✗", "undecided": "?"}


def _stiffer(case: Case, factor: float) -> Case:
    """Multiply stiffnesses by `factor`, and keep the restitution of each impact.

    γ changes for laws with known powers. Pairs that are compressed at the start are compressed by the same forces.
    """
    scene, laws = case.scene, _laws(case)
    powers = [(resolve(law, scene.pairs[0]).form or (0.0, 1.0, 0.0, 0.0))[1::2] for law in laws]
    made = _scaled(case, *(dict.fromkeys(("k", "k_load", "k_unload"), factor)
                           | {"gamma": factor ** ((1.0 + d) / (1.0 + p))} for p, d in powers))
    less = [1.0 if new == law else factor ** (-1.0 / p) for new, law, (p, _) in zip(_laws(made), laws, powers,
                                                                                   strict=True)]
    return replace(made, scene=scene.replace(gap=np.where(scene.gap < 0.0, less, 1.0) * scene.gap))


def _closer(case: Case, factor: float) -> Case:
    """Multiply gaps between balls by `factor`. Overlaps, and gaps at walls, stay.

    A fall from height 0 would not be a fall.
    """
    scene = case.scene
    there = ~np.logical_or(*scene.sides(scene.is_wall)) & (scene.gap > 0.0)
    return replace(case, scene=scene.replace(gap=np.where(there, factor, 1.0) * scene.gap))


def _damped(case: Case, factor: float) -> Case:
    """Multiply damping coefficients by `factor`."""
    return _scaled(case, *[dict.fromkeys(("gamma", "alpha"), factor)] * len(_laws(case)))


def _unequal(case: Case, factor: float) -> Case:
    """Multiply the mass of every second ball by `factor`."""
    ball = np.isfinite(case.scene.mass)
    mass = np.where(ball & (np.cumsum(ball) % 2 == 0), factor, 1.0) * case.scene.mass
    return replace(case, scene=case.scene.replace(mass=mass))


EXTREME_AXES: Mapping[str, tuple[Callable[[Case, float], Case], tuple[float, ...]]] = {
    "stiffness": (_stiffer, (1e2, 1e4, 1e6, 1e8)), "gap": (_closer, (1e-3, 1e-6, 0.0)),
    "damping": (_damped, (0.0, 0.1, 10.0, 100.0)), "mass": (_unequal, (1e-3, 1e3, 1e6)),
}
"""Extremes: function and factors."""


@dataclass(frozen=True)
class Tried:
    """One run of one method.

    Attributes
    ----------
    scene : str
        Change of the scene, such as "gap × 0.001", or "as given".
    method, dt : str, float
        Method, and its time step in s, nan if the method chose it.
    error : float
        Largest error of velocities at the end of each pair's last contact, in units of the impact speed. nan if a pair
        has no contact that ended. For "located" its own estimate, with rounding.
    contacts : int
        Number of contacts minus the right number.
    verdict : {"right", "flagged", "wrong", "undecided"}
        Flagged: not right, and a status, a warning or a refusal reports it. Wrong: not right, without any report.
        Undecided: the reference is unknown.
    said : str
        Status and message, warnings, or the refusal.
    """

    scene: str
    method: str
    dt: float
    error: float
    contacts: int
    verdict: str
    said: str

    @property
    def sign(self) -> str:
        """Number of right digits, or the sign of the verdict."""
        return VERDICT_SIGNS.get(self.verdict) or str(min(16, int(-math.log10(max(self.error, 1e-16)))))


@check.face
@dataclass(frozen=True, repr=False)
class Stability(Report):
    """Result of `stability`. Print it, draw it with `plot`, save it with `to_json`.

    Attributes
    ----------
    title : str
        The scene.
    error : float
        Largest error of velocities, in units of the impact speed, that is called right.
    duration : float
        Shortest contact of the given scene in s. Time steps are fractions of it.
    rows : tuple of Tried
        Every run.
    left_out : mapping
        Scenes that were not tried, with the reason.
    """

    title: str
    error: float
    duration: float
    rows: tuple[Tried, ...]
    left_out: Mapping[str, str]

    def of(self, method: str, scene: str | None = None) -> list[Tried]:
        """Return the runs of a method, for one scene such as "gap × 0.001" if given."""
        return [row for row in self.rows if row.method == method and scene in (None, row.scene)]

    def table(self) -> list[list[str]]:
        """Return the table: a line per scene with digits or verdict of methods and steps."""
        methods = list(dict.fromkeys(row.method for row in self.rows))
        return [["", *methods], *([scene, *("".join(f"{row.sign:>3}" for row in self.of(method, scene))
                                            for method in methods)]
                                  for scene in dict.fromkeys(row.scene for row in self.rows))]

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the table with right digits as shades. Return the figure, or save it."""
        (_, *methods), *lines = self.table()
        ends = np.cumsum([0, *(len(words.split()) for words in lines[0][1:])])
        figure, ((axis,),) = canvas(PAGE, 0.95 + 0.18 * len(lines))
        blues = check.optional("matplotlib", "plot").colormaps["Blues_r"](np.linspace(0.95, 0.0, 30))
        colours = dict(zip(map(str, range(17)), blues, strict=False)) | {"!": "0.85", "✗": HARD_COLOUR}
        for (y, x), sign in np.ndenumerate(np.array([" ".join(line[1:]).split() for line in lines])):
            axis.fill_between([x, x + 1], y, y + 1, color=colours.get(sign, "white"), lw=0)
            axis.text(x + 0.5, y + 0.55, sign, ha="center", va="center", fontsize=7.5)
        axis.vlines(ends, 0, len(lines), color="black", lw=0.8)
        axis.tick_params(length=0, labeltop=True, labelbottom=False, labelsize=8)
        axis.set(xlim=(0, ends[-1]), xticks=0.5 * (ends[1:] + ends[:-1]), xticklabels=methods, ylim=(len(lines), 0),
                 yticks=np.arange(len(lines)) + 0.5, yticklabels=[line[0] for line in lines])
        figure.suptitle(f"{self.title}: {self._key()}", fontsize=7.5, x=0.01, ha="left")
        return files.write_figure(path, figure, dpi=150)

    def _key(self) -> str:
        return (
            "correct digits of the velocities, relative to the impact speed\n"
            f"fixed steps: {', '.join(f'1/{n}' for n in STEPS_PER_CONTACT)} of the shortest contact of the given "
            f"scene, {self.duration:.3g} s, and the default of the method\n"
            "! flagged by a status or a warning\n"
            f"✗ wrong without a warning: error above {self.error:g}, or another number of contacts\n"
            "? the reference solution is not known either"
        )

    def _numbers(self) -> dict[str, Any]:
        return {**vars(self), "rows": [asdict(row) for row in self.rows]}

    def __str__(self) -> str:
        wrong = sorted((row for row in self.rows if row.verdict == "wrong"), key=lambda row: -np.nan_to_num(row.error))
        lines = self.table() + [
            [name, *(str(sum(row.verdict == name for row in self.of(method))) for method in self.table()[0][1:])]
            for name in ("right", *VERDICT_SIGNS)
        ]
        told = [f"wrong without a warning: {len(wrong)} of {len(self.rows)} runs"] + [
            f"  {row.method}, {row.scene}, dt = {number(row.dt, '.2g', 'default')}: error {row.error:.2g}, "
            f"{row.contacts:+d} contacts" for row in wrong[:8]
        ] + [f"not tried: {', '.join(name for name in self.left_out if self.left_out[name] == why)}: {why}"
             for why in dict.fromkeys(self.left_out.values())]
        return "\n".join([self.title, "", aligned(lines, "<>"), "", *told, "", self._key()])


@check.face
def stability(
    scene: SceneLike,
    axes: str | Sequence[str] = tuple(EXTREME_AXES),
    methods: str | Sequence[str] = STABILITY_METHODS,
    *,
    error: float = 0.01,
    on_progress: Callable[[float, int], object] | None = None,
    progress: bool = False,
    **fixed: Any,
) -> Stability:
    """Make a scene stiff, close, damped and unequal, and test all methods on it.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    axes : str or sequence of str
        Extremes, one after the other: "stiffness" (k × 1e2 … 1e8, γ such that impacts keep their restitution: k^½ of a
        dashpot, k^((1+d)/(p+1)) under k ξ^p + γ ξ^d ξ̇. Pairs compressed at the start are compressed by the same
        forces), "gap" (between balls that are apart, × 1e-3, 1e-6, 0), "damping" (γ or α × 0, 0.1, 10, 100), "mass"
        (of every second ball, × 1e-3, 1e3, 1e6).
    methods : str or sequence of str
        Some of located, verlet, symplectic-euler, rk4, gear5.
    error : float
        Largest error of velocities, in units of the impact speed, that is called right.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called after each run with the share of finished runs and their number.
    progress : bool
        Show the progress on standard error after 2 s, as a bar if tqdm is installed.
    **fixed
        Parameters of the scene, as in `granular.sweep`.

    Returns
    -------
    Stability
        Every run: right and its error, flagged and the report, or wrong without a report.

    Raises
    ------
    TypeError, ValueError
        For misuse, and for a scene in which no contact ends.

    Notes
    -----
    The reference is the run of "located" with its default `tol`. Its error is taken to be E = max(1, c) e + r, with its
    `error_estimate` e and the scene's condition number c = r / 2.2e-16. r is the change of the velocities if gaps and
    velocities change by one unit in the last digit. If E is above `error`, or the reference did not end, the verdict is
    undecided.

    Fixed steps are 1/8, 1/32 and 1/128 of the shortest contact of the scene *as given*, for all its extremes, as if a
    user makes a scene stiffer and forgets the time step. The method's own choice is 1/500 of the shortest expected
    contact. Runs end after 200 000 steps, flagged. Errors compare the velocities after each pair's last contact,
    because runs do not end at the same time. If the numbers of contacts differ, these may be different contacts.
    `granular.frontier` measures errors against run time, with other solvers.

    Examples
    --------
    >>> import granular as gr
    >>> report = gr.stability("three-balls", axes="stiffness", methods=("located", "verlet"))
    >>> report.of("located", "stiffness × 1e+08")[0].verdict
    'right'
    """
    chosen, extreme = (
        check.choices("methods", methods, STABILITY_METHODS, 1),
        check.choices("axes", axes, tuple(EXTREME_AXES)),
    )
    plan, limit = planned(scene, {}, (), fixed), check.number("error", error, above=0.0)
    case = replace(given := plan.case(()), run={key: given.run[key] for key in given.run if key == "t_start"})
    with shown(progress, on_progress, "runs") as told:
        tell = told or (lambda share, count: None)
        durations = _judged(case)[1].durations
        if not durations:
            raise ValueError(f"`scene` must have a contact that ends within the run, got {case.scene}.")
        todo = [("as given", _closer, 1.0)] + [
            (f"{axis} × {factor:g}", EXTREME_AXES[axis][0], factor)
            for axis in extreme
            for factor in EXTREME_AXES[axis][1]
        ]
        rows, left_out, steps = (
            list[Tried](),
            dict[str, str](),
            [*(min(durations) / n for n in STEPS_PER_CONTACT), math.nan],
        )
        settings = [(method, dt) for method in chosen for dt in (steps if method in INTEGRATORS else steps[-1:])]
        for done, (name, vary, factor) in enumerate(todo):
            try:
                one = vary(case, factor)
                if done > 0 and one.scene == case.scene and _laws(one) == _laws(case):
                    raise ValueError("Neither the scene nor its laws change.")
                judged = _judged(one)
                for i, setting in enumerate(settings, 1):
                    rows.append(_tried(one, (name, *setting), judged, limit))
                    tell((done + i / len(settings)) / len(todo), len(rows))
            except CELL_ERRORS as refusal:
                left_out[name] = str(refusal)
                tell((done + 1) / len(todo), len(rows))
    return Stability(plan.subject.title, limit, min(durations), tuple(rows), left_out)


def _laws(case: Case) -> list[Any]:
    """Return the force laws as they were given: one, or one per pair."""
    return list(law) if isinstance(law := case.physics("md"), (list, tuple)) else [law]


def _scaled(case: Case, *factors: Mapping[str, float]) -> Case:
    """Multiply numbers of the laws, by name."""
    if fixed := [law for law in _laws(case) if not is_dataclass(law)]:
        raise ValueError(f"`law` must be a dataclass, so that its numbers are known, got {fixed[0]!r}.")
    laws = [replace(law, **{name: factor * getattr(law, name) for name, factor in own.items() if hasattr(law, name)})
            for law, own in zip(_laws(case), factors, strict=True)]
    return replace(case, law=laws if len(laws) > 1 else laws[0])


def _judged(case: Case) -> tuple[Trajectory, Reference, float]:
    """Return the located run, the reference that it defines, and its error.

    The error is in units of the impact speed. It is inf if the run ended early.
    """
    run = case.simulate("md", method="located")
    truth = Reference(contacts_of(run), float(run.time[-1]), run.status.name, "located")
    if run.status in EARLY_STATUSES or not truth.durations:
        return run, truth, math.inf
    level = rounding_level(Task(case.scene, tuple(run.law or ()), case.until, case.t_end, truth))
    return run, truth, max(1.0, level / float(np.finfo(float).eps)) * run.stats["error_estimate"] + level


def _tried(case: Case, row: tuple[str, str, float], judged: tuple[Trajectory, Reference, float],
           limit: float) -> Tried:
    """Return a run of a method at a step with its report.

    The reference has been run already.
    """
    (run, truth, error), (_, method, dt), other = judged, row, False
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        if method != "located":
            try:
                run = case.simulate("md", method=method, max_steps=MAX_STEPS, dt=None if math.isnan(dt) else dt)
            except CELL_ERRORS as refusal:
                return Tried(*row, math.nan, 0, "flagged", str(refusal))
            error, _, other = errors(truth, contacts_of(run), case.scene.n_pairs)
    warned = [str(one.message) for one in heard if one.category is RuntimeWarning]
    verdict = (
        "flagged" if run.status in EARLY_STATUSES else "undecided" if not judged[2] <= limit
        else "right" if error <= limit and not other else "flagged" if warned else "wrong"
    )
    said = "; ".join([f"{run.status.name}: {run.message}", *warned])
    return Tried(*row, error, len(run.contacts) - len(truth.contacts), verdict, said)
