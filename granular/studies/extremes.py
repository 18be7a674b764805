"""`stability`: methods on a scene that is made stiff, close, damped and unequal.

It shows which methods stay right, and which errors are reported.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass, replace
from os import PathLike
from typing import Any

import numpy as np

from granular._engine import check, files, signature
from granular._engine.progress import progress_callback
from granular._engine.reports import PAGE_WIDTH, Report, aligned, canvas, duration, number, style
from granular.cases.case import Case
from granular.laws.contact_law import resolve
from granular.md.fixed.integrators import INTEGRATORS
from granular.run.trajectory import EARLY_STATUSES, Trajectory
from granular.studies.frontier_methods import Task, contacts_of, errors
from granular.studies.frontiers import rounding_level
from granular.studies.reference_events import Reference
from granular.studies.sweeps.plan import make_plan
from granular.studies.sweeps.results import CELL_ERRORS
from granular.studies.sweeps.subject import SceneLike

STABILITY_METHODS = ("located", *INTEGRATORS)
STEPS_PER_CONTACT = (8, 32, 128)
"""Numbers of fixed steps per shortest contact of the given scene.

The default dt of the method is tried as well.
"""
POWER_OF_TEN = re.compile(r"\b1e([+-]\d+)")
MAX_STEPS = 200_000
"""Maximum number of steps of a run."""
VERDICT_SIGNS = {"flagged": "!", "wrong": "✗", "undecided": "?"}
SIGN_STYLES = {"!": ("black", "0.85", "flagged"), "✗": ("white", "black", "wrong without a warning"),
               "?": ("black", "white", "reference solution unknown")}
"""Colours of a sign and of its cell in the figure, and its text in the legend."""


def _with_scaled_stiffness(case: Case, factor: float) -> Case:
    """Return a case with stiffnesses multiplied by `factor`, and the same restitution.

    γ is scaled such that each impact keeps its restitution, for laws with known powers. Overlaps at the start are
    scaled such that the contact forces at the start do not change.
    """
    scene, laws = case.scene, _laws(case)
    powers = [(resolve(law, scene.pairs[0]).form or (0.0, 1.0, 0.0, 0.0))[1::2] for law in laws]
    stiffened = _with_scaled_law_fields(case, *(dict.fromkeys(("k", "k_load", "k_unload"), factor)
                           | {"gamma": factor ** ((1.0 + d) / (1.0 + p))} for p, d in powers))
    overlap_factors = [1.0 if new_law == law else factor ** (-1.0 / p)
                       for new_law, law, (p, _) in zip(_laws(stiffened), laws, powers, strict=True)]
    return replace(stiffened, scene=scene.replace(gap=np.where(scene.gap < 0.0, overlap_factors, 1.0) * scene.gap))


def _with_scaled_gaps(case: Case, factor: float) -> Case:
    """Return a case with the gaps between balls multiplied by `factor`.

    Overlaps do not change. Gaps at walls do not change either, because a ball dropped from height 0 would not fall.
    """
    scene = case.scene
    between_balls = ~np.logical_or(*scene.sides(scene.is_wall)) & (scene.gap > 0.0)
    return replace(case, scene=scene.replace(gap=np.where(between_balls, factor, 1.0) * scene.gap))


def _with_scaled_damping(case: Case, factor: float) -> Case:
    """Return a case with damping coefficients multiplied by `factor`."""
    return _with_scaled_law_fields(case, *[dict.fromkeys(("gamma", "alpha"), factor)] * len(_laws(case)))


def _with_scaled_masses(case: Case, factor: float) -> Case:
    """Return a case with the mass of every second ball multiplied by `factor`."""
    ball = np.isfinite(case.scene.mass)
    mass = np.where(ball & (np.cumsum(ball) % 2 == 0), factor, 1.0) * case.scene.mass
    return replace(case, scene=case.scene.replace(mass=mass))


EXTREME_AXES: Mapping[str, tuple[Callable[[Case, float], Case], tuple[float, ...]]] = {
    "stiffness": (_with_scaled_stiffness, (1e2, 1e4, 1e6, 1e8)), "gap": (_with_scaled_gaps, (1e-3, 1e-6, 0.0)),
    "damping": (_with_scaled_damping, (0.0, 0.1, 10.0, 100.0)), "mass": (_with_scaled_masses, (1e-3, 1e3, 1e6)),
}
"""Extremes by name: the function that returns the changed case, and its factors."""


@dataclass(frozen=True)
class Tried:
    """One run of one method.

    Attributes
    ----------
    scene : str
        Change of the scene, such as "gap × 0.001", or "as given".
    method : str
        The method.
    dt : float
        Time step in s, nan if the method chose it.
    error : float
        Largest error of velocities at the end of each pair's last contact, in units of the impact speed. nan if a pair
        has an ended contact in only one of the two runs, or if the run raised an exception. For "located", its own
        error estimate including rounding.
    contacts : int
        Number of contacts minus the right number.
    verdict : {"right", "flagged", "wrong", "undecided"}
        Flagged: not right, and a status, a warning or an exception reports it. Wrong: not right, without any report.
        Undecided: the reference is unknown.
    said : str
        Status and message, warnings, or the message of the exception.
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
        """Number of correct digits, or the sign of a verdict other than "right"."""
        return VERDICT_SIGNS.get(self.verdict) or str(min(16, int(-math.log10(max(self.error, 1e-16)))))


