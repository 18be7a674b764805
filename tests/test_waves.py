"""Chains under pressure and solitary waves: against eigenvalues, linear equations, published digits, and long runs."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import granular as gr
from granular import cases, waves
from granular.laws.contact_law import resolve
from granular.laws.statics import overlap_under, stiffness_at
from granular.reference import solve

RADIUS, FORCE = 0.009525, 20.0


def steel(pair):
    return gr.Hertz.from_material(193e9, 0.3, pair)


@dataclass(frozen=True)
class Stiffening:
    """F = k ξ (1 + ξ/s) + γ ξ̇."""

    k: float
    s: float
    gamma: float = 0.0

    def force(self, xi, xi_dot, pair):
        return self.k * xi * (1.0 + xi / self.s) + self.gamma * xi_dot


LAWS = [steel, gr.LinearDashpot(1e7, 3.0), gr.PowerLaw(1e12, 2.0), gr.TsujiHertz(1e10, 0.3),
        lambda pair: gr.ViscoelasticHertz.from_material(193e9, 0.3, 1e-7, pair), Stiffening(1e7, 1e-6, 5.0),
        gr.WaltonBraun(1e7, 2e7)]


def laws_of(scene, law):
    return [law(pair) if callable(law) else law for pair in scene.pairs]


# the static equations

@pytest.mark.parametrize("ends", ["walls", "force", "forces"])
@pytest.mark.parametrize("law", LAWS, ids=range(len(LAWS)))
def test_what_the_static_equations_say_is_at_rest(law, ends):
    """Nothing moves but by rounding, and the run reaches its end with every row."""
    scene = gr.scenes.compressed_chain(5, FORCE, law=law, ends=ends, dimer=0.4)
    run = gr.md.simulate(scene, laws_of(scene, law), t_end=2e-3, samples=9)
    assert run.status is gr.Status.time
    assert len(run.time) == 9
    assert run.time[-1] == 2e-3
    assert run.force == pytest.approx(np.full_like(run.force, FORCE), rel=1e-11)
    assert np.abs(run.velocity).max() < 1e-13
    assert scene.external_force is None or scene.external_force.sum() == pytest.approx(-FORCE * (ends == "force"))


@pytest.mark.parametrize("seed", range(20))
def test_overlap_and_stiffness_undo_force_and_its_slope(seed):
    random = np.random.default_rng(seed)
    pair = gr.Pair(0.01, 0.005, 0)
    k, s, load = 10.0 ** random.uniform(4, 9), 10.0 ** random.uniform(-8, -4), 10.0 ** random.uniform(-6, 3)
    law = resolve(Stiffening(k, s), pair)
    xi = overlap_under(law, load)
    assert xi == pytest.approx(2.0 * load / k / (1.0 + math.sqrt(1.0 + 4.0 * load / (k * s))), rel=4e-15)
    assert stiffness_at(law, xi) == pytest.approx(k * (1.0 + 2.0 * xi / s), rel=1e-10)
    assert stiffness_at(law, 0.0) == 0.0


def test_the_reference_solver_stays_at_rest_too():
    """Where forces balance to the last digit its series have one term, and no end."""
    pytest.importorskip("mpmath")
    for law in (gr.Hertz(1e10), gr.TsujiHertz(1e10, 0.3)):
        scene = gr.scenes.compressed_chain(2, FORCE, law=law)
        found = solve(scene, law, t_end=2e-5)
        assert found.status == "time"
        assert not any(found.velocity)
    with pytest.raises(ValueError, match="t_end is missing: all balls are at rest"):
        solve(scene, law, until=gr.until.contact(0, 2))


@pytest.mark.exact
def test_a_chain_is_of_one_or_two_masses_and_may_be_struck():
    scene = gr.scenes.compressed_chain(4, law=steel, dimer=0.5, ends="force")
    assert scene.mass[1::2].tolist() == pytest.approx([scene.mass[1]] * 2)
    assert scene.mass[2] == pytest.approx(0.5 * scene.mass[1])
    assert scene.radius[2] == pytest.approx(RADIUS * 0.5 ** (1.0 / 3.0))
    struck = gr.scenes.compressed_chain(4, law=steel, ends="forces", striker=0.01, speed=0.2)
    assert struck.mass[0] == 0.01
    assert struck.gap[0] == 0.0
    assert struck.velocity.tolist() == [0.2, 0.0, 0.0, 0.0, 0.0]
    assert struck.external_force.tolist() == [0.0, FORCE, 0.0, 0.0, -FORCE]
    assert not gr.scenes.compressed_chain(4, 0.0, law=steel).gap.any()
    assert not gr.scenes.compressed_chain(4, law=None).gap.any()


def test_two_balls_squeezed_between_walls_after_a_millisecond():
    """The verification case DEM03 of a DEM code, to rounding; then they rest, and the run goes on to its end."""
    r, mass = 0.5e-3, np.array([20000.0, 10000.0]) * 4.0 / 3.0 * math.pi * 0.5e-3**3
    zeta = -math.log(0.8) / math.sqrt(math.pi**2 + math.log(0.8) ** 2)
    scene = gr.Scene([math.inf, *mass, math.inf], [0.0, r, r, 0.0], [-0.1 * r, -0.2 * r, -0.1 * r], np.zeros(4), 9.81)
    law = [gr.LinearDashpot(1000.0, 2.0 * zeta * math.sqrt(1000.0 * pair.m_eff)) for pair in scene.pairs]
    run = gr.md.simulate(scene, law, t_end=1e-3)
    assert run.position[-1, 1:3] == pytest.approx([4.3218710213158809857e-4, 1.3679614684743072958e-3], rel=2e-15)
    assert run.velocity[-1, 1:3] == pytest.approx([0.0266163610295581, 0.0758305198655192], rel=2e-14)
    late = gr.md.simulate(scene, law, t_end=10.0, samples=101)
    assert late.status is gr.Status.time
    assert late.stats["resting"]
    assert len(late.time) == 101
    assert late.time[-1] == 10.0
    assert abs(late.velocity[-1]).max() < 1e-14
    assert float(late.message.split("decays in ")[1].split()[0]) < 0.01  # not the sum of overlaps, which cannot move


# bands

def test_numbers_of_steel_beads():
    scene = gr.scenes.compressed_chain(10, FORCE, law=steel)
    law = laws_of(scene, steel)
    k, m = waves.stiffness(scene, law)[5], scene.mass[1]
    assert law[5].k == pytest.approx(9.75758e9, rel=1e-6)
    assert k == pytest.approx(1.5 * law[5].k ** (2 / 3) * FORCE ** (1 / 3), rel=1e-14)
    assert k == pytest.approx(1.859214e7, rel=4e-7)
    cut = waves.band_edges(k, m)[0, 1]
    assert cut / (2.0 * math.pi) == pytest.approx(8051.863, abs=1e-3)
    assert waves.sound_speed(k, m, 2.0 * RADIUS) == pytest.approx(481.8826, abs=1e-4)
    assert waves.decay(1.1 * cut, k, m) == pytest.approx(0.411833347, abs=5e-10)
    assert waves.crossing_time(scene, [law[5]] * 11) == pytest.approx(0.2 / 481.8826, rel=0.2)


def test_edges_of_the_gap_of_two_masses():
    edges = waves.band_edges(1.0, [1.0, 2.0])
    assert edges == pytest.approx(np.array([[0.0, 1.0], [math.sqrt(2.0), math.sqrt(3.0)]]), abs=1e-15)
    assert edges[0, 0] == 0.0


@pytest.mark.parametrize("seed", range(6))
def test_dispersion_against_eigenvalues_of_a_closed_chain(seed):
    """N cells joined to a ring have the frequencies of an endless chain at the phases 2πj/N."""
    random = np.random.default_rng(seed)
    p, cells = int(random.integers(1, 5)), 7
    k, m = 10.0 ** random.uniform(-1, 1, (2, p))
    n = p * cells
    matrix = np.zeros((n, n))
    for j in range(n):
        a, b = j, (j + 1) % n
        matrix[a, a] += k[j % p]
        matrix[b, b] += k[j % p]
        matrix[a, b] -= k[j % p]
        matrix[b, a] -= k[j % p]
    root = np.sqrt(np.tile(m, cells))
    expected = np.sqrt(np.maximum(np.linalg.eigvalsh(matrix / np.outer(root, root)), 0.0))
    found = np.sort(waves.dispersion(2.0 * math.pi * np.arange(cells) / cells, k, m).ravel())
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_modes_of_a_chain_between_walls_are_standing_waves_of_the_dispersion(seed):
    random = np.random.default_rng(seed)
    n, k = int(random.integers(2, 9)), 10.0 ** random.uniform(5, 8)
    scene = gr.scenes.compressed_chain(n, law=gr.LinearDashpot(k))
    expected = waves.dispersion(math.pi * np.arange(1, n + 1) / (n + 1), k, scene.mass[1])[:, 0]
    assert waves.modes(scene, gr.LinearDashpot(k)) == pytest.approx(expected, rel=1e-12)


def test_a_mode_swings_with_its_frequency_in_a_run():
    law, amplitude = steel, 1e-5
    scene = gr.scenes.compressed_chain(6, law=law, dimer=0.3)
    laws = laws_of(scene, law)
    k, m = waves.stiffness(scene, laws), scene.mass[1:-1]
    square, shape = np.linalg.eigh((np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1))
                                   / np.sqrt(np.outer(m, m)))
    omega = waves.modes(scene, laws)
    assert omega == pytest.approx(np.sqrt(square), rel=1e-12)
    start = np.array([0.0, *(amplitude * shape[:, 2] / np.sqrt(m)), 0.0]) * math.sqrt(m[0]) * 1e-3
    run = gr.md.simulate(scene.replace(velocity=start), laws, t_end=20 * math.pi / omega[2])
    assert run.velocity[-1] == pytest.approx(start, abs=1e-4 * np.abs(start).max())  # not quite linear


@pytest.mark.parametrize("seed", range(8))
def test_decay_against_the_response_of_a_long_chain(seed):
    """Shake one end of a long chain in a gap: linear equations for the amplitudes."""
    random = np.random.default_rng(seed)
    p, cells = int(random.integers(1, 4)), 40
    k, m = random.uniform(0.5, 2.0, (2, p))
    edges = waves.band_edges(k, m)
    gaps = [(low, high) for low, high in zip(edges[:, 1], [*edges[1:, 0], 1.5 * edges[-1, 1]], strict=True)
            if high > 1.02 * low]
    low, high = gaps[int(random.integers(len(gaps)))]
    omega = random.uniform(0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high)
    n = p * cells  # balls 1 … n; ball 0 is shaken, ball n + 1 held; contact j joins j and j + 1
    stiff = np.tile(k, cells + 1)[: n + 1]
    heavy = np.array([m[j % p] for j in range(1, n + 1)])
    matrix = np.diag(stiff[:-1] + stiff[1:] - omega**2 * heavy) - np.diag(stiff[1:-1], 1) - np.diag(stiff[1:-1], -1)
    u = np.abs(np.linalg.solve(matrix, np.eye(n)[0] * stiff[0]))
    rate = waves.decay(omega, k, m)
    assert rate < 1.0
    assert (u[3 * p] / u[p]) ** (1.0 / (2 * p)) == pytest.approx(rate, rel=1e-6)
    assert waves.decay(0.5 * (edges[0, 0] + edges[0, 1]), k, m) == 1.0


def shaken(scene, laws, omega, amplitude, periods, seen=16):
    """Amplitudes of all bodies in the last periods of a run, complex; the floor sets in softly."""
    turn = 2.0 * math.pi / omega
    middle, soft = 0.4 * periods * turn, 0.062 * periods * turn

    def path(t):
        return 0.5 * amplitude * math.erfc((middle - t) / (soft * math.sqrt(2.0))) * math.sin(omega * t)

    times = np.linspace((periods - seen) * turn, periods * turn, 12 * seen, endpoint=False)
    run = gr.md.simulate(scene.replace(floor=gr.walls.Motion(path)), laws, t_end=periods * turn, samples=times)
    assert run.status is gr.Status.time
    moved = run.position - scene.position
    wave = np.exp(-1j * omega * run.time)[:, None]
    return 2.0 * ((moved - moved.mean(axis=0)) * wave).mean(axis=0)


def test_decay_above_the_cut_off_measured_in_a_run():
    """The recipe's digits: 0.411833347 from ball to ball at 1.1 ω_c, by the located engine."""
    scene = gr.scenes.compressed_chain(12, FORCE, law=steel)
    k, m = waves.stiffness(scene, laws_of(scene, steel))[5], scene.mass[1]
    spring = gr.LinearDashpot(float(k))
    scene = gr.scenes.compressed_chain(12, FORCE, law=spring)
    u, rate = shaken(scene, spring, 1.1 * waves.band_edges(k, m)[0, 1], 1e-8, 160), 0.411833347
    assert abs(u[1] / u[0]) == pytest.approx(rate, abs=2e-9)
    back = np.array([rate**j - rate ** (26 - j) for j in range(8)])  # the wall beyond ball 12 sends it back
    assert np.abs(u[1:8] / u[:7]) == pytest.approx(back[1:] / back[:-1], abs=1e-6)
    assert (u[1:8] / u[:7]).real.max() < -0.4  # neighbours move against each other


