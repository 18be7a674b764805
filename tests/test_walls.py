"""Moving walls as values: what equals what, and what is refused."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from scipy.interpolate import PPoly
from walls_at_random import INF

from granular.scene.walls import Motion, Panels, Piecewise, Sine


def parabola(t):
    return t * t


@pytest.mark.parametrize("wall", [Sine(0.1, 3.0), Piecewise([0.0, 1.0, 2.0], [[1.0, -1.0], [0.0, 1.0]]),
                                  Motion(parabola), Motion(parabola).panels(0.0, 1.0)], ids=lambda w: type(w).__name__)
def test_walls_are_values(wall):
    same = pickle.loads(pickle.dumps(wall))
    assert same == wall
    assert hash(same) == hash(wall)
    assert wall != "wall"
    with pytest.raises(dataclasses.FrozenInstanceError):
        wall.anything = 1


def test_walls_differ_where_their_numbers_do():
    assert Sine(0.1, 3.0) != Sine(0.1, 3.0, 1e-9)
    assert Piecewise([0.0, 1.0], [[1.0]]) != Piecewise([0.0, 2.0], [[1.0]])
    assert Motion(parabola) != Motion(parabola, 1e-12)
    assert Sine.from_acceleration(2.0, 50.0).amplitude == pytest.approx(2.0 * 9.81 / (100 * math.pi) ** 2, rel=1e-15)


def jump(t):
    return 1.0 if t > 0.3 else 0.0


MISUSE = [
    (lambda: Sine(-1.0, 3.0), r"amplitude is -1.0: a finite number of at least 0 and at most 1e\+150 is needed; a"),
    (lambda: Sine(math.nan, 3.0), "amplitude is nan: a finite number"),
    (lambda: Sine(1.0, 0.0), "frequency is 0.0: a finite number above 0 is needed; for a wall that does not move"),
    (lambda: Sine(1.0, "3"), "frequency is '3': a single number is needed"),
    (lambda: Sine(1.0, 3.0, INF), "phase is inf: a finite number"),
    (lambda: Sine(1e100, 1e30), r"\(2π frequency\)² amplitude is [0-9.]+e\+161: .* at most 1e\+150 is needed"),
    (lambda: Sine(1e300, 20.0), r"amplitude is 1e\+300: .* at most 1e\+150 is needed"),
    (lambda: Sine.from_acceleration(-1.0, 3.0), "gamma is -1.0: a finite number of at least 0"),
    (lambda: Sine.from_acceleration(1.0, -3.0), "frequency is -3.0: a finite number above 0"),
    (lambda: Sine.from_acceleration(1.0, 3.0, 0.0), "gravity is 0.0: a finite number above 0"),
    (lambda: Piecewise([0.0, 1.0]), "coefficients is None: an array .* is needed, or a scipy.interpolate.PPoly alone"),
    (lambda: Piecewise([0.0], [[]]), "breaks has 1 entries: at least 2 are needed"),
    (lambda: Piecewise([0.0, 0.0], [[1.0]]), r"breaks\[0\] is 0.0: breaks must increase"),
    (lambda: Piecewise([0.0, INF], [[1.0]]), r"breaks\[1\] is inf: a finite time"),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[1.0]]), r"shape of coefficients is \(1, 1\): \(1, 2\) is needed; one column"),
    (lambda: Piecewise([0.0, 1.0], [[math.nan]]), r"coefficients\[0\] is nan: a finite number"),
    (lambda: Piecewise([0.0, 1.0], np.zeros((21, 1))), "coefficients has 21 rows: 1 to 20 are needed"),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[0.0, 0.5]]),
     r"coefficients make the wall jump by 0.5 m at breaks\[1\] = 1: a continuous path is needed"),
    (lambda: Piecewise(PPoly(np.zeros((2, 1, 3)), [0.0, 1.0])), "shape of coefficients is"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, 1.5), "t_end is 1.5: a number .* at most 1 .*there the path"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, INF), "t_end is inf: .*there the path of the wall ends"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(-0.5, 1.0), "t_start is -0.5: .*there the path of the wall begins"),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).velocity(3.0), "t is 3.0"),
    (lambda: Motion(3.0), "function is 3.0: a function m"),
    (lambda: Motion(parabola, 0.0), "accuracy is 0.0"),
    (lambda: Motion(parabola).panels(0.0, INF), "t_end is inf: a finite number of at least 0 is needed; .*give t_end"),
    (lambda: Motion(parabola).panels(1.0, 0.5), "t_end is 0.5"),
    (lambda: Motion(lambda t: math.nan).panels(0.0, 1.0), r"function\(\S+\) is nan: a finite number is needed"),
    (lambda: Motion(lambda t: "up").panels(0.0, 1.0), r"function\(\S+\) is 'up': a single number is needed"),
    (lambda: Motion(jump).panels(0.0, 1.0), r"function is not smooth near t = 0\.3"),
    (lambda: Motion(lambda t: abs(t - 0.3)).panels(0.0, 1.0), r"function is not smooth near t = 0\.3"),
    (lambda: Motion(Motion(parabola).panels(0.0, 1.0)).panels(0.0, 2.0), "t_end is 2.0: .*there the path"),
    (lambda: Panels([0.0], [[1.0]]), "edges has 1 entries"),
    (lambda: Panels([0.0, 1.0], np.zeros((1, 21))), "series has 21 coefficients"),
]


@pytest.mark.parametrize(("make", "message"), MISUSE)
def test_misuse_is_one_sentence(make, message):
    with pytest.raises((TypeError, ValueError), match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
    assert str(caught.value).endswith((".", "?"))
