"""One scene under both engines: `compare(scene, law) -> Comparison`. May this scene be event-driven?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import Any

import numpy as np

from granular import edmd, md, measures, outcome, theory, tie_rules, timing
from granular import until as stop
from granular.binary import LawRestitution, at_speed, restitution_of
from granular.laws.check import checked
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import resolved
from granular.measures import Overlap
from granular.outcome import SAME, PairOutcome
from granular.scene import Pair, Scene
from granular.trajectory import EARLY, Trajectory


@dataclass(frozen=True, eq=False)
class Comparison:
    """The discrepancy between hard and soft spheres for one scene; print it, `plot` it, save it with `to_json`.

    Attributes
    ----------
    scene : Scene
        The common start.
    law, rule : tuple, Any
        Force law per pair, and collision rule (the law's own restitution unless one was given).
    hard, soft : Trajectory
        The event-driven and the soft-sphere run.
    pairs : tuple of PairOutcome
        Contacts and separation speeds, pair by pair.
    twin : Trajectory
        EDMD from gaps shifted by 1e-12 of themselves: how far the scene can be predicted at all.
    followed : Trajectory
        The soft run without contacts that are rounding, those still running at its end followed to theirs.
    hard_options, soft_options : mapping
        Options of `granular.edmd.simulate` and `granular.md.simulate` with which the runs are made again, for details.
    """

    scene: Scene
    law: tuple[Any, ...]
    rule: Any
    until: stop.Until | None
    t_end: float | None
    hard: Trajectory
    soft: Trajectory
    twin: Trajectory
    pairs: tuple[PairOutcome, ...]
    followed: Trajectory
    hard_options: Mapping[str, Any]
    soft_options: Mapping[str, Any]

    @cached_property
    def impact_speed(self) -> float:
        """v₁ in m/s, the speed of the first collision of the hard spheres, `measures.impact_speed`; nan without."""
        return measures.impact_speed(self.counted[0])

    @cached_property
    def counted(self) -> tuple[Trajectory, Trajectory]:
        """The hard and the soft run without contacts that are rounding (`granular.measures.without_rounding`)."""
        return measures.counted(self.hard, self.soft)

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Contacts of neighbouring pairs that share a span of time in the soft run: why the engines differ."""
        return measures.overlapping(self.counted[1])

    @cached_property
    def measures(self) -> dict[str, float]:
        """The measures of `granular.measures` for these two runs."""
        hard, soft = self.counted
        hard_cm, soft_cm = (measures.mass_centre_restitution(run) for run in (hard, soft))
        return {
            "shared_impulse": measures.shared_impulse(self.soft),
            "crowding": measures.crowding(hard, self.law),
            "occupation": measures.occupation(soft),
            "distance": math.nan if self._early else measures.distance(self.followed, hard),
            "predictability": measures.distance(*self._shifted),
            "mass_centre_ratio": soft_cm / hard_cm if hard_cm and not self._early else math.nan,
            "lag": float(self.soft.time[-1] - self.hard.time[-1]),
        }

    @cached_property
    def groups(self) -> dict[str, float]:
        """Dimensionless groups of the scene at the speed of its first collision."""
        return measures.groups(self.scene, self.law, self.impact_speed)

    @cached_property
    def restitution_spec(self) -> tuple[float, ...]:
        """ε with which the hard balls of each pair collide, by the rule, at the speed of the first collision."""
        if isinstance(self.rule, LawRule) and self.rule.laws is self.law:
            return self.law_restitution
        rules = self.rule if isinstance(self.rule, (list, tuple)) else [self.rule] * len(self.pairs)
        return tuple(float(rule(self._speed, pair)) for rule, pair in zip(rules, self.scene.pairs, strict=True))

    @cached_property
    def law_restitution(self) -> tuple[float, ...]:
        """ε that the force law of each pair gives an isolated contact at the speed of the first collision.

        nan where such a contact does not end.
        """
        return tuple(resolved(self.law, self.scene).column(lambda law: _restitution(law, self._speed)).tolist())

    @cached_property
    def restitution_ratio(self) -> float:
        """ε_eff/ε_spec for floor and two balls of one ε, from the closed form of the paper; nan for other scenes."""
        eps = self.restitution_spec
        if not self._is_two_ball_drop() or max(eps) - min(eps) > 1e-9 or not self.impact_speed > 0.0:
            return math.nan
        v_rel = self.pairs[1].soft_v_rel
        if math.isnan(v_rel):
            return math.nan
        return theory.effective_restitution(v_rel, self.impact_speed) / eps[0]

    def effective_restitution(
        self, observable: Callable[[Trajectory], float] | None = None, resolution: int = 41
    ) -> tuple[float, ...]:
        """All common ε in [0, 1] with which EDMD gives the soft run's value of an observable.

        Parameters
        ----------
        observable : callable, optional
            Trajectory → float; default: the top pair's separation speed after its last contact.
        resolution : int
            Number of ε at which EDMD is run to find changes of sign.

        Returns
        -------
        tuple of float
            Empty: no ε does it. Several: it is not unique. EDMD is not continuous in ε where the number of
            collisions changes; a jump across the value is not a root and is left out.
        """
        from granular.effective import effective_restitution

        return effective_restitution(self, observable, resolution)

    @cached_property
    def error(self) -> float:
        """How far hard spheres are off, in speeds of the first collision: the one number that the verdict judges.

        error = max( max_i |u_i(soft) - u_i(hard)|, max_c |v′_c(soft) - v′_c(hard)| ) / v₁

        over all balls i, walls left out, and all pairs c. u_i is the velocity with which ball i leaves the last of its
        contacts that ends, the initial one without contacts; v′_c is the separation speed of pair c at the end of its
        last contact. A soft contact still running at the end of the run is followed to its own end, a contact that is
        rounding does not count, and what has no value, such as v′ of a contact that never ends, is left out. v₁ is
        `impact_speed`. Free fall and the lag of soft spheres do not enter.

        0 where nothing collides; nan where no contact comes to its end, and where a run did not get to its end, for
        nothing is claimed of it.
        """
        if self._early:
            return math.nan
        return self._in_impact_speeds(outcome.largest_difference(self.followed, self.counted[0]))

    @cached_property
    def tie_errors(self) -> dict[str, float]:
        """How far the answer of each other tie rule is from the hard run, as `error` says; empty without ties."""
        hard = self.counted[0]
        return {name: self._in_impact_speeds(outcome.largest_difference(run, hard))
                for name, run in self._other_answers.items()}  # fmt: skip

    @cached_property
    def shift_error(self) -> float:
        """How far hard spheres from gaps shifted by 1e-12 of themselves are from the hard run, as `error` says."""
        return self._in_impact_speeds(outcome.largest_difference(*self._shifted))

    @cached_property
    def unsettled_counts(self) -> Any:
        """Whether each pair collides another number of times under another tie rule, or from shifted gaps, (n-1,)."""
        twin, usual = (outcome.counts(run) for run in self._shifted)
        others = [outcome.counts(run) != outcome.counts(self.counted[0]) for run in self._other_answers.values()]
        return np.array([twin != usual, *others]).any(axis=0)

    @cached_property
    def only_timing(self) -> bool:
        """Whether counts differ only by contacts that fall on the other side of `t_end`.

        Soft spheres lag by about t_c per collision; so contacts that began within that lag of the end do not count.
        """
        hard, soft = self.counted
        return timing.same_but_for_timing(soft, hard, SAME * measures.fastest_approach(hard))

    @property
    def verdict(self) -> str:
        """One line: may this scene be event-driven?"""
        from granular.verdict import verdict

        return verdict(self)

    def __str__(self) -> str:
        from granular.report import table

        return table(self)

    def to_dict(self) -> dict[str, Any]:
        """All numbers with provenance, ready for JSON (nan becomes None)."""
        from granular.report import as_dict

        return as_dict(self)

    def to_json(self, path: str | PathLike[str]) -> None:
        """Write `to_dict` to a file, whole or not at all."""
        from granular import _files

        _files.write_json(path, self.to_dict())

    def plot(self, path: str | PathLike[str] | None = None) -> Any:
        """Draw contact timelines of both engines, forces and world lines; return the figure, or save it to `path`."""
        from granular.plot import comparison_figure

        return comparison_figure(self, path)

    def animate(self, path: str | PathLike[str], seconds: float = 9.0, fps: int = 25) -> None:
        """Write a film of both engines in slow motion, `seconds` long: ``.gif``, or ``.mp4`` where ffmpeg is there."""
        from granular.animation import animate

        animate(self, path, seconds=seconds, fps=fps)

    @property
    def _early(self) -> bool:
        return self.hard.status in EARLY or self.soft.status in EARLY

    @property
    def _speed(self) -> float:
        """A speed in m/s at which ε can be asked for."""
        return self.impact_speed if self.impact_speed > 0.0 else 1.0

    @cached_property
    def _shifted(self) -> tuple[Trajectory, Trajectory]:
        """The twin and the hard run, without contacts that are rounding or just at the end time."""
        return measures.before_the_end(measures.counted(self.twin, self.soft)[0], self.counted[0])

    @cached_property
    def _other_answers(self) -> dict[str, Trajectory]:
        runs = tie_rules.other_answers(self.hard, self.rule, self.hard_options)
        return {name: measures.counted(run, self.soft)[0] for name, run in runs.items()}

    def _in_impact_speeds(self, difference: float) -> float:
        return difference / self.impact_speed if self.impact_speed > 0.0 else 0.0

    def _is_two_ball_drop(self) -> bool:
        scene = self.scene
        return scene.n == 3 and bool(scene.is_wall[0]) and scene.velocity[1] == scene.velocity[2]


def compare(
    scene: Scene,
    law: Any,
    rule: Any = None,
    *,
    until: stop.Until | None = None,
    t_end: float | None = None,
    max_events: int = 1_000_000,
    ties: str = "left",
    seed: int = 0,
    method: str | None = None,
    dt: float | None = None,
    engine: str = "auto",
    on_progress: Callable[[float, int], object] | None = None,
) -> Comparison:
    """Run one scene as hard and as soft spheres and report where and why they part ways.

    Parameters
    ----------
    scene : Scene
        The common start; no overlaps.
    law : force law or sequence of them
        For the soft spheres, one or one per pair.
    rule : collision rule or sequence of them, optional
        For the hard spheres; default the law's own ε as a function of impact speed and pair.
    until, t_end : stop condition, float, optional
        When both engines stop; without either they run until nothing can follow.
    max_events : int
        Limit on the contacts of each run.
    ties : str
        What simultaneous hard-sphere collisions do; see `granular.edmd.simulate`.
    seed : int
        For ``ties="random"``.
    method : str, optional
        How Newton's equation is solved: "located" (every event to rounding, the default) or a fixed-step integrator.
    dt : float, optional
        Time step in s of a fixed-step integrator.
    engine : str
        "auto", "plain" or "compiled", of the soft spheres.
    on_progress : callable, optional
        ``on_progress(reached, count)`` of both engines, one after the other: time in s, and contacts so far.

    Returns
    -------
    Comparison
    """
    laws = checked(law, _check_scene(scene)).given
    used = _rule_of(laws, scene) if rule is None else rule
    end: dict[str, Any] = {"until": until, "t_end": t_end, "max_events": max_events}
    event_driven: dict[str, Any] = end | {"ties": ties, "seed": seed}
    hard = edmd.simulate(scene, used, **event_driven, on_progress=on_progress)
    twin = edmd.simulate(_nudged(scene), used, **event_driven)
    options: dict[str, Any] = {"method": method, "dt": dt, "engine": engine}
    soft = md.simulate(scene, laws, **end, **options, on_progress=on_progress)
    counted = measures.counted(hard, soft)
    followed = outcome.followed(counted[1], options)
    pairs = outcome.pair_outcomes(*counted, followed)
    return Comparison(scene, laws, used, until, t_end, hard, soft, twin, pairs, followed, event_driven, options)


class LawRule(LawRestitution):
    """The rule that a comparison makes out of force laws: it speaks of the law where that gives no ε in [0, 1]."""

    def __call__(self, speed: float, pair: Pair) -> float:
        eps = super().__call__(speed, pair)
        if not 0.0 <= eps <= 1.0 + 1e-9:  # rounding is the engine's business
            law = self.laws[pair.index]
            raise ValueError(
                f"law of pair {pair.index} is {law!r}: its restitution at {speed:g} m/s is {eps:.6g}, so no hard-sphere"
                " rule can be made of it; a law that repels and gives no energy is needed, or a rule of yours, rule=..."
            )
        return eps


def _rule_of(laws: tuple[Any, ...], scene: Scene) -> Any:
    rule = restitution_of(laws, scene)
    return LawRule(laws) if isinstance(rule, LawRestitution) else rule


def _restitution(law: PairLaw, speed: float) -> float:
    """ε of an isolated contact; nan if it does not end."""
    try:
        return at_speed(law, speed)
    except (ValueError, ArithmeticError):
        return math.nan


def _check_scene(scene: Any) -> Scene:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {scene!r}: a granular.Scene is needed, such as granular.scenes.three_balls().")
    return scene


def _nudged(scene: Scene) -> Scene:
    """Gaps shifted by 1e-12 of themselves (touching pairs by 1e-12 of the mean gap), with changing sign."""
    typical = float(scene.gap.mean()) or 1.0
    sign = np.where(np.arange(scene.n_pairs) % 2, -1.0, 1.0)
    shift = 1e-12 * np.where(scene.gap > 0.0, scene.gap * sign, typical)
    return scene.replace(gap=scene.gap + shift)