def test_a_matched_end_sends_back_little():
    """tan(θ/4) of the amplitude, from linear equations with a resistance √(K m) at the end; a wall sends back all."""
    n, spring = 8, gr.LinearDashpot(1e7)
    scene = gr.scenes.compressed_chain(n, FORCE, law=spring)
    laws, m = waves.matched_end(scene, spring), scene.mass[1]
    assert laws[-1] == gr.MatchedEnd(FORCE, 1e7)
    omega = 0.4 * 2.0 * math.sqrt(1e7 / m)
    u = shaken(scene, laws, omega, 1e-9, 40, 8)
    theta = 2.0 * math.asin(0.4)
    away = np.exp(-1j * theta * np.arange(n + 1))
    (there, back), *_ = np.linalg.lstsq(np.array([away, away.conj()]).T, u[:-1], rcond=None)
    assert u[:-1] == pytest.approx(there * away + back * away.conj(), abs=2e-3 * abs(there))
    assert abs(back / there) == pytest.approx(math.tan(0.25 * theta), abs=2e-3)


# the solitary wave

def test_the_published_digits_of_the_discrete_solitary_wave():
    wave = waves.SolitaryWave(1.5)
    assert wave.speed == pytest.approx(0.90551577641912, abs=1e-14)
    assert wave.speed / wave.peak_velocity**0.2 == pytest.approx(0.90747007841219, abs=1e-14)
    for share, width in ((0.5, 1.411928348539), (0.01, 3.558618410626), (0.001, 4.304636982818)):
        assert wave.width(share) == pytest.approx(width, abs=6e-13)


