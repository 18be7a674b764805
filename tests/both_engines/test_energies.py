"""Energy that each contact dissipates, ∫ F ξ̇ dt, against independent quadrature and the energy balance."""

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import granular as gr
from granular.laws.kinds import resolved
from granular.md.fixed.run import Run as FixedRun
from granular.md.located.run import Run as LocatedRun
from granular.run.contact_log import CONTACT
from tests.helpers import scenes_at_random as draw

THREE = gr.scenes.three_balls(gap=1e-4)
BASE = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in THREE.pairs]


def stored(run, row):
    """Elastic energy of all overlaps at a sample in J."""
    laws = resolved(run.law, run.scene)
    return math.fsum(laws[c].energy(max(0.0, -float(run.gap[row, c]))) for c in range(run.scene.n_pairs))


def imbalance(run):
    """Sum of the energies of all contacts minus the loss in the energy balance, relative to the energies of the run."""
    account, balls = run.account(), ~run.scene.is_wall
    lost = account["dissipated"][-1] - account["heat"][-1].sum()
    if run.law is not None:
        lost += stored(run, -1) - stored(run, 0)
    kinetic = 0.5 * (run.velocity[:, balls] ** 2 @ run.scene.mass[balls])
    scale = max(kinetic.max(), abs(lost), np.abs(account["work"]).max(), 1e-300)
    return abs(math.fsum(run.dissipated) - lost) / scale


def closing(log):
    """Signed closing rates before and after each contact."""
    return log["v_in"] @ (1.0, -1.0), log["v_out"] @ (1.0, -1.0)


@pytest.mark.rotating
@pytest.mark.parametrize("name", [name for name in draw.LAWS if name not in ("Walton-Braun", "own with memory")])
@pytest.mark.parametrize("seed", range(4))
def test_the_sum_is_what_the_energy_balance_loses(name, seed):
    """Touching, overlapping and flying balls with all kinds of laws, up to an instant at which some may overlap."""
    rng = np.random.default_rng([53, seed])
    scene = draw.scene(rng, (2, 4), walls=(0.5, 0.3, 0.3), gaps=draw.ALL)
    law = draw.laws(rng, scene, [name], (3.0, 6.0))
    run = gr.md.simulate(scene, law, t_end=0.1, engine="plain", max_steps=400)
    assert imbalance(run) <= 1e-12


@pytest.mark.parametrize("law", [gr.WaltonBraun(1e5, 2e5), draw.LAWS["own with memory"](1e5, 0.0, 1.0)])
def test_the_sum_for_laws_with_memory(law):
    run = gr.md.simulate(gr.scenes.newtons_cradle(4), law, t_end=0.5, engine="plain")
    assert len(run.contacts) >= 3
    assert (run.gap[-1] > 0.0).all()
    assert imbalance(run) <= 1e-12
    assert (run.dissipated > 0.0).all()


def scenes_of_special_kinds():
    rng = np.random.default_rng(7)
    falling = gr.Scene([math.inf, 1.0, 0.5], [0.0, 0.05, 0.05], [1e-3, 1e-4], [0.0, -1.0, -1.0], 9.81)
    driven = draw.driven(rng, falling, 0.2)
    hot = gr.Scene([math.inf, 1.0, 2.0, math.inf], [0.0, 0.05, 0.05, 0.0], [1e-3, 1e-4, 0.02], [0.0, 1.0, -1.0, 0.0],
                   floor=gr.walls.Thermal(1.0, 3))
    ring = gr.Scene([1.0, 2.0, 1.5, 0.7], [0.05] * 4, [1e-3, 1e-5, 0.02, 0.05], [1.0, -1.0, 0.3, 0.0], ring=True)
    pushed = gr.Scene([1.0, 2.0, math.inf], [0.05, 0.05, 0.0], [1e-4, 1e-3], [1.0, 0.0, 0.0],
                      external_force=[5.0, 2.0, 0.0])
    return {"driven": (driven, {}), "driven, ignored": (driven, {"disturbed": "ignore"}), "thermal": (hot, {}),
            "ring": (ring, {}), "pushed": (pushed, {}), "pendula": (gr.scenes.pendulum_cradle(3), {}),
            "stopped": (THREE, {"until": gr.until.speed(2, above=4.0)})}