@signature.face
@dataclass(frozen=True, repr=False)
class Stability(Report):
    """Result of `stability`. Print it, draw it with `plot`, or save it with `to_json`.

    Attributes
    ----------
    title : str
        The scene.
    error : float
        Maximum error of velocities, in units of the impact speed, of a right result.
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
        """Return the runs of a method, on all scenes or on one such as "gap × 0.001"."""
        return [row for row in self.rows if row.method == method and scene in (None, row.scene)]

    def table(self) -> list[list[str]]:
        """Return the table of correct digits and signs, as rows of strings.

        It has one row per scene and one column per method, with one entry for each time step.
        """
        methods = list(dict.fromkeys(row.method for row in self.rows))
        return [["", *methods], *([scene, *("".join(f"{row.sign:>3}" for row in self.of(method, scene))
                                            for method in methods)]
                                  for scene in dict.fromkeys(row.scene for row in self.rows))]

    @style()
    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw the table, shaded by the number of correct digits.

        Returns the figure, or saves it to `path`.
        """
        from matplotlib.patches import Patch

        (_, *methods), *lines = self.table()
        ends = np.cumsum([0, *(len(cell.split()) for cell in lines[0][1:])])
        steps = [(*(f"1/{n}" for n in STEPS_PER_CONTACT), "default") if width > 1 else "–" for width in np.diff(ends)]
        changes = [POWER_OF_TEN.sub(lambda found: f"$10^{{{int(found[1])}}}$", line[0]) for line in lines]
        figure, ((axis,),) = canvas(PAGE_WIDTH, 1.5 + 0.18 * len(lines))
        signs = np.array([" ".join(line[1:]).split() for line in lines])
        digits = np.array([[int(sign) if sign.isdigit() else np.nan for sign in row] for row in signs])
        image = axis.pcolormesh(digits, cmap="Blues", vmin=0, vmax=20)
        for (y, x), sign in np.ndenumerate(signs):
            ink, paper, _ = SIGN_STYLES.get(sign, ("black" if digits[y, x] < 12 else "white", "none", ""))
            axis.fill_between([x, x + 1], y, y + 1, color=paper, lw=0)
            axis.text(x + 0.5, y + 0.55, sign, ha="center", va="center", fontsize=7.5, color=ink)
        axis.vlines(ends, 0, len(lines), color="black", lw=0.8)
        axis.set(xlim=(0, ends[-1]), xticks=np.arange(ends[-1]) + 0.5, ylim=(len(lines), 0),
                 yticks=np.arange(len(lines)) + 0.5, yticklabels=changes, ylabel="change of the scene",
                 xlabel=f"time step (units of the shortest contact as given, {duration(self.duration)})")
        axis.set_xticklabels([text for own in steps for text in own], rotation=90)
        names = axis.secondary_xaxis("top")
        names.set_xticks(0.5 * (ends[1:] + ends[:-1]),
                         [INTEGRATORS[name].label if name in INTEGRATORS else name for name in methods])
        for one in (axis, names):
            one.tick_params(length=0)
        figure.colorbar(image, ax=axis, label="correct digits of velocities", boundaries=np.arange(-0.5, 17.0),
                        ticks=range(0, 17, 4), pad=0.01)
        figure.legend(handles=[Patch(fc=paper, ec="0.5", lw=0.5, label=f"{sign}  {text}")
                               for sign, (_, paper, text) in SIGN_STYLES.items()], loc="outside lower center", ncols=3)
        return files.write_figure(path, figure, dpi=200)

    def _key(self) -> str:
        """Return the explanation of the columns and marks of the table."""
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
        """Table of correct digits, verdict counts, worst wrong runs and untried scenes."""
        wrong = sorted((row for row in self.rows if row.verdict == "wrong"), key=lambda row: -np.nan_to_num(row.error))
        lines = self.table() + [
            [name, *(str(sum(row.verdict == name for row in self.of(method))) for method in self.table()[0][1:])]
            for name in ("right", *VERDICT_SIGNS)
        ]
        notes = [f"wrong without a warning: {len(wrong)} of {len(self.rows)} runs"] + [
            f"  {row.method}, {row.scene}, dt = {number(row.dt, '.2g', 'default')}: error {row.error:.2g}, "
            f"{row.contacts:+d} contacts" for row in wrong[:8]
        ] + [f"not tried: {', '.join(name for name in self.left_out if self.left_out[name] == reason)}: {reason}"
             for reason in dict.fromkeys(self.left_out.values())]
        return "\n".join([self.title, "", aligned(lines, "<>"), "", *notes, "", self._key()])