@pytest.mark.parametrize("p", [1.1, 1.2, 1.5, 2.0, 3.7, 8.0])
def test_the_wave_solves_its_integrated_equation(p):
    """c² φ = Λ * φ^p and the velocity, by Gauss quadrature instead of Fourier series."""
    wave, (node, weight) = waves.SolitaryWave(p), np.polynomial.legendre.leggauss(60)
    s = 0.5 * (node + 1.0)
    for x in np.linspace(-2.0, 2.0, 17).tolist():
        both = wave.overlap(x + s) ** p + wave.overlap(x - s) ** p
        assert wave.speed**2 * wave.overlap(x) == pytest.approx(0.5 * weight @ ((1.0 - s) * both), abs=1e-13)
        assert wave.speed * wave.velocity(x) == pytest.approx(0.5 * weight @ wave.overlap(x + s) ** p, abs=1e-13)


def speeds(scene, law, v):
    """Balls per second, and the largest overlap."""
    wave, pair = waves.SolitaryWave(resolve(law, scene.pairs[0]).form[1]), scene.pairs[0]
    k, p, m = law.k, wave.exponent, 2.0 * pair.m_eff
    deepest = (v * math.sqrt(m / k) / wave.peak_velocity) ** (2.0 / (p + 1.0))
    return wave.speed * math.sqrt(k * deepest ** (p - 1.0) / m), deepest