@pytest.mark.rotating
@pytest.mark.parametrize("kind", scenes_of_special_kinds())
def test_the_sum_in_scenes_of_every_kind(kind):
    scene, options = scenes_of_special_kinds()[kind]
    t_end = 1.2 if kind == "pendula" else 0.4 if kind == "stopped" else 0.2
    run = gr.md.simulate(scene, gr.TsujiHertz(1e8, 0.3), t_end=t_end, engine="plain", **options)
    assert len(run.contacts)
    assert imbalance(run) <= 1e-12


@pytest.mark.rotating
@pytest.mark.parametrize(("law", "accuracy"), [
    (gr.LinearDashpot(1e6, 100.0), 1e-12), (gr.Hertz(1e8), 1e-12), (gr.ViscoelasticHertz(1e8, 1e4), 1e-12),
    (gr.TsujiHertz(1e8, 0.3), 1e-12), (draw.Stiffening(1e6, 1e9, 100.0), 1e-12),
], ids=lambda law: type(law).__name__)
def test_each_contact_against_scipy(law, accuracy):
    """Three balls of which two touch: the equations of motion and the energies of both pairs, from event to event."""
    scene = gr.Scene([1.0, 0.6, 0.3], [0.05] * 3, [1e-4, 0.0], [1.0, 0.0, 0.0])
    run = gr.md.simulate(scene, law, t_end=0.05, engine="plain")
    log, pairs, m = run.contacts, list(scene.pairs), scene.mass
    assert run.stats["isolated"] < len(log)

    def slope(t, y):
        """Positions, velocities and energies, with the forces of the pairs in contact between two events."""
        x, v = y[:3], y[3:6]
        xi, rate = -(x[1:] - x[:-1]), v[:-1] - v[1:]
        force = [max(0.0, law.force(max(xi[c], 0.0), rate[c], pairs[c])) if active[c] else 0.0 for c in range(2)]
        push = -force[0], force[0] - force[1], force[1]
        return [*v, *(push / m), force[0] * rate[0], force[1] * rate[1]]

    events = np.unique([0.0, *log["t_begin"], *log["t_end"]])
    y, found = np.array([0.0, scene.gap[0], scene.gap[:2].sum(), *scene.velocity, 0.0, 0.0]), np.zeros(len(log))
    for start, end in pairwise(events):
        middle = 0.5 * (start + end)
        active = [((log["pair"] == c) & (log["t_begin"] < middle) & (log["t_end"] > middle)).any() for c in range(2)]
        before = y[6:].copy()
        y = solve_ivp(slope, (start, end), y, "DOP853", rtol=2.3e-14, atol=1e-17, max_step=(end - start) / 40).y[:, -1]
        for c in range(2):
            found[(log["pair"] == c) & (log["t_begin"] < middle) & (log["t_end"] > middle)] += y[6 + c] - before[c]
    assert run.dissipated == pytest.approx(found, rel=0.0, abs=accuracy * 0.5)


def test_where_contacts_overlap_the_speeds_of_the_pair_do_not_give_the_energy():
    run = gr.md.simulate(THREE, BASE, until=gr.until.contact(pair=0, nth=2), engine="plain")
    energies, (w_in, w_out) = run.dissipated, closing(run.contacts)
    by_speeds = 0.5 * THREE.pairs.m_eff[run.contacts["pair"]] * (w_in**2 - w_out**2)
    assert imbalance(run) <= 1e-14
    assert (round(energies[0], 3), round(by_speeds[0], 3)) == (9.445, 9.433)


