"""E/E0, the energy that is left, hangs neither on where x = 0 is nor on radii; what a law holds and may change is asked
anew; and what commands and reports say where there is nothing, or too much, to say."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

import granular as gr
from granular.__main__ import main
from granular.comparison.outcome import energy_between_surfaces, energy_left
from granular.laws.kinds import hashable_contents


def dropped(radius, origin, force=None):
    return gr.Scene([math.inf, 1.0], [0.0, radius], [1.0], [0.0, 0.0], 9.81, origin, external_force=force)


@pytest.mark.parametrize("engine", ["hard", "soft"])
@pytest.mark.parametrize("force", [None, [0.0, -5.0]])
@pytest.mark.parametrize("origin", [0.0, -0.5, 100.0])
@pytest.mark.parametrize("radius", [1e-3, 0.5])
def test_of_one_bounce_the_square_of_the_restitution_is_left(radius, origin, force, engine) -> None:
    scene, end = dropped(radius, origin, force), gr.until.contact(0, 2)
    law = gr.LinearDashpot.from_restitution(0.7, k=1e7, pair=scene.pairs[0])
    run = (gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), until=end) if engine == "hard" else
           gr.md.simulate(scene, law, until=end))
    assert energy_left(run) == pytest.approx(0.49, abs=2e-13 * (1.0 + abs(origin)) if engine == "hard" else 1e-3)


def test_it_is_that_of_points_above_the_floor() -> None:
    rng = np.random.default_rng(5)
    scene = gr.Scene([math.inf, *rng.uniform(0.5, 2.0, 4)], [0.0, *rng.uniform(0.0, 0.1, 4)], rng.uniform(0.0, 0.3, 4),
                     [0.0, *rng.normal(size=4)], 9.81, 3.0)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=0.5, samples=7)
    m, v = scene.mass[1:], run.velocity[:, 1:]
    expected = 0.5 * v**2 @ m + 9.81 * m.sum() * gr.measures.height(run)
    assert energy_between_surfaces(run) == pytest.approx(expected, rel=1e-13)


@dataclass
class Box:
    g: float


@dataclass(frozen=True)
class Boxed:
    box: Box = field(hash=True)

    __hash__ = object.__hash__

    def force(self, xi, xi_dot, pair):
        return 1e6 * xi + self.box.g * xi_dot


Box.__hash__ = object.__hash__  # type: ignore[method-assign]


def test_a_law_that_holds_what_may_change_is_asked_anew() -> None:
    box = Box(100.0)
    law, pair = Boxed(box), gr.scenes.three_balls().pairs[1]
    weak = gr.binary.restitution(law, pair, 1.0)
    box.g = 500.0
    assert gr.binary.restitution(law, pair, 1.0) == gr.binary.restitution(Boxed(Box(500.0)), pair, 1.0) < 0.8 * weak
    assert hashable_contents(law) is None
    assert hashable_contents(gr.LinearDashpot(1e5, 1.0)) is not None


def test_balls_that_have_not_met_yet_rise() -> None:
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    whole = gr.compare(scene, law).rises
    assert gr.compare(scene, law, t_end=0.1).rises == pytest.approx(whole, rel=1e-9)


def test_a_threshold_of_no_gap_asks_where() -> None:
    with pytest.raises(ValueError, match="`between` must give the first and the last value of stiffness, such as "
                                         r"\(0\.5, 2\), got None\."):
        gr.threshold("three-balls", "stiffness")


def test_a_refused_end_is_no_change_of_order() -> None:
    def case(eps: float) -> gr.Case:
        scene = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.5], [0.0, 0.0], 9.81)
        return gr.Case(scene, gr.LinearDashpot(1e6), gr.ConstantRestitution(eps), until=gr.until.contact(0, 2))

    said = str(gr.sensitivity(case, "hard_v_rel", over="eps", uncertainty={"eps": 0.02}, eps=0.99))
    assert "there is no value above" in said
    assert "order of contacts changes" not in said


def told(capsys, *words):
    code = main(list(words))
    return code, capsys.readouterr()


def test_contacts_that_went_to_a_file_are_in_the_table(capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = [told(capsys, "run", "three-balls", "--engine", engine, *log)[1].out
             for engine in ("md", "edmd") for log in ((), ("--log", f"{engine}.npy"))]
    assert table[0] == table[1]
    assert table[2] == table[3]
    code, said = told(capsys, "run", "three-balls", "--log", "l.npy", "--save", "z.csv")
    assert code != 0
    assert "Leave out one of the two" in said.err
    assert not (tmp_path / "l.npy").exists()
    monkeypatch.setattr("granular.app.cli.one_scene.MAX_CONTACTS_READ", 2)
    assert f"contacts are in {tmp_path / 'm.npy'}" in told(capsys, "run", "three-balls", "--log", "m.npy")[1].out


def test_a_ball_at_rest_has_nothing_left(capsys) -> None:
    assert "energy left: 0 % of 0.0369" in told(capsys, "run", "bouncing-ball", "--engine", "edmd")[1].out