@pytest.mark.parametrize(("law", "n", "over"), [
    (gr.Hertz(9.75758e9), 113, 100), (gr.PowerLaw(1e13, 2.0), 33, 20), (gr.PowerLaw(1e20, 3.0), 33, 20),
])
def test_the_wave_keeps_shape_and_speed_in_a_run(law, n, over):
    """100 balls later it is the exact wave 100 balls further on."""
    scene = waves.solitary(n, 0.1, law=law)
    rate, deepest = speeds(scene, law, 0.1)
    assert scene.velocity.max() == pytest.approx(0.1, rel=1e-14)
    assert -scene.gap.min() <= deepest
    run = gr.md.simulate(scene, law, t_end=over / rate)
    there = waves.solitary(n, 0.1, law=law, at=6.0 + over)
    assert run.velocity[-1] == pytest.approx(there.velocity, abs=0.1 * 1e-14 * over)
    assert run.gap[-1] == pytest.approx(there.gap, abs=deepest * 5e-14 * over)


def test_sensors_see_speed_peak_and_widths_of_the_wave():
    law = gr.Hertz(9.75758e9)
    scene = waves.solitary(30, 0.1, law=law)
    rate, deepest = speeds(scene, law, 0.1)
    run = gr.md.simulate(scene, law, t_end=16.0 / rate, samples=1601)
    seen = waves.pulse(run)
    assert np.isnan(seen.time[0])
    assert seen.speed(10, 18) == pytest.approx(2.0 * RADIUS * rate, rel=1e-10)
    assert seen.peak[10:18] == pytest.approx(np.full(8, law.k * deepest**1.5), rel=1e-9)
    widths = seen.width[10:18] * rate
    assert widths[:, 0] == pytest.approx(np.full(8, 1.411928348539), abs=1e-7)
    assert widths[:, 1:] == pytest.approx(np.tile([3.558618410626, 4.304636982818], (8, 1)), abs=1e-6)