def test_an_isolated_contact_has_the_closed_form():
    scene = gr.Scene([2.0, 3.0], [0.05, 0.05], [0.01], [1.0, -1.0])
    for eps in (0.3, 0.9, 1.0):
        law = gr.LinearDashpot.from_restitution(eps, 1e6, scene.pairs[0])
        run = gr.md.simulate(scene, law, t_end=0.1, engine="plain")
        expected = 0.5 * scene.pairs.m_eff[0] * 4.0 * (1.0 - eps * eps)
        assert run.dissipated == pytest.approx([expected], rel=1e-14, abs=1e-15)


def test_a_contact_that_begins_overlapped_gives_energy():
    scene = gr.Scene([1.0, 1.0], [0.05, 0.05], [-1e-3], [0.0, 0.0])
    run = gr.md.simulate(scene, gr.LinearDashpot(1e6), t_end=0.1, engine="plain")
    assert run.dissipated == pytest.approx([-0.5], rel=1e-14)
    assert run.account()["dissipated"][-1] == pytest.approx(0.0, abs=1e-15)


def test_a_contact_that_goes_on_has_its_energy_so_far():
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.05], [0.0], [0.0, -1.0], 9.81)
    run = gr.md.simulate(scene, gr.Hertz(1e8), t_end=1e-4, engine="plain")
    assert np.isnan(run.contacts["t_end"]).all()
    assert run.dissipated == pytest.approx([stored(run, -1)], rel=1e-13)


@pytest.mark.parametrize("ties", ["left", "random", "newton", "poisson", "reflect"])
@pytest.mark.parametrize("seed", range(4))
def test_the_sum_for_hard_spheres(ties, seed):
    """Also in groups of simultaneous collisions, of which each pair loses its own part."""
    rng = np.random.default_rng([seed, 8])
    scene = draw.scene(rng, (2, 5), walls=(0.5, 0.3, 0.3), gaps=("touching", "equal"))
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.3, max_events=60, ties=ties, engine="sorted")
    assert imbalance(run) <= 1e-12


def test_a_group_of_simultaneous_collisions():
    scene = gr.Scene([1.0] * 4, [0.05] * 4, [0.0] * 3, [1.0, 0.0, 0.0, 0.0])
    run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.5), t_end=0.1, ties="newton", engine="sorted")
    lost = 0.5 * (scene.velocity**2 - run.velocity[-1] ** 2).sum()
    w_in, w_out = closing(run.contacts)
    assert run.dissipated == pytest.approx(run.contacts["impulse"] * (w_in + w_out) / 2.0, rel=1e-15)
    assert run.dissipated.sum() == pytest.approx(lost, rel=1e-14)


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e5, 30.0), gr.ViscoelasticHertz(1e7, 1e4), gr.Hertz(1e7)],
                         ids=lambda law: type(law).__name__)
def test_the_sum_with_verlet_is_exact(law):
    """The trapezoidal rule is the discrete work of this method: its remainder telescopes between two free flights."""
    scene = gr.Scene([math.inf, 1.0, 0.6, 0.3], [0.0] + [0.05] * 3, [1e-2, 0.0, 1e-4], [0.0, -1.0, -1.0, -1.0], 9.81)
    run = gr.md.simulate(scene, law, t_end=0.1, dt=1e-5, engine="plain")
    assert (run.gap[-1] > 0.0).all()
    assert len(run.contacts) >= 3
    assert imbalance(run) <= 1e-12


@pytest.mark.parametrize("method", ["symplectic-euler", "rk4", "gear5"])
def test_the_energies_of_fixed_steps_converge(method):
    scene = gr.Scene([1.0, 0.6, 0.3], [0.05] * 3, [1e-3, 0.0], [1.0, 0.0, 0.0])
    exact = gr.md.simulate(scene, gr.Hertz(1e7), t_end=0.05, engine="plain").dissipated
    errors = [np.abs(gr.md.simulate(scene, gr.Hertz(1e7), t_end=0.05, dt=dt, method=method, engine="plain")
                     .dissipated - exact).max() for dt in (4e-5, 1e-5)]
    assert errors[1] <= 0.3 * errors[0] < 1e-3


