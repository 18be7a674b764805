"""What DEM codes make of the ε asked for, against Newton's equation with their own damping; and the page's table."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import granular as gr
from granular.laws import dashpot
from granular.laws.theory import DAMPING_CONVENTIONS, obtained

ASKED = np.array([0.05, *np.round(np.arange(0.1, 0.91, 0.1), 1), 0.95])
MASS, RADIUS, MODULUS = 0.02, 0.007, 3e7
STIFFNESS = 4.0 / 3.0 * MODULUS * math.sqrt(RADIUS)
"""k of k ξ^(3/2), of one contact in SI units."""
PAGE = (Path(__file__).parents[2] / "docs" / "guide" / "conventions.md").read_text(encoding="utf-8")
COLUMNS = [("lammps/tsuji", False), ("lammps/tsuji", True), ("lammps/coeff_restitution", False),
           ("lammps/coeff_restitution", True), ("mfix/hertz", False), ("mfix/hertz", True),
           ("yade/hertz-mindlin", True)]


def damping(convention, e):
    """η/ξ^¼ in kg/(s m^¼) as the documents write it: with masses, moduli and radii, not as a damping ratio."""
    log = np.abs(np.log(e)) / np.sqrt(np.pi**2 + np.log(e) ** 2)
    secant, tangent = 4.0 / 3.0 * MODULUS * math.sqrt(RADIUS), 2.0 * MODULUS * math.sqrt(RADIUS)
    marshall = 1.2728 - 4.2783 * e + 11.087 * e**2 - 22.348 * e**3 + 27.467 * e**4 - 18.022 * e**5 + 4.8218 * e**6
    fit = (-6.918798 * e - 16.41105 * e**2 + 146.8049 * e**3 - 796.4559 * e**4 + 2928.711 * e**5 - 7206.864 * e**6
           + 11494.29 * e**7 - 11342.18 * e**8 + 6276.757 * e**9 - 1489.915 * e**10)
    return {
        "lammps/tsuji": lambda: marshall * math.sqrt(MASS * secant),
        "lammps/tsuji-2026": lambda: math.sqrt(2.0) * marshall * math.sqrt(MASS * secant),
        "lammps/coeff_restitution": lambda: 2.0 * math.sqrt(5.0 / 6.0) * log * math.sqrt(1.5 * secant * MASS),
        "lethe": lambda: 2.0 * math.sqrt(5.0 / 6.0) * log * math.sqrt(tangent * MASS),
        "liggghts/hertz": lambda: 2.0 * math.sqrt(5.0 / 6.0) * log * math.sqrt(tangent * MASS),
        "mfix/hertz": lambda: 2.0 * math.sqrt(MASS * secant) * log,
        "yade/hertz-mindlin": lambda: 2.0 * math.sqrt(MASS * tangent) * np.sqrt(
            1.0 / (1.0 - (1.0 + e) ** 2 * np.exp(fit)) - 1.0),
    }[convention]()


def newton(alpha, clipped):
    """-v′ of contacts ξ̈ = -ξ^(3/2) - α ξ^¼ ξ̇ that begin at speed 1, all at once; 0 where none ends.

    With ξ = w⁴ and dt = w³ ds this is w′ = v/4, v′ = -w⁹ - α w⁴ v: smooth at the onset and at the end, which is where
    w⁵ + α v = 0 if it is clipped, else where w = 0.
    """
    def slope(s, y):
        w, v = y.reshape(2, -1)
        return np.concatenate([0.25 * v, -(w**9) - alpha * w**4 * v])

    end = 12.0 if clipped else 100.0
    run = solve_ivp(slope, (0.0, end), np.repeat([0.0, 1.0], len(alpha)), "DOP853", rtol=1e-13, atol=1e-15,
                    max_step=0.06, dense_output=True)

    def at(times):
        w, v = (np.diagonal(half) for half in run.sol(times).reshape(2, len(alpha), -1))
        return (w**5 + alpha * v if clipped else w), v

    s = np.linspace(0.0, end, 601)[1:]
    w, v = run.sol(s).reshape(2, len(alpha), -1)
    over = (w**5 + alpha[:, None] * v if clipped else w) < 0.0
    high = np.where(over.any(axis=1), s[over.argmax(axis=1)], s[-1])
    low = high - (s[1] - s[0])
    for _ in range(50):
        middle = 0.5 * (low + high)
        past = at(middle)[0] < 0.0
        low, high = np.where(past, low, middle), np.where(past, middle, high)
    return np.where(over.any(axis=1), -at(low)[1], 0.0)


@pytest.mark.rotating
@pytest.mark.parametrize("clipped", [False, True])
def test_what_is_obtained_is_what_newtons_equation_gives(clipped):
    names = [(name, e) for name in DAMPING_CONVENTIONS for e in ASKED]
    alpha = np.array([damping(name, e) for name, e in names]) / math.sqrt(MASS * STIFFNESS)
    found = [obtained(name, float(e), clipped=clipped) for name, e in names]
    assert found == pytest.approx(newton(alpha, clipped), rel=0.0, abs=1e-12)


def test_the_damping_that_gives_the_restitution_wanted():
    law = [gr.TsujiHertz.from_restitution(float(e), 1e7) for e in ASKED]
    assert newton(np.array([one.alpha for one in law]), True) == pytest.approx(ASKED, rel=0.0, abs=1e-12)
    known = {0.3: 1.111861087638, 0.5: 0.570813678782, 0.7: 0.273280483906, 0.9: 0.076619325689}
    for e, alpha in known.items():
        assert gr.TsujiHertz.from_restitution(e, 1e7).alpha == pytest.approx(alpha, rel=0.0, abs=5.1e-13)


def test_the_numbers_of_a_released_lammps():
    table = {0.3: (0.4396, 0.5026, 0.3000, 0.3971), 0.5: (0.6161, 0.6458, 0.5000, 0.5503),
             0.7: (0.7777, 0.7877, 0.7000, 0.7182), 0.9: (0.9284, 0.9294, 0.9000, 0.9020)}
    for e, row in table.items():
        ours = [obtained(name, e, clipped=c) for name, c in COLUMNS[:4]]
        assert ours == pytest.approx(row, abs=5.1e-5)


def test_contacts_that_pull_and_are_damped_too_much_never_part():
    assert obtained("yade/hertz-mindlin", 0.05, clipped=False) == 0.0
    assert dashpot.restitution_pulling(1.0) == 0.0 < dashpot.restitution_pulling(0.99)
    assert all(obtained(name, 1.0, clipped=c) > 0.999 for name in DAMPING_CONVENTIONS for c in (False, True))


@pytest.mark.parametrize("e", [5e-324, 1e-300, 1e-17])
def test_every_restitution_above_zero_has_an_answer(e):
    assert all(0.0 <= obtained(name, e, clipped=c) < 1.0 for name in DAMPING_CONVENTIONS for c in (False, True))
    assert obtained("yade/hertz-mindlin", 1e-9, clipped=True) == pytest.approx(1.0248e-9, rel=1e-4)


@pytest.mark.parametrize(("given", "sentence"), [
    (("lammps/tsui", 0.5, True),
        "`convention` must be one of lammps/tsuji, lammps/tsuji-2026, lammps/coeff_restitution, lethe, "
        r"liggghts/hertz, mfix/hertz, yade/hertz-mindlin, got 'lammps/tsui'\. Did you mean 'lammps/tsuji'\?"),
    (("lethe", 0.0, True), r"`restitution` must be a number in \(0, 1\], got 0\.0"),
    (("lethe", 0.5, "yes"), r"`clipped` must be True or False, got 'yes'"),
])
def test_misuse_is_said_in_one_sentence(given, sentence):
    name, e, clipped = given
    with pytest.raises((TypeError, ValueError), match=sentence):
        obtained(name, e, clipped=clipped)


def rows():
    """The page's table, made anew."""
    for e in ASKED.tolist():
        ours = [obtained(name, e, clipped=clipped) for name, clipped in COLUMNS]
        zeta = dashpot.damping_ratio(e)
        ask = f"{dashpot.restitution_pulling(zeta):.4f}" if zeta < 1.0 else "–"
        alpha = gr.TsujiHertz.from_restitution(e, 1.0).alpha
        yield f"| {e:g} | " + " | ".join(f"{x:.4f}" for x in ours) + f" | {ask} | {alpha:.12f} |"


def test_the_table_of_the_page_is_what_the_code_gives():
    assert re.findall(r"^\| 0\.\d.*\|$", PAGE, re.MULTILINE) == list(rows())
    assert len(PAGE.split()) - sum(len(row.split()) for row in rows()) <= 600


def test_the_restitution_to_ask_for_gives_the_one_wanted():
    for e in (0.2, 0.5, 0.9):
        asked = dashpot.restitution_pulling(dashpot.damping_ratio(e))
        assert obtained("lammps/coeff_restitution", asked, clipped=True) == pytest.approx(e, rel=1e-13)


if __name__ == "__main__":
    print("\n".join(rows()))