def test_a_small_pulse_in_a_pressed_chain_runs_at_the_speed_of_sound():
    law, long = gr.Hertz(9.75758e9), 24
    scene = gr.scenes.compressed_chain(48, FORCE, law=law)
    sound = waves.sound_speed(waves.stiffness(scene, law)[5], scene.mass[1], 2.0 * RADIUS)
    v, deeper = np.zeros(scene.n), np.zeros(scene.n_pairs)  # a long one, to the right only
    v[1 : long + 1] = 1e-6 * np.sin(math.pi * np.arange(1, long + 1) / (long + 1)) ** 2
    deeper[: long + 1] = 1e-6 * np.sin(math.pi * (np.arange(long + 1) + 0.5) / (long + 1)) ** 2 * 2.0 * RADIUS / sound
    run = gr.md.simulate(scene.replace(velocity=v, gap=scene.gap - deeper), law, t_end=0.7 / sound, samples=200)
    seen = waves.pulse(run, static=FORCE)
    assert seen.speed(22, 40) == pytest.approx(sound, rel=5e-3)
    assert seen.peak[22:40] == pytest.approx(np.full(18, 1e-6 * sound * scene.mass[1] / (2.0 * RADIUS)), rel=0.05)


# all fronts

def test_library_file_command_and_sweep_are_one(granular, tmp_path):
    pytest.importorskip("xarray")
    options = {"n": 4, "force": 7.0, "dimer": 0.5, "stiffness": 3e9, "restitution": 0.9}
    case = cases.make("compressed-chain", **options, t_end=1e-4)
    made = gr.scenes.compressed_chain(4, 7.0, dimer=0.5, law=gr.TsujiHertz.from_restitution(0.9, 3e9))
    assert case.scene == made
    text = ("[scene]\nname = 'compressed-chain'\nn = 4\nforce = 7.0\ndimer = 0.5\n[law]\ntype = 'TsujiHertz'\n"
            "restitution = 0.9\nk = 3e9\n[run]\nt_end = 1e-4\n")
    assert cases.loads(text).scene == made
    (tmp_path / "chain.toml").write_text(text, encoding="utf-8")
    flags = " ".join(f"--{name} {value}" for name, value in options.items())
    said = [granular(f"run {line}") for line in (f"compressed-chain {flags} --t-end 1e-4", "chain.toml")]
    assert said[0][0] == said[1][0] == 0
    assert said[0][1].partition("\n")[2] == said[1][1].partition("\n")[2]

    def largest(of):
        return float(of.simulate("md").force.max())

    for subject, names in (("compressed-chain", options), (tmp_path / "chain.toml", {})):
        fixed = {key: value for key, value in names.items() if key != "force"} | ({"t_end": 1e-4} if names else {})
        data = gr.sweep(subject, {"force": [7.0, 11.0]}, [largest], **fixed)
        assert data["largest"].values.tolist() == pytest.approx([7.0, 11.0], rel=1e-12)
    def depth(of):
        return float(-of.scene.gap[0])

    first, second = gr.sweep("compressed-chain", {"stiffness": [1e9, 8e9]}, [depth], n=3)["depth"].values
    assert first / second == pytest.approx(4.0, rel=1e-12)  # each cell has the overlaps of its own law


