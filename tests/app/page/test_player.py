"""The player of runs in a headless Chromium."""

import json

import granular as gr
from granular.app.page import player_page
from tests.app.page.driving import click, fresh, named, text, time_bar


def test_the_player_manages_a_thousand_balls(tab, tmp_path) -> None:
    scene = gr.scenes.gas(n=1000)
    run = gr.edmd.simulate(
        scene, gr.ConstantRestitution(0.9), t_end=5 * float(scene.gap.mean()), samples=500, engine="sorted"
    )
    player_page(tmp_path / "gas.html", [run, run], ["gas", "twin"])
    fresh(tab, (tmp_path / "gas.html").as_uri(), "drawn")
    assert "of 500 rows" in text(tab, ".honest")
    assert tab.run("document.querySelectorAll('canvas').length") == 8
    tab.key("End")
    assert time_bar(tab) == 2000
    tab.size(360, 740, mobile=True)
    assert tab.run("document.documentElement.scrollWidth") <= 360
    assert tab.complaints == []
    assert json.dumps(sorted(set(tab.requests))).count("http") == 0


def test_two_runs_share_one_scale_and_zoom_to_their_contacts(tab, tmp_path) -> None:
    scene, times = gr.scenes.three_balls(gap=1e-4), [0.001 * i for i in range(601)]
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    runs = [gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.6, samples=times),
            gr.md.simulate(scene, law, t_end=0.6, samples=times)]
    player_page(tmp_path / "two.html", runs, ["hard", "soft"], "Two balls")
    fresh(tab, (tmp_path / "two.html").as_uri(), "drawn")
    assert text(tab, ".player-title") == "Two balls"
    assert tab.run("document.querySelectorAll('.run-box.upright').length") == 2
    lefts = "[...document.querySelectorAll('.run-box')].map((box) => [...box.querySelectorAll('.over-time canvas')]"
    assert tab.run(lefts + ".map((c) => c.getBoundingClientRect().left)).every((l) => new Set(l).size === 1)")
    assert tab.run("document.querySelector('.slow').checked")
    click(tab, ".next")
    assert text(tab, ".time-now").endswith("µs")
    assert text(tab, ".time-now").startswith("0.318 s")
    tab.size(360, 740, mobile=True)
    for _ in range(8):
        assert len(text(tab, ".time-now")) < 30
        assert tab.run("document.documentElement.scrollWidth") <= 360
        click(tab, ".nearer")
    named(tab, "whole run")
    tab.run("{ const s = document.querySelector('.shown'); s.value = 2; s.dispatchEvent(new Event('change')); }")
    assert "0 is touching" in text(tab, ".lines-key")
    assert tab.complaints == []


def test_the_player_shows_motion_and_says_what_is_enlarged(tab, tmp_path) -> None:
    """A cradle stood still for 9 s, a gas was specks, and a column on a floor lay on its side."""
    rule, cradle, gas = gr.ConstantRestitution(0.95), gr.scenes.newtons_cradle(n=5, gap=1e-6), gr.scenes.gas(n=50)
    runs = [gr.edmd.simulate(cradle, rule, until=gr.until.separated(), samples=50),
            gr.edmd.simulate(gas, rule, t_end=float(gas.gap.mean()), samples=50),
            gr.edmd.simulate(gr.scenes.column(n=3), rule, t_end=1.0, samples=50)]
    told, upright = [], []
    tab.size(1280, 900)
    for run in runs:
        player_page(tmp_path / "motion.html", [run])
        fresh(tab, (tmp_path / "motion.html").as_uri(), "drawn")
        told.append(text(tab, ".now-key"))
        upright.append(tab.run("document.querySelectorAll('.run-box.upright').length"))
    assert told[0] == "balls now; displacements and overlaps × 50"
    assert told[1].startswith("balls now; smallest drawn × 3.")
    assert told[2] == "balls now"
    assert upright == [0, 0, 1]
    assert tab.complaints == []


def test_a_run_that_is_over_in_an_instant_is_shown(tab, tmp_path) -> None:
    """Touching hard balls pass a blow on at once: there was no scale of time, and the film was slowed infinitely."""
    run = gr.edmd.simulate(gr.scenes.newtons_cradle(3), gr.ConstantRestitution(1.0))
    assert run.time[-1] == run.time[0]
    player_page(tmp_path / "instant.html", [run])
    fresh(tab, (tmp_path / "instant.html").as_uri(), "drawn")
    assert "All of it is at one instant" in text(tab, ".honest")
    assert text(tab, ".slowdown") == "slowed 9 ×"
    assert tab.complaints == []


def test_a_driven_run_shows_the_work_of_its_walls(tab, tmp_path):
    scene = gr.scenes.bouncing_ball(0.01, plate=gr.walls.Sine.from_acceleration(2.0, 50.0))
    law = gr.LinearDashpot.from_restitution(0.5, k=1e5, pair=scene.pairs[0])
    run = gr.md.simulate(scene, law, t_end=0.1, method="verlet", dt=2e-5, samples=300)
    player_page(tmp_path / "plate.html", [run])
    fresh(tab, (tmp_path / "plate.html").as_uri(), "drawn")
    assert "work of the floor, J" in text(tab, ".facts")
    assert "dissipated, J" in text(tab, ".facts")
    assert tab.complaints == []
