"""Results: energy, momentum, counting, files."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.run.trajectory import points

pytestmark = pytest.mark.core


@dataclass(frozen=True)
class OwnSpring:
    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi


@pytest.fixture
def soft():
    return gr.md.simulate(gr.scenes.newtons_cradle(4), gr.Hertz(1e9), t_end=1e-3, samples=20)


def test_energy_counts_overlaps(soft):
    np.testing.assert_allclose(soft.energy(), 0.5 * soft.scene.mass[0], rtol=1e-5)
    assert soft.gap.min() < 0.0


def test_energy_of_own_law_by_quadrature():
    run = gr.md.simulate(gr.scenes.newtons_cradle(3), OwnSpring(1e6), t_end=2e-3, samples=20)
    np.testing.assert_allclose(run.energy(), run.energy()[0], rtol=1e-4)


def test_energy_of_a_law_with_memory_is_not_invented():
    run = gr.md.simulate(gr.scenes.newtons_cradle(3), gr.WaltonBraun(1e6, 2e6), t_end=1e-3)
    assert math.isnan(run.energy()[-1])


def test_arrays_are_read_only(soft):
    with pytest.raises(ValueError, match="read-only"):
        soft.velocity[0, 0] = 1.0


def test_own_law_must_be_given_again(tmp_path):
    run = gr.md.simulate(gr.scenes.newtons_cradle(3), OwnSpring(1e6), t_end=1e-4)
    run.save(tmp_path / "run.npz")
    with pytest.raises(ValueError, match=r"law in the file is .*OwnSpring.*Pass load\(path, law=...\)"):
        gr.Trajectory.load(tmp_path / "run.npz")
    assert gr.Trajectory.load(tmp_path / "run.npz", law=OwnSpring(1e6)).law == (OwnSpring(1e6),) * 2


def test_unreadable_files_are_named(tmp_path):
    (tmp_path / "bad.npz").write_bytes(b"no archive")
    with pytest.raises(ValueError, match=r"written by Trajectory\.save, got .*bad\.npz"):
        gr.Trajectory.load(tmp_path / "bad.npz")
    with pytest.raises(OSError, match="none"):
        gr.Trajectory.load(tmp_path / "none.npz")


def test_repr_tells_the_outcome(soft):
    assert "Trajectory(md, Scene(4 balls)" in repr(soft)
    assert "time" in repr(soft)


def test_files_cut_short_or_foreign_are_named(tmp_path):
    path = tmp_path / "run.npz"
    gr.edmd.simulate(gr.scenes.three_balls(), gr.ConstantRestitution(0.7), t_end=0.1).save(path)
    whole = path.read_bytes()
    np.savez(tmp_path / "other.npz", a=1.0)
    np.savez(tmp_path / "words.npz", words=np.array("[1]"))
    np.save(tmp_path / "array.npy", np.arange(3))
    files = [tmp_path / name for name in ("other.npz", "words.npz", "array.npy")]
    for name, bytes_ in {"half": whole[: len(whole) // 2], "empty": b"", "text": b"hello",
                         "damaged": whole[:300] + bytes(6) + whole[306:]}.items():
        files.append(tmp_path / name)
        files[-1].write_bytes(bytes_)
    for file in files:
        with pytest.raises(ValueError, match="must be a complete file written by Trajectory\\.save") as caught:
            gr.Trajectory.load(file)
        assert "pickle" not in str(caught.value)


@pytest.mark.parametrize(("name", "resumable"), [("hard", True), ("soft", False)])
def test_files_without_a_number_of_their_format_load(name, resumable):
    """Written by the release before the number."""
    back = gr.Trajectory.load(Path(__file__).parents[1] / "reference" / f"older_{name}.npz")
    if resumable:
        run = gr.edmd.simulate(back.scene, back.rule, t_end=0.4, samples=4)
        onward, whole = gr.edmd.resume(back, t_end=0.8), gr.edmd.simulate(back.scene, back.rule, t_end=0.8)
        np.testing.assert_allclose(onward.position[-1], whole.position[-1], rtol=1e-13)
    else:
        run = gr.md.simulate(back.scene, back.law, until=gr.until.contact(0, 2), engine="plain")
        assert back.state == {}
    assert (back.status, len(back.contacts)) == (run.status, len(run.contacts))
    np.testing.assert_allclose(back.contacts["t_begin"], run.contacts["t_begin"], rtol=1e-13)
    np.testing.assert_allclose(back.velocity, run.velocity, rtol=1e-12)


def changed(path, arrays, **words):
    """A saved run with more in it."""
    with np.load(path) as file:
        stored = {name: file[name] for name in file.files}
    more = json.loads(str(stored.pop("words"))) | words
    np.savez(path, words=np.array(json.dumps(more)), **stored, **arrays)
    return path


def test_files_of_a_later_version_are_refused_by_name(tmp_path, soft):
    soft.save(tmp_path / "run.npz")
    with pytest.raises(ValueError, match=r"format of .*run\.npz must be an integer from 1 to \d+, got 99\. "
                                         "Read it with a later version"):
        gr.Trajectory.load(changed(tmp_path / "run.npz", {}, format=99))
    soft.save(tmp_path / "run.npz")
    path = changed(tmp_path / "run.npz", {}, watch=None, twist=1)
    with pytest.raises(ValueError, match=r"run\.npz' contains twist, watch, which this version cannot read"):
        gr.Trajectory.load(path)
    soft.save(tmp_path / "run.npz")
    path = changed(tmp_path / "run.npz", {"scene.twist": np.zeros(4)})
    with pytest.raises(
        ValueError, match=r"run\.npz' is not a valid run: it contains scene\.twist, which this version cannot read"
    ):
        gr.Trajectory.load(path)


def test_a_run_in_fixed_steps_has_no_state():
    run = gr.md.simulate(gr.scenes.bouncing_ball(), gr.Hertz(1e6), t_end=0.01, method="verlet")
    assert run.state == {}


@pytest.mark.parametrize("walls", [(False, False), (True, False), (False, True)])
def test_with_radii_taken_out_paths_are_those_of_the_run_from_whenever_its_rows_begin(walls):
    mass = [math.inf] * walls[0] + [1.0, 2.0] + [math.inf] * walls[1]
    radius = np.where(np.isinf(mass), 0.0, 0.1)
    shaken = {name: gr.walls.Sine(0.1, 2.0) for name, wall in zip(("floor", "ceiling"), walls, strict=True) if wall}
    scene = gr.Scene(mass, radius, [5.0] * (len(mass) - 1), [0.5] * len(mass), gravity=9.81, origin=3.0, **shaken)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), t_end=0.3, samples=[0.1, 0.2, 0.3])
    apart = run.position - points(run)
    assert np.ptp(apart, axis=0) == pytest.approx(0.0, abs=1e-14)
    assert np.diff(apart[0]) == pytest.approx(radius[:-1] + radius[1:], abs=1e-14)


@pytest.mark.parametrize("seed", range(4))
def test_the_account_of_walls_at_constant_speed_is_read_off_the_log(seed):
    """Two moving walls: work and what is dissipated against each collision by itself, and beside a wall driven so."""
    rng = np.random.default_rng(seed)
    m, v = [np.inf, *rng.uniform(0.5, 2.0, 3), np.inf], [0.2, *rng.normal(size=3), -0.1]
    scene = gr.Scene(m, [0.0] * 5, rng.uniform(0.5, 1.0, 4), v)
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=1.5, samples=7)
    account, rows = run.account(), run.contacts
    light = np.minimum(scene.mass[rows["pair"]], scene.mass[rows["pair"] + 1])
    heavy = np.maximum(scene.mass[rows["pair"]], scene.mass[rows["pair"] + 1])
    lost = 0.5 * (1.0 - 0.81) * light / (1.0 + light / heavy) * np.diff(rows["v_in"], axis=1)[:, 0] ** 2
    by_hand = [lost[rows["t_end"] <= t].sum() for t in run.time]
    np.testing.assert_allclose(account["dissipated"], by_hand, rtol=1e-12, atol=1e-13)
    still = gr.walls.Piecewise([0.0, 2.0], [[0.0], [0.0]])
    driven = gr.edmd.simulate(scene.replace(floor=still), gr.ConstantRestitution(0.9), t_end=1.5, samples=7).account()
    np.testing.assert_allclose(account["work"], driven["work"], rtol=1e-12, atol=1e-13)
    unlogged = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=1.5, samples=7, log=False)
    assert np.isnan(unlogged.account()["work"][-1]).all()
