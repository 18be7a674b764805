"""Decks of LAMMPS: what they say, what they refuse, and that LAMMPS gives our answer with them, at its order.

Its numbers are stored: ``python tests/run/test_export_lammps.py`` has ``lmp``, if it is on the path, make them again.
"""

import json
import math
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.laws.theory import obtained

STORED = Path(__file__).parents[1] / "reference" / "lammps.json"
STEPS = 2000, 8000, 32000
TWO = gr.Scene([0.03, 0.02], [0.01, 0.008], [1e-4], [1.0, -0.5])
ROW = gr.Scene([0.02, 0.03, 0.01], [0.01, 0.012, 0.008], [0.0, 1e-6], [1.0, 0.0, -0.5])
FALL = gr.Scene([math.inf, 0.05], [0.0, 0.01], [1e-3], [0.0, -2.0], gravity=9.81)
SOFT = 70e6, 0.3
SCENES = {
    "two spheres in touch": (TWO, gr.Hertz.from_material(*SOFT, TWO.pairs[0]), 3e-4, 2.0),
    "bounce on a floor": (FALL, gr.LinearDashpot.from_restitution(0.5, 1e5, FALL.pairs[0]), 4e-3, 1.0),
    "row, two contacts at once": (
        ROW, [gr.ViscoelasticHertz.from_material(*SOFT, restitution=0.8, speed=1.0, pair=p) for p in ROW.pairs],
        2e-3, 1.0),
    "row, by restitution": (ROW, [gr.TsujiHertz.from_material(*SOFT, 0.5, p) for p in ROW.pairs], 2e-3, 1.0),
}
"""Scene, law, end time in s, order of the difference in the time step."""


def deck_of(name):
    scene, law, end, _ = SCENES[name]
    return gr.export.lammps(scene, law, t_end=end, dt=end / STEPS[0])


def said(deck):
    """What a deck tells LAMMPS, without comments."""
    return [line for line in deck.splitlines() if line and not line.startswith("#")]


def alike(deck, other):
    """Whether two decks have the same words, and numbers that differ by rounding only."""
    number = re.compile(r"(?<=\s)-?\d\S*")
    words, numbers = zip(*((number.sub("#", text), list(map(float, number.findall(text))))
                           for text in ("\n".join(deck), "\n".join(other))), strict=True)
    return words[0] == words[1] and numbers[0] == pytest.approx(numbers[1], rel=1e-12)


