"""Numbers of another program: taken in, and held against both engines; the page that shows how."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from tests.helpers.saved_scenes import FLOOR, LINE, RING

PAGE = Path(__file__).parents[2] / "docs/guide/other-codes.md"


@pytest.mark.parametrize("scene", [FLOOR, LINE, RING])
@pytest.mark.parametrize("by", ["position", "gap"])
def test_rows_come_back(scene, by):
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=0.1, samples=7)
    other = gr.Trajectory.from_arrays(scene, run.time, **{by: getattr(run, by)}, velocity=run.velocity)
    assert np.allclose(other.gap, run.gap, rtol=0.0, atol=1e-14)
    assert np.array_equal(other.velocity, run.velocity)
    shift = other.position - run.position  # gaps do not say where a free line is
    assert np.allclose(shift, shift[:, :1], atol=1e-14)
    assert by == "gap" or not shift.any()
    assert repr(other).startswith("Trajectory(from elsewhere, ")
    assert other.count(0) == 0
    assert other.force is None


ROWS = {"time": [0.0, 1.0], "position": np.zeros((2, 3)), "velocity": np.zeros((2, 3))}
WRONG = [
    ({"time": [1.0, 0.5]},
        r"`time\[1\]` must be a finite time in s, not before its predecessor, got 0\.5\. Sort the samples by "
        r"time\."),
    ({"time": [0.0, math.nan]},
        r"`time\[1\]` must be a finite time in s, not before its predecessor, got nan\. Sort the samples by "
        r"time\."),
    ({"time": []}, r"`time` must be an array of at least one time, got an empty array\."),
    ({"velocity": np.zeros((3, 2))},
        r"`velocity` must be an array of shape \(2, 3\), got an array of shape \(3, 2\)\. Give a row per time and "
        r"a column per body, walls included\."),
    ({"position": [[0, 0, 0], [0, math.inf, 0]]}, r"`position\[1, 1\]` must be a finite number, got inf\."),
    ({"velocity": 1j * np.zeros((2, 3))},
        r"`velocity` must be a table of numbers of shape \(2, 3\), got a value of type ndarray\."),
    ({"velocity": "fast"}, r"`velocity` must be a table of numbers of shape \(2, 3\), got a value of type str\."),
    ({"gap": np.zeros((2, 2))}, r"One of `position` and `gap` must be given, got both\."),
    ({"position": None}, r"One of `position` and `gap` must be given, got neither\."),
    ({"position": None, "gap": np.zeros((2, 3))},
        r"`gap` must be an array of shape \(2, 2\), got an array of shape \(2, 3\)\. Give a row per time and a "
        r"column per pair\."),
    ({"scene": 3}, r"`scene` must be a granular\.Scene, got 3\. Give the scene from which the other program"),
]


@pytest.mark.parametrize(("given", "sentence"), WRONG)
def test_wrong_rows_are_refused(given, sentence):
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.Trajectory.from_arrays(**{"scene": LINE} | ROWS | given)


LAW = gr.LinearDashpot(1e5, 30.0)
REPORT = gr.compare(LINE, LAW)


def verlet(samples, **given):
    run = gr.md.simulate(LINE, LAW, dt=1e-6, t_end=samples[-1], samples=samples, **given)
    return gr.Trajectory.from_arrays(LINE, run.time, position=run.position, velocity=run.velocity)


def test_each_engine_is_no_way_off_itself_and_verlet_a_little():
    times = np.linspace(0.0, 0.03, 40)
    ours = {"soft": gr.md.simulate(LINE, LAW, t_end=0.03, samples=times),
            "hard": gr.edmd.simulate(LINE, REPORT.rule, t_end=0.03, samples=times)}
    for engine, run in ours.items():
        assert not getattr(REPORT.against(run), engine).any()
        assert getattr(REPORT.against(run), {"soft": "hard", "hard": "soft"}[engine]).any()
    apart = REPORT.against(verlet(times))
    expected = (verlet(times).velocity - ours["soft"].velocity) / float(REPORT.units[0])
    assert np.array_equal(apart.soft, expected)
    assert 0.0 < np.abs(apart.soft).max() < 1e-2
    assert re.search(r"^ball 0, soft .* never$", str(apart), re.M)


def test_walls_have_no_difference_and_the_first_that_is_large_is_named():
    law = gr.LinearDashpot(1e5, 30.0)
    report = gr.compare(FLOOR, law, t_end=0.3)
    times = np.linspace(0.0, 0.3, 11)
    ours = gr.md.simulate(FLOOR, law, t_end=0.3, samples=times)
    velocity = ours.velocity.copy()
    velocity[4:, 2] += 0.02 * report.units[0]
    apart = report.against(gr.Trajectory.from_arrays(FLOOR, times, gap=ours.gap, velocity=velocity))
    assert np.isnan(apart.soft[:, 0]).all()
    assert np.allclose(apart.soft[4:, 2], 0.02)
    assert re.search(r"^ball 1, soft .*  never$", str(apart), re.M)
    assert re.search(rf"^ball 2, soft .*  from t = {times[4]:.9g} s$", str(apart), re.M)
    assert "ball 0" not in str(apart)


def test_it_is_said_from_when_on_for_both_engines_and_up_to_when_for_one_that_stopped():
    scene = gr.Scene([math.inf, 1.0, 2.0], [0.0] * 3, [0.1, 0.05], [0.0] * 3, 9.81)
    report = gr.compare(scene, gr.LinearDashpot(1e5, 100.0), t_end=3.0)
    assert report.hard.time[-1] < 1.0  # its collisions pile up
    times = np.linspace(0.0, 3.0, 31)
    ours = gr.md.simulate(scene, report.law, t_end=3.0, samples=times)
    lines = str(report.against(ours)).splitlines()
    table = lines.index("velocity difference from  U, m/s  last, U  largest, U  beyond 0.01 U")
    apart = report.against(ours).hard
    row = int(np.flatnonzero(np.isfinite(apart[:, 1]))[-1])
    late = times[np.flatnonzero(np.abs(apart[:, 1]) > 0.01)[0]]
    last, most = abs(apart[row, 1]), np.nanmax(np.abs(apart[:, 1]))
    assert re.fullmatch(rf"ball 1, hard +\S+ +{last:.3g} +{most:.3g}  from t = {late:.9g} s", lines[table + 1])
    assert re.fullmatch(r"ball 1, soft +\S+ +0 +0  never", lines[table + 2])
    assert re.fullmatch(rf"velocity of ball 1, m/s +{times[row]:.6g}( +\S+){{3}}", lines[table - 5])
    rows = gr.edmd.simulate(scene, report.rule, t_end=3.0, samples=times)
    early = gr.Trajectory.from_arrays(scene, times, gap=np.vstack([rows.gap, ours.gap[len(rows.time):]]),
                                      velocity=np.vstack([rows.velocity, ours.velocity[len(rows.time):]]))
    nearer = str(report.against(early)).splitlines()[table + 1]
    assert nearer.endswith(f"  not up to {times[row]:.6g} s")
    alone = report.against(gr.Trajectory.from_arrays(scene, [2.0], gap=ours.gap[20:21], velocity=ours.velocity[20:21]))
    assert re.search(r"^ball 1, hard .* nan +nan  not known$", str(alone), re.M)


def test_runs_that_cannot_be_compared():
    with pytest.raises(TypeError, match=r"`run` must be a granular.Trajectory, got \[1\]"):
        REPORT.against([1])
    run = gr.edmd.simulate(FLOOR, gr.ConstantRestitution(0.9), t_end=0.1)
    with pytest.raises(ValueError, match=r"`run` must be of the same scene: its mass must be \[1\.  2\.  0\.5\], "
                                         r"got \[inf  1\.  2\.\]\."):
        REPORT.against(run)
    with pytest.raises(ValueError, match=r"`run` must have laws or rules to be saved in this format, got a run "
                                         r"of another program\. Save it as \.csv or \.extxyz, or with to_xarray\(\)\."):
        gr.Trajectory.from_arrays(LINE, **ROWS).save("never.npz")


def test_the_page_from_a_dump_to_the_answer(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S)
    assert len([line for line in code[0].splitlines() if line.strip()]) <= 15
    lines = re.search(r"```text\n(ITEM.*?)```", PAGE.read_text(), re.S)[1].splitlines()[:8]
    scene = gr.Scene([0.6, 0.06, 0.6], [0.1] * 3, [1e-3, 1e-4], [1.0, 0.0, 0.0])
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]
    run = gr.md.simulate(scene, law, t_end=0.004, samples=41, dt=1e-7)
    with open("dump.txt", "w") as file:
        for k, (x, v) in enumerate(zip(run.position, run.velocity, strict=True)):
            print(*lines[:1], k * 1000, *lines[2:], sep="\n", file=file)
            print("ITEM: ATOMS id x vx", file=file)
            for i in (2, 0, 1):
                print(i + 1, x[i], v[i], file=file)
    names = {}
    for block in code:
        exec(block, names)
    said = capsys.readouterr().out
    assert "ball 2" in said
    assert re.search(r"```text\n(Yes: .*?)```", PAGE.read_text(), re.S)[1] in said
    assert float(np.abs(names["apart"].soft).max()) < 1e-2
    assert len(gr.load("run.nc").time) > 20