def test_the_log_keeps_its_type():
    run = gr.md.simulate(THREE, BASE, t_end=0.4, engine="plain")
    assert run.dissipated[run.rows(1)].tolist() == run.dissipated[run.contacts["pair"] == 1].tolist()
    assert run.contacts.dtype == CONTACT
    assert type(run.contacts) is np.ndarray
    assert len(gr.md.simulate(THREE, BASE, t_end=0.4, log=False, engine="plain").dissipated) == 0


@pytest.mark.parametrize("lose", ["pickle", "file"])
def test_a_log_without_its_run_has_no_energies(lose, tmp_path):
    run = gr.md.simulate(THREE, BASE, t_end=0.4, engine="plain")
    run.save(tmp_path / "run.npz")
    lost = pickle.loads(pickle.dumps(run)) if lose == "pickle" else gr.Trajectory.load(tmp_path / "run.npz")
    with pytest.raises(ValueError, match=r"^`dissipated` requires a run of soft spheres that this process has "
                                         r"simulated, got a loaded run or a copy\. Simulate it again\.$"):
        lost.dissipated  # noqa: B018


def test_hard_spheres_keep_their_energies(tmp_path):
    run = gr.edmd.simulate(THREE, gr.ConstantRestitution(0.7), t_end=1.0)
    run.save(tmp_path / "run.npz")
    for other in (pickle.loads(pickle.dumps(run)), gr.Trajectory.load(tmp_path / "run.npz")):
        assert other.dissipated.tobytes() == run.dissipated.tobytes()


@pytest.mark.rotating
def test_who_does_not_read_the_column_does_not_pay_for_it():
    calls = []

    class Counted:
        def force(self, xi, xi_dot, pair):
            calls.append(1)
            return 1e6 * xi * (1.0 + 30.0 * xi) + 10.0 * xi_dot

    run = gr.md.simulate(THREE, Counted(), t_end=0.33, engine="plain")
    before, forces = len(calls), run.contacts["force_max"].tobytes()
    run.contacts["impulse"], run.of(0), run.contacts[0], run.momentum()
    assert len(calls) == before
    first = run.dissipated
    once = len(calls)
    assert once > before
    assert run.dissipated.tobytes() == first.tobytes()
    assert len(calls) == once
    assert run.contacts["force_max"].tobytes() == forces


@pytest.mark.rotating
@pytest.mark.parametrize("law", [BASE, gr.ViscoelasticHertz(1e8, 1e4), draw.OwnHertz(1e8)],
                         ids=["dashpot", "viscoelastic", "own"])
def test_resumed_runs_have_the_energies_of_the_whole_run(law, tmp_path):
    whole = gr.md.simulate(THREE, law, t_end=0.33, engine="plain")
    inside = float(whole.contacts["t_begin"][0] + 0.4 * whole.contacts["duration"][0])
    first = gr.md.simulate(THREE, law, t_end=inside, engine="plain")
    second = gr.md.resume(first, t_end=0.33, engine="plain")
    assert np.isnan(first.contacts["t_end"]).any()
    ended = ~np.isnan(first.contacts["t_end"])
    onsets = np.concatenate([first.contacts["t_begin"][ended], second.contacts["t_begin"]])
    energies = np.concatenate([first.dissipated[ended], second.dissipated])
    assert energies[np.argsort(onsets, kind="stable")].tolist() == whole.dissipated.tolist()
    # the energy before the checkpoint of a file is unknown
    first.save(tmp_path / "first.npz")
    loaded = gr.md.resume(gr.Trajectory.load(tmp_path / "first.npz", law=law), t_end=0.33, engine="plain")
    energies, going_on = loaded.dissipated, loaded.contacts["t_begin"] < inside
    assert loaded.contacts.tobytes() == second.contacts.tobytes()
    assert np.isnan(energies[going_on]).all()
    assert energies[~going_on].tolist() == second.dissipated[~going_on].tolist()