def lammps(deck, end, steps):
    """Positions and velocities of the balls at the end, by LAMMPS."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck").write_text(deck)
        line = ["lmp", "-in", "deck", "-log", "none", "-screen", "none", "-var", "dt", repr(end / steps),
                "-var", "steps", str(steps)]
        subprocess.run(line, cwd=folder, check=True, capture_output=True)
        return np.loadtxt(Path(folder) / "last.txt", skiprows=9, ndmin=2)[:, 1:].T.tolist()


def released():
    """Numbers of the LAMMPS that is here."""
    about = subprocess.run(["lmp", "-help"], capture_output=True, text=True, check=True).stdout.split("\n")[1]
    runs = {name: {"deck": said(deck_of(name)), "runs": [lammps(deck_of(name), scene[2], n) for n in STEPS]}
            for name, scene in SCENES.items()}
    return {"version": about, "steps": STEPS} | runs


def differences(name, runs):
    """Largest difference of a velocity from ours, per largest speed, for every number of steps."""
    scene, law, end, _ = SCENES[name]
    ours = gr.md.simulate(scene, law, t_end=end)
    moving = ~scene.is_wall
    speed = np.abs(scene.velocity).max()
    return [np.abs(v - ours.velocity[-1][moving]).max() / speed for _, v in runs]


@pytest.mark.parametrize("name", SCENES)
def test_lammps_comes_to_our_answer_at_its_order(name):
    stored = json.loads(STORED.read_text())
    assert alike(stored[name]["deck"], said(deck_of(name))), "the stored numbers are of another deck"
    errors = differences(name, stored[name]["runs"])
    order = np.polyfit(np.log([1.0 / n for n in stored["steps"]]), np.log(errors), 1)[0]
    assert order == pytest.approx(SCENES[name][3], abs=0.25)
    assert errors[-1] < 2e-5


def test_another_deck_is_noticed():
    deck = said(deck_of("bounce on a floor"))
    assert alike(deck, deck)
    assert not alike(deck, [line.replace("9.81", "9.82") for line in deck])
    assert not alike(deck, [line.replace("velocity", "tsuji") for line in deck])


def test_two_contacts_of_the_row_are_open_at_once():
    for name in ("row, two contacts at once", "row, by restitution"):
        scene, law, end, _ = SCENES[name]
        log = gr.md.simulate(scene, law, t_end=end).contacts
        assert log["t_begin"].max() < log["t_end"].min()


@pytest.mark.soak
def test_lammps_here_gives_the_stored_numbers():
    if shutil.which("lmp") is None:
        pytest.skip("LAMMPS is not installed")
    stored = json.loads(STORED.read_text())
    for name in SCENES:
        now = [lammps(deck_of(name), SCENES[name][2], n) for n in STEPS]
        assert np.array(now) == pytest.approx(np.array(stored[name]["runs"]), abs=1e-9)


@pytest.mark.soak
@pytest.mark.parametrize(("name", "clipped"), [("tsuji", False), ("tsuji", True), ("coeff_restitution", False),
                                               ("coeff_restitution", True)])
def test_lammps_here_obtains_what_theory_says(name, clipped):
    if shutil.which("lmp") is None:
        pytest.skip("LAMMPS is not installed")
    scene = gr.Scene([0.03, 0.03], [0.01, 0.01], [1e-4], [1.0, -1.0])
    deck = gr.export.lammps(scene, gr.TsujiHertz.from_material(*SOFT, 0.5, scene.pairs[0]), t_end=1e-2)
    for e in (0.3, 0.5, 0.7, 0.9):
        own = re.sub(r"(hertz \S+) \S+ damping coeff_restitution", rf"\1 {e} damping {name}", deck)
        own = own if clipped else own.replace(" limit_damping\n", "\n")
        _, (lower, upper) = lammps(own, 1e-2, 400_000)
        assert 0.5 * (upper - lower) == pytest.approx(obtained(f"lammps/{name}", e, clipped=clipped), abs=3e-4)


def words(law, pair=TWO.pairs[0]):
    """What a deck says of a law in a pair."""
    deck = gr.export.lammps(TWO, law)
    return re.search(r"^pair_coeff 1 2 (.*) tangential linear_nohistory 0.0 0.0 limit_damping$", deck, re.MULTILINE)[1]


def test_the_words_of_a_law_are_its_force():
    pair = TWO.pairs[0]
    root, m = math.sqrt(pair.r_eff), pair.m_eff
    assert words(gr.LinearDashpot(1e5, 3.0)) == "hooke 100000.0 3.0 damping velocity"
    assert words(gr.PowerLaw(1e5, 1.0)) == "hooke 100000.0 0.0 damping velocity"
    assert words(gr.Hertz(1e7)) == f"hertz {1e7 / root!r} 0.0 damping velocity"
    assert words(gr.PowerLaw(1e7, 1.5)) == words(gr.Hertz(1e7)) == words(gr.TsujiHertz(1e7, 0.0))
    k, eta = re.fullmatch(r"hertz (\S+) (\S+) damping viscoelastic", words(gr.ViscoelasticHertz(1e7, 50.0))).groups()
    assert [float(k) * root, float(eta) * root * m] == pytest.approx([1e7, 50.0], rel=1e-14)
    asked = float(words(gr.TsujiHertz(1e7, 0.5)).split()[2])
    log = abs(math.log(asked))
    assert math.sqrt(5.0) * log / math.hypot(math.pi, log) == pytest.approx(0.5, rel=1e-14)


def test_a_law_of_ones_own_is_known_by_its_traits():
    @dataclass(frozen=True)
    class Own:
        k: float

        def force(self, xi, xi_dot, pair):
            return 2.0 * self.k * xi + 3.0 * xi_dot

    assert words(Own(4.0)) == "hooke 8.0 3.0 damping velocity"


def test_a_deck_is_plain_and_is_written_whole(tmp_path):
    floor = gr.Scene([math.inf, 1.0, 2.0, math.inf], [0, 0.1, 0.2, 0], [0.1, 0.0, 0.3], [0, -1, 1, 0], gravity=1.0)
    laws = [gr.LinearDashpot(1e4 * (1 + p.index), 2.0) for p in floor.pairs]
    deck = gr.export.lammps(floor, laws, tmp_path / "deck", t_end=0.25, dt=1e-3)
    assert deck.isascii()
    assert (tmp_path / "deck").read_text() == deck
    lines = said(deck)
    assert lines[:2] == ["variable dt index 0.001", "variable steps index 250"]
    assert "create_atoms 2 single 0.5 0.0 0.0" in lines
    assert "set atom 2 diameter 0.4 mass 2.0 vx 1.0" in lines
    assert "fix pull all gravity 1.0 vector -1 0 0" in lines
    wall = "tangential linear_nohistory 0.0 0.0 limit_damping xplane"
    assert f"fix wall0 all wall/gran granular hooke 10000.0 2.0 damping velocity {wall} 0.0 NULL" in lines
    assert f"fix wall2 all wall/gran granular hooke 30000.0 2.0 damping velocity {wall} NULL 1.0" in lines
    assert [line.split()[:5] for line in lines if line.startswith("pair_coeff")] == [
        ["pair_coeff", "*", "*", "hooke", "10000.0"], ["pair_coeff", "1", "2", "hooke", "20000.0"]]


SPRING = gr.LinearDashpot(1e5)
HANGS = gr.Scene([1.0, 1.0], [0.1, 0.1], [0.0], [1.0, 0.0], pendulum=1.0)
REFUSED = {
    "no scene": ("three-balls", SPRING, {},
        r"`scene` must be a granular\.Scene, such as granular\.scenes\.three_balls\(\), got 'three-balls'\."),
    "ring": (TWO.replace(gap=[0.1, 0.1], ring=True), SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got a ring\."),
    "pendula": (HANGS, SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got pendula\."),
    "force": (TWO.replace(external_force=[1.0, 0.0]), SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got external_force\."),
    "shaken": (FALL.replace(floor=gr.walls.Sine(1e-3, 50.0)), SPRING, {},
        "`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got a wall that is "
        r"shaken\."),
    "thermal": (FALL.replace(gravity=0.0, floor=gr.walls.Thermal(1.0)), SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got a thermal wall\."),
    "moving": (FALL.replace(velocity=[0.1, -2.0]), SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got a wall that moves\."),
    "point": (TWO.replace(radius=[0.0, 0.1]), SPRING, {},
        r"`scene` must have only balls with radii, walls at rest and gravity for LAMMPS, got a ball of radius 0\."),
    "memory": (TWO, gr.WaltonBraun(1e5, 2e5), {},
        r"The law of pair 0–1 must exist in LAMMPS, got WaltonBraun\(k_load=100000\.0, k_unload=200000\.0\)\. Use "
        r"F = k ξ \+ γ ξ̇, or F = k ξ\^\(3/2\) \+ D with D = 0, γ √ξ ξ̇ or α √\(m_eff k\) ξ\^¼ ξ̇ \(α < √5\)\."),
    "end": (TWO, gr.MatchedEnd(1.0, 1e5), {},
        r"The law of pair 0–1 must exist in LAMMPS, got MatchedEnd\(load=1\.0, stiffness=100000\.0\)\. Use F = k ξ \+ "
        r"γ ξ̇, or F = k ξ\^\(3/2\) \+ D with D = 0, γ √ξ ξ̇ or α √\(m_eff k\) ξ\^¼ ξ̇ \(α < √5\)\."),
    "power": (TWO, gr.PowerLaw(1e5, 2.0), {},
        r"The law of pair 0–1 must exist in LAMMPS, got PowerLaw\(k=100000\.0, exponent=2\.0\)\. Use F = k ξ \+ γ ξ̇, "
        r"or F = k ξ\^\(3/2\) \+ D with D = 0, γ √ξ ξ̇ or α √\(m_eff k\) ξ\^¼ ξ̇ \(α < √5\)\."),
    "never parts": (TWO, gr.TsujiHertz(1e5, 2.5), {},
        r"The law of pair 0–1 must exist in LAMMPS, got TsujiHertz\(k=100000\.0, alpha=2\.5\)\. Use F = k ξ \+ γ ξ̇, "
        r"or F = k ξ\^\(3/2\) \+ D with D = 0, γ √ξ ξ̇ or α √\(m_eff k\) ξ\^¼ ξ̇ \(α < √5\)\."),
    "rule": (TWO, gr.ConstantRestitution(0.5), {},
        r"`law` must be an object with force\(self, xi, xi_dot, pair\), got "
        r"ConstantRestitution\(restitution=0\.5\)\. For hard spheres use granular\.edmd\."),
    "count": (TWO, [SPRING, SPRING], {}, r"The length of `law` must be 1 \(the number of pairs\).*, got 2"),
    "dt": (TWO, SPRING, {"dt": 0.0}, r"`dt` must be .*above 0, got 0\.0"),
    "steps": (TWO, SPRING, {"dt": 1e-320}, r"`t_end / dt` must be a finite number of at most 1e\+15, got inf\."),
    "t_end": (TWO, SPRING, {"t_end": -1.0}, r"`t_end` must be .*above 0, got -1\.0"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_deck_cannot_hold_is_refused_and_nothing_written(name, tmp_path):
    scene, law, options, sentence = REFUSED[name]
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.export.lammps(scene, law, tmp_path / "deck", **options)
    assert list(tmp_path.iterdir()) == []


if __name__ == "__main__":
    STORED.write_text(json.dumps(released(), indent=1) + "\n")
