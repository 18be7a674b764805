"""Chains under pressure: at rest by the static equations, on all fronts, drawn; and what is refused."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import granular as gr
from bench.reference import solve
from granular import cases, waves
from granular.laws.contact_law import resolve
from granular.laws.springs import static_overlap, stiffness_at
from tests.helpers.steel_chains import FORCE, RADIUS, laws_of, steel


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


# --- the static equations


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
    xi = static_overlap(law, load)
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
    with pytest.raises(ValueError, match=r"`t_end` must be given.*All balls are at rest"):
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


# --- all fronts


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
    with pytest.raises(ValueError, match=r"`gap\[0\]` must be non-negative, got -1\.5874010519682007e-06\. Hard "
                                         r"spheres cannot overlap\. Set the gap to 0, or use granular\.md\."):
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


@pytest.mark.rotating
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
    (lambda: gr.scenes.compressed_chain(0, law=PULL), r"`n` must be .*at least 1.*, got 0"),
    (lambda: gr.scenes.compressed_chain(force=-1.0, law=PULL),
        r"`force` must be a finite number of at least 0, got -1\.0\. A positive force compresses the chain\."),
    (lambda: gr.scenes.compressed_chain(law=PULL, ends="wall"),
        r"`ends` must be one of walls, force, forces.*, got 'wall'"),
    (lambda: gr.scenes.compressed_chain(law=PULL, striker=1.0),
        r"`striker` must be None if the chain ends at walls, got 1\.0\. Use ends='forces'\."),
    (lambda: gr.scenes.compressed_chain(law=PULL, dimer=0.0), r"`dimer` must be .*above 0.*, got 0\.0"),
    (lambda: gr.scenes.compressed_chain(3, law=[PULL]),
        r"The length of `law` must be 4 \(the number of pairs\).*, got 1"),
    (lambda: gr.scenes.compressed_chain(3, law=gr.Hertz),
        r"The law of pair wall–1 must be an instance, such as Hertz\(k=\.\.\.\), got the class Hertz\."),
    (lambda: gr.scenes.compressed_chain(3, law=3.0),
        r"The law of pair wall–1 must be an object with force\(self, xi, xi_dot, pair\), got 3\.0\. For hard spheres "
        r"use granular\.edmd\."),
    (lambda: gr.scenes.compressed_chain(3, law=Saturating()),
        r"`force` must be a force that Saturating\(k=1000000\.0\) reaches at rest, got 20\.0 N at pair wall–1\."),
    (lambda: gr.scenes.compressed_chain(3, 1e9, law=gr.Hertz(1e3)),
        r"`gap\[0\]` must be at least minus the sum of both radii, got -9999\.999999999995\. Deeper overlaps would "
        r"exchange the centres\."),
    (lambda: gr.scenes.compressed_chain(3, law=PULL, ends="forces", floor=gr.walls.Sine(1e-9, 50.0)),
        r"`floor` must be None if the first body is a ball, got Sine\(amplitude=1e-09, frequency=50\.0, "
        r"phase=0\.0\)\. Give the body the mass math\.inf\."),
    (lambda: cases.loads("[scene]\nname = 'compressed-chain'\nlaw = 'Hertz'"),
        r"\[scene\]: compressed-chain has no parameter `law`; available: density, dimer, ends, floor, force, n, "
        r"radius, speed, striker\."),
    (lambda: cases.make("compressed-chain", forze=1.0),
        r"compressed-chain has no option `forze`; did you mean `force`\?"),
    (lambda: gr.MatchedEnd(0.0, 1.0),
        r"`load` must be a finite number above 0, got 0\.0\. A chain without static force has no slow waves"),
    (lambda: waves.matched_end(gr.scenes.compressed_chain(3, law=PULL, ends="force"), PULL), r"pressed against a wall"),
    (lambda: waves.stiffness("x", PULL),
        r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got 'x'\."),
    (lambda: waves.dispersion(math.nan, 1.0, 1.0), r"`phase\[0\]` must be a finite angle in rad, got nan\."),
    (lambda: waves.dispersion(1.0, 0.0, 1.0),
        r"`stiffness\[0\]` must be positive and finite, got 0\.0\. Without compression a chain has no linear waves\."),
    (lambda: waves.band_edges([1.0, 2.0], [1.0, 2.0, 3.0]),
        r"`stiffness` and `mass` must have one entry each per ball of a cell, got 2 and 3 entries\."),
    (lambda: waves.decay(-1.0, 1.0, 1.0),
        r"`omega\[0\]` must be an angular frequency in \[0, 1e\+100\] rad/s, got -1\.0\."),
    (lambda: waves.sound_speed(1.0, 1.0, 0.0), r"`length` must be a finite number above 0, got 0\.0\."),
    (lambda: waves.sound_speed([], 1.0, 1.0),
        r"`stiffness` must be an array of at least one stiffness, got an empty array\."),
    (lambda: waves.band_edges(1.0, [[1.0], [2.0, 3.0]]),
        r"`mass` must be an array of numbers.*, got \[\[1\.0\], \[2\.0, 3\.0\]\]"),
    (lambda: waves.decay("x", 1.0, 1.0), r"`omega` must be an array of numbers, got 'x'"),
    (lambda: waves.dispersion(1j, 1.0, 1.0), r"`phase` must be an array of numbers, got 1j"),
    (lambda: waves.SolitaryWave(1.5).force(None), r"`x` must be an array of numbers, got None"),
    (lambda: waves.SolitaryWave(1.5).width(1e-13),
        r"`share` must be a number in \[1e-12, 1\], got 1e-13\. Smaller forces are rounding errors\."),
    (lambda: waves.SolitaryWave(1.0),
        r"`exponent` must be a number in \[1\.1, 8\], got 1\.0\. With 1 there are no solitary waves\. Close to 1 "
        r"they are long, far above it steep\."),
    (lambda: waves.solitary(8, law=PULL), r"`n` must be .*at least 11.*, got 8"),
    (lambda: waves.solitary(20, law=PULL, at=3.0),
        r"`at` must be a number in \[5, 14\], got 3\.0\. The wave must lie within the row\."),
    (lambda: waves.solitary(20, law=gr.TsujiHertz(1e9, 0.1)),
        r"`law` must be F = A ξ\^p without damping, such as Hertz, got TsujiHertz\(k=1000000000\.0, alpha=0\.1\)\. "
        r"Other laws have no exact solitary wave\."),
    (lambda: waves.solitary(20, law=gr.LinearDashpot(1e9)),
        r"`exponent` must be a number in \[1\.1, 8\], got 1\.0\. With 1 there are no solitary waves\. Close to 1 "
        r"they are long, far above it steep\."),
    (lambda: waves.pulse(HARD),
        r"`run` must be a run of granular\.md, got Trajectory\(edmd, .*\)\. Hard spheres have no forces\."),
    (lambda: waves.pulse(RUN, shares=[1.5]), r"`shares\[0\]` must be a number in \(0, 1\), got 1\.5\."),
    (lambda: waves.pulse(gr.md.simulate(RUN.scene, PULL, t_end=1e-3)),
        r"`run` must have at least 5 samples, got 2\. Pass samples= to simulate\."),
    (lambda: waves.pulse(RUN).speed(1, 2),
        "`first` and `last` must enclose at least 2 contacts that the pulse passes one after the other, got 1 and "
        r"2\."),
    (lambda: waves.pulse(RUN).speed("a"), r"`first` must be a single number.*, got 'a'"),
    (lambda: waves.Pulse(*np.ones((4, 3))).speed(),
        "`first` and `last` must enclose at least 2 contacts that the pulse passes one after the other, got 0 and "
        r"None\."),
    (lambda: waves.picture(HARD),
        r"`run` must be a run of granular\.md, got Trajectory\(edmd, .*\)\. For hard spheres use show='velocity'\."),
    (lambda: waves.picture(RUN, "speed"), r"`show` must be one of force, velocity, got 'speed'"),
])
def test_misuse_is_a_sentence(call, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence):
        call()