@pytest.mark.parametrize("options", [{}, {"dt": 1e-6}], ids=["located", "verlet"])
def test_samples_and_starts_do_not_change_energies(options):
    plain, sampled = (gr.md.simulate(THREE, BASE, t_end=0.33, t_start=t, samples=n, engine="plain", **options)
                      for t, n in ((0.0, None), (0.0, 17)))
    assert sampled.dissipated.tobytes() == plain.dissipated.tobytes()


@pytest.mark.soak
@pytest.mark.parametrize("options", [{}, {"method": "verlet"}], ids=["located", "verlet"])
def test_compiled_energies_are_the_same_bits(options, monkeypatch):
    pytest.importorskip("numba")
    plain, compiled = (
        gr.md.simulate(THREE, BASE, t_end=0.33, engine=engine, **options) for engine in ("plain", "compiled"))
    # a run for energies is compiled only if that saves time: here always
    monkeypatch.setattr(LocatedRun, "compilation_pays", lambda run, ahead=0.0: run.engine == "auto")
    monkeypatch.setattr(FixedRun, "_compile_if_worthwhile", lambda run: run.stepper.compiled or run.stepper.compile())
    assert compiled.dissipated.tobytes() == plain.dissipated.tobytes()


LAWS_WITH_A_POTENTIAL = [gr.LinearDashpot(1e5, 100.0), gr.ViscoelasticHertz(1e7, 3e4), draw.OwnDashpot(1e5, 100.0)]


@pytest.mark.rotating
@pytest.mark.parametrize("law", LAWS_WITH_A_POTENTIAL, ids=lambda law: type(law).__name__)
def test_the_rate_is_the_derivative_of_the_dissipated_energy(law):
    scene = gr.Scene([1.0, 0.6, 0.3], [0.05] * 3, [1e-6, 0.0], [1.0, 0.0, 0.0])
    time = np.linspace(0.0, 0.012, 2401)
    run = gr.md.simulate(scene, law, samples=time, t_end=0.012, engine="plain")
    rate, lost = run.dissipation(), run.account()["dissipated"]
    assert rate.shape == time.shape
    assert (rate >= 0.0).all()
    # trapezoidal rule; the rate of a damped contact jumps at its onset, within one step
    total = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))
    assert total == pytest.approx(lost[1:], abs=rate.max() * time[1])
    inside = np.flatnonzero((run.force > 0.0).all(axis=1))[5:-5]
    slope = (lost[inside + 1] - lost[inside - 1]) / (time[2] - time[0])
    assert rate[inside] == pytest.approx(slope, rel=0.0, abs=1e-3 * rate.max())


def test_elastic_contacts_have_no_rate():
    run = gr.md.simulate(THREE, gr.Hertz(1e8), t_end=0.33, samples="contacts", engine="plain")
    assert np.abs(run.dissipation()).max() <= 1e-12 * np.abs(run.force).max()


def test_the_rate_requires_a_potential():
    hard = gr.edmd.simulate(THREE, gr.ConstantRestitution(0.7), t_end=1.0)
    with pytest.raises(ValueError, match=r"^`dissipation` requires soft spheres, got instantaneous collisions\. Use "
                                         r"`dissipated`\.$"):
        hard.dissipation()
    memory = gr.md.simulate(THREE, gr.WaltonBraun(1e6, 2e6), t_end=0.33, samples="contacts", engine="plain")
    with pytest.raises(ValueError, match=r"^`dissipation` requires laws with a potential, got a law with memory\. Use "
                                         r"`dissipated`\.$"):
        memory.dissipation()