def test_an_end_time_is_found_for_every_kind_of_chain():
    assert cases.make("compressed-chain", force=80.0).t_end < cases.make("compressed-chain").t_end
    shaken_floor = {"type": "Sine", "amplitude": 1e-9, "frequency": 5000.0}
    assert cases.make("compressed-chain", floor=shaken_floor).t_end == pytest.approx(0.01)
    assert cases.make("compressed-chain", ends="forces", striker=0.01).t_end > 0.0
    assert cases.make("compressed-chain", force=0.0).t_end is None
    with pytest.raises(ValueError, match="hard spheres cannot overlap"):
        cases.make("compressed-chain").simulate("edmd")


def test_a_matched_end_is_kept_by_files(tmp_path):
    scene = gr.scenes.compressed_chain(3, FORCE, law=gr.Hertz(1e10))
    law = waves.matched_end(scene, gr.Hertz(1e10))
    case = cases.Case(scene, law, gr.ConstantRestitution(1.0), t_end=1e-5)
    cases.save(case, tmp_path / "case.toml")
    assert list(cases.load(tmp_path / "case.toml").law) == law
    run = case.simulate("md")
    run.save(tmp_path / "run.npz")
    assert gr.Trajectory.load(tmp_path / "run.npz").law == tuple(law)
    assert run.force[-1] == pytest.approx(np.full(4, FORCE))
    alone = gr.scenes.compressed_chain(3, FORCE, law=law)
    assert alone.gap[-1] == pytest.approx(-0.1 * RADIUS)  # it bears that force at every overlap
    assert (alone.gap[:-1] == scene.gap[:-1]).all()


@pytest.mark.parametrize("show", ["force", "velocity"])
def test_a_picture_is_drawn(show, tmp_path):
    figure = pytest.importorskip("matplotlib.figure").Figure
    law = gr.Hertz(1e10)
    run = gr.md.simulate(waves.solitary(14, law=law), law, t_end=2e-4, samples=21)
    made = waves.picture(run, show)
    assert isinstance(made, figure)
    image = made.axes[0].collections[0].get_array()
    assert image.shape == ((13 if show == "force" else 14), 21)
    assert image.max() == pytest.approx(getattr(run, show).max())
    assert waves.picture(run, show, tmp_path / "picture.png") is None
    assert (tmp_path / "picture.png").stat().st_size > 1000
    still = waves.picture(run, show, beyond=True).axes[0].collections[0].get_array()
    assert not still[:, 0].any()
    assert still.min() < 0.0
    axis = figure().subplots()
    assert waves.picture(run, show, axis=axis) is None
    assert axis.collections


PULL = gr.PowerLaw(1e9, 1.5)
RUN = gr.md.simulate(gr.scenes.newtons_cradle(3), gr.Hertz(1e9), t_end=1e-3, samples=6)
HARD = gr.edmd.simulate(gr.scenes.newtons_cradle(3), gr.ConstantRestitution(1.0), t_end=1e-3)


@dataclass(frozen=True)
class Saturating:
    """A force that never gets beyond 1 N."""

    k: float = 1e6

    def force(self, xi, xi_dot, pair):
        return self.k * xi / (1.0 + self.k * xi)