@signature.face
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
    """Test all methods on stiffer, closer, more damped or unequal variants of a scene.

    Parameters
    ----------
    scene : str, path, callable, Case or Scene
        The scene, as in `granular.sweep`.
    axes : str or sequence of str
        Extremes to test, one at a time. Defaults to all. "stiffness": k × 1e2, 1e4, 1e6, 1e8. γ is scaled such that
        impacts keep their restitution: as k^½ for a dashpot, as k^((1+d)/(p+1)) for k ξ^p + γ ξ^d ξ̇. The contact
        forces at the start do not change. "gap": gaps between balls × 1e-3, 1e-6, 0. "damping": γ or α × 0, 0.1, 10,
        100. "mass": mass of every second ball × 1e-3, 1e3, 1e6.
    methods : str or sequence of str
        Methods to test, from located, verlet, symplectic-euler, rk4, gear5. Defaults to all of them.
    error : float
        Largest velocity error, in units of the impact speed, at which a result is "right". Defaults to 0.01.
    on_progress : callable, optional
        ``on_progress(reached, count)`` is called after each run with the fraction of finished runs and their number.
    progress : bool
        Whether to show the progress on standard error: as a bar after 2 s if tqdm is installed, otherwise as a line
        every 30 s. Defaults to False.
    **fixed
        Parameters of the scene, as in `granular.sweep`.

    Returns
    -------
    Stability
        Every run with its error, verdict and report.

    Raises
    ------
    TypeError, ValueError
        For misuse, and for a scene in which no contact ends.

    Notes
    -----
    The reference is the run of "located" with its default `tol`. Its error is estimated as E = max(1, c) e + r, with
    its `error_estimate` e and the scene's condition number c = r / 2.2e-16. r is the change of the velocities if gaps
    and velocities change by one unit in the last digit. If E is above `error`, or if the reference run ended early, the
    verdict is undecided.

    Fixed steps are 1/8, 1/32 and 1/128 of the shortest contact of the scene *as given*, for all its extremes. This
    represents a user who makes a scene stiffer and forgets to adapt the time step. The default step of a method is
    1/500 of the shortest expected contact. Fixed-step runs end after 200 000 steps and are then flagged.

    Errors compare the velocities after each pair's last contact, because runs do not end at the same time. If the
    numbers of contacts differ, these can be different contacts. `granular.frontier` measures errors against run time,
    with other solvers.

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
    plan, limit = make_plan(scene, {}, (), fixed), check.number("error", error, above=0.0)
    case = replace(original := plan.case(()), run={key: original.run[key] for key in original.run if key == "t_start"})
    with progress_callback(progress, on_progress, "runs") as callback:
        report_progress = callback or (lambda fraction, count: None)
        durations = _reference_run(case)[1].durations
        if not durations:
            raise ValueError(f"`scene` must have a contact that ends within the run, got {case.scene}.")
        variants = [("as given", _with_scaled_gaps, 1.0)] + [
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
        for index, (name, vary, factor) in enumerate(variants):
            try:
                changed = vary(case, factor)
                if index > 0 and changed.scene == case.scene and _laws(changed) == _laws(case):
                    raise ValueError("Neither the scene nor its laws change.")
                reference_run = _reference_run(changed)
                for i, setting in enumerate(settings, 1):
                    rows.append(_run_of_method(changed, (name, *setting), reference_run, limit))
                    report_progress((index + i / len(settings)) / len(variants), len(rows))
            except CELL_ERRORS as refusal:
                left_out[name] = str(refusal)
                report_progress((index + 1) / len(variants), len(rows))
    return Stability(plan.subject.title, limit, min(durations), tuple(rows), left_out)


def _laws(case: Case) -> list[Any]:
    """Return the force laws of a case as a list: one law, or one per pair."""
    return list(law) if isinstance(law := case.physics("md"), (list, tuple)) else [law]


def _with_scaled_law_fields(case: Case, *factors: Mapping[str, float]) -> Case:
    """Return a case whose force laws have fields multiplied by factors.

    Each law has one mapping from names of fields to factors. Fields that a law does not have are ignored.
    """
    if unknown := [law for law in _laws(case) if not is_dataclass(law)]:
        raise ValueError(f"`law` must be a dataclass, so that its numbers are known, got {unknown[0]!r}.")
    laws = [replace(law, **{name: factor * getattr(law, name)
                            for name, factor in law_factors.items() if hasattr(law, name)})
            for law, law_factors in zip(_laws(case), factors, strict=True)]
    return replace(case, law=laws if len(laws) > 1 else laws[0])


def _reference_run(case: Case) -> tuple[Trajectory, Reference, float]:
    """Return the located run, the reference made from it, and the reference's error.

    The error is in units of the impact speed. It is inf if the run ended early or no contact ended.
    """
    run = case.simulate("md", method="located")
    truth = Reference(contacts_of(run), float(run.time[-1]), run.status.name, "located")
    if run.status in EARLY_STATUSES or not truth.durations:
        return run, truth, math.inf
    level = rounding_level(Task(case.scene, tuple(run.law or ()), case.until, case.t_end, truth))
    return run, truth, max(1.0, level / float(np.finfo(float).eps)) * run.stats["error_estimate"] + level


def _run_of_method(case: Case, row: tuple[str, str, float], reference_run: tuple[Trajectory, Reference, float],
           limit: float) -> Tried:
    """Run a case with one method and one time step, and judge the result.

    Parameters
    ----------
    case : Case
        The changed case.
    row : (str, str, float)
        Change of the scene, method, and time step in s (nan for the default).
    reference_run : tuple
        Result of `_reference_run` for this case. For the method "located", it is the result itself.
    limit : float
        Maximum error of a right result, in units of the impact speed.
    """
    (run, truth, error), (_, method, dt), wrong_count = reference_run, row, False
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if method != "located":
            try:
                run = case.simulate("md", method=method, max_steps=MAX_STEPS, dt=None if math.isnan(dt) else dt)
            except CELL_ERRORS as refusal:
                return Tried(*row, math.nan, 0, "flagged", str(refusal))
            error, _, wrong_count = errors(truth, contacts_of(run), case.scene.n_pairs)
    warning_messages = [str(warning.message) for warning in caught if warning.category is RuntimeWarning]
    verdict = (
        "flagged" if run.status in EARLY_STATUSES else "undecided" if not reference_run[2] <= limit
        else "right" if error <= limit and not wrong_count else "flagged" if warning_messages else "wrong"
    )
    report = "; ".join([f"{run.status.name}: {run.message}", *warning_messages])
    return Tried(*row, error, len(run.contacts) - len(truth.contacts), verdict, report)