@pytest.mark.parametrize(("call", "sentence"), [
    (lambda: gr.scenes.compressed_chain(0, law=PULL), r"n is 0: .*at least 1"),
    (lambda: gr.scenes.compressed_chain(force=-1.0, law=PULL), r"force is -1\.0: .*at least 0 is needed; it presses"),
    (lambda: gr.scenes.compressed_chain(law=PULL, ends="wall"), r"ends is 'wall': one of walls, force, forces is nee"),
    (lambda: gr.scenes.compressed_chain(law=PULL, striker=1.0), r"striker is 1\.0: a wall is in its way; ends='force"),
    (lambda: gr.scenes.compressed_chain(law=PULL, dimer=0.0), r"dimer is 0\.0: .*above 0"),
    (lambda: gr.scenes.compressed_chain(3, law=[PULL]), r"length of law is 1: 4 \(the number of pairs\)"),
    (lambda: gr.scenes.compressed_chain(3, law=gr.Hertz), r"law of pair 0 is the class Hertz|law is the class Hertz"),
    (lambda: gr.scenes.compressed_chain(3, law=3.0), r"law of pair 0 is 3\.0: an object with force"),
    (lambda: gr.scenes.compressed_chain(3, law=Saturating()), r"force is 20\.0: no overlap of pair 0 gives it under S"),
    (lambda: gr.scenes.compressed_chain(3, 1e9, law=gr.Hertz(1e3)), r"gap\[0\] is .*deeper than both radii"),
    (lambda: gr.scenes.compressed_chain(3, law=PULL, ends="forces", floor=gr.walls.Sine(1e-9, 50.0)), r"floor is Sine"),
    (lambda: cases.loads("[scene]\nname = 'compressed-chain'\nlaw = 'Hertz'"), r"'law' is no parameter of compressed-"),
    (lambda: cases.make("compressed-chain", forze=1.0), r"'forze' is no option of compressed-chain; did you mean forc"),
    (lambda: gr.MatchedEnd(0.0, 1.0), r"load is 0\.0: .*above 0 is needed; a chain that is not pressed"),
    (lambda: waves.matched_end(gr.scenes.compressed_chain(3, law=PULL, ends="force"), PULL), r"pressed against a wall"),
    (lambda: waves.stiffness("x", PULL), r"scene is 'x'"),
    (lambda: waves.dispersion(math.nan, 1.0, 1.0), r"phase is nan: finite angles"),
    (lambda: waves.dispersion(1.0, 0.0, 1.0), r"stiffness\[0\] is 0\.0: .*a chain that is not pressed"),
    (lambda: waves.band_edges([1.0, 2.0], [1.0, 2.0, 3.0]), r"stiffness has 2 entries and mass 3"),
    (lambda: waves.decay(-1.0, 1.0, 1.0), r"omega is -1\.0: angular frequencies"),
    (lambda: waves.sound_speed(1.0, 1.0, 0.0), r"length is 0\.0"),
    (lambda: waves.SolitaryWave(1.0), r"exponent is 1\.0: .*at least 1\.1 .*1 has no solitary waves"),
    (lambda: waves.solitary(8, law=PULL), r"n is 8: .*at least 11"),
    (lambda: waves.solitary(20, law=PULL, at=3.0), r"at is 3\.0: .*at least 5 and at most 14"),
    (lambda: waves.solitary(20, law=gr.TsujiHertz(1e9, 0.1)), r"law is TsujiHertz.*without damping"),
    (lambda: waves.solitary(20, law=gr.LinearDashpot(1e9)), r"exponent is 1\.0: .*at least 1\.1"),
    (lambda: waves.pulse(HARD), r"run is .*hard spheres have no forces"),
    (lambda: waves.pulse(RUN, shares=[1.5]), r"shares\[0\] is 1\.5"),
    (lambda: waves.pulse(gr.md.simulate(RUN.scene, PULL, t_end=1e-3)), r"run has 2 rows: at least 5 are needed; pass"),
    (lambda: waves.pulse(RUN).speed(1, 2), r"first is 1 and last is 2: contacts that the pulse passes"),
    (lambda: waves.picture(HARD), r"of hard spheres show='velocity'"),
    (lambda: waves.picture(RUN, "speed"), r"show is 'speed': one of force, velocity is needed"),
])
def test_misuse_is_a_sentence(call, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence):
        call()
