"""Moving walls as values: what equals what, and what is refused."""

import dataclasses
import math
import pickle

import numpy as np
import pytest
from scipy.interpolate import PPoly

from granular.scene.walls import Motion, Panels, Piecewise, Sine
from tests.helpers.misused import check_sentence
from tests.helpers.walls_at_random import INF


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
    (lambda: Sine(-1.0, 3.0), r"`amplitude` must be a number in \[0, 1e\+150\], got -1.0\. A"),
    (lambda: Sine(math.nan, 3.0),
        r"`amplitude` must be a number in \[0, 1e\+150\], got nan\. A phase of π reverses the motion\."),
    (lambda: Sine(1.0, 0.0),
        r"`frequency` must be a finite number above 0, got 0\.0\. For a wall at rest give None instead of a "
        r"Sine\."),
    (lambda: Sine(1.0, "3"), "`frequency` must be a single number, got '3'"),
    (lambda: Sine(1.0, 3.0, INF), "`phase` must be a finite number.*, got inf"),
    (lambda: Sine(1e100, 1e30),
        r"\(2π frequency\)² amplitude must be a number in \[0, 1e\+150\], got 3\.9478417604357433e\+161\."),
    (lambda: Sine(1e300, 20.0),
        r"`amplitude` must be a number in \[0, 1e\+150\], got 1e\+300\. A phase of π reverses the motion\."),
    (lambda: Sine.from_acceleration(-1.0, 3.0), "`gamma` must be a finite number of at least 0.*, got -1.0"),
    (lambda: Sine.from_acceleration(1.0, -3.0), r"`frequency` must be a finite number of at least 1e-150, got -3\.0\."),
    (lambda: Sine.from_acceleration(1.0, 3.0, 0.0), "`gravity` must be a finite number above 0.*, got 0.0"),
    (lambda: Piecewise([0.0, 1.0]),
        r"`coefficients` must be an array \(K\+1, n\), the highest power first, got None\. Or give a "
        r"scipy\.interpolate\.PPoly alone\."),
    (lambda: Piecewise([0.0], [[]]), r"`breaks` must be an array of at least 2 entries, got 1\."),
    (lambda: Piecewise([0.0, 0.0], [[1.0]]), r"`breaks\[1\]` must be larger than the entry before it, got 0\.0\."),
    (lambda: Piecewise([0.0, INF], [[1.0]]), r"`breaks\[1\]` must be a finite time.*, got inf"),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[1.0]]),
        r"`coefficients` must be an array of shape \(1, 2\), got an array of shape \(1, 1\)\. Give one column per "
        r"piece\."),
    (lambda: Piecewise([0.0, 1.0], [[math.nan]]), r"`coefficients\[0\]` must be a finite number.*, got nan"),
    (lambda: Piecewise([0.0, 1.0], np.zeros((21, 1))),
        r"`coefficients` must have 1 to 20 rows, one per power, got 21\."),
    (lambda: Piecewise([0.0, 1.0, 2.0], [[0.0, 0.5]]),
     r"`coefficients` must give a continuous path, got a jump of 0\.5 m at breaks\[1\] = 1\. Change the constant "
     r"of the later piece\."),
    (lambda: Piecewise(PPoly(np.zeros((2, 1, 3)), [0.0, 1.0])),
        r"`coefficients` must be an array of shape \(2, 1\), got an array of shape \(2, 1, 3\)\. Give one column "
        r"per piece\."),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, 1.5),
        r"`t_end` must be a number in \[0, 1\], got 1\.5\. The path of the wall covers only this interval\."),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(0.0, INF),
        r"`t_end` must be a number in \[0, 1\], got inf\. The path of the wall covers only this interval\."),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).panels(-0.5, 1.0),
        r"`t_start` must be a number in \[0, 1\], got -0\.5\. The path of the wall covers only this interval\."),
    (lambda: Piecewise([0.0, 1.0], [[1.0]]).velocity(3.0),
        r"`t_start` must be a number in \[0, 1\], got 3\.0\. The path of the wall covers only this interval\."),
    (lambda: Motion(3.0), "`function` must be a function m.*, got 3.0"),
    (lambda: Motion(parabola, 0.0), r"`accuracy` must be a number in \[2\.22045e-16, 0\.001\], got 0\.0\."),
    (lambda: Motion(parabola).panels(0.0, INF),
        r"`t_end` must be a finite number of at least 0, got inf\. A wall moved by a function requires t_end=\."),
    (lambda: Motion(parabola).panels(1.0, 0.5),
        r"`t_end` must be a finite number of at least 1, got 0\.5\. A wall moved by a function requires t_end=\."),
    (lambda: Motion(lambda t: math.nan).panels(0.0, 1.0),
        r"`function\(6\.690864879364128e-05\)` must be a finite number, got nan\. The wall needs a position at "
        r"every time of the run\."),
    (lambda: Motion(lambda t: "up").panels(0.0, 1.0),
        r"`function\(6\.690864879364128e-05\)` must be a single number, got 'up'\. The wall needs a position at "
        r"every time of the run\."),
    (lambda: Motion(jump).panels(0.0, 1.0),
        "`function` must be smooth, but polynomials do not reach an accuracy of 1e-15 of its excursion near t = "
        r"0\.3 s\. Use granular\.walls\.Piecewise for a path with corners, or a larger `accuracy` for a path with "
        r"noise\."),
    (lambda: Motion(lambda t: abs(t - 0.3)).panels(0.0, 1.0),
        "`function` must be smooth, but polynomials do not reach an accuracy of 1e-15 of its excursion near t = "
        r"0\.3 s\. Use granular\.walls\.Piecewise for a path with corners, or a larger `accuracy` for a path with "
        r"noise\."),
    (lambda: Motion(Motion(parabola).panels(0.0, 1.0)).panels(0.0, 2.0),
        r"`t_end` must be a number in \[0, 1\], got 2\.0\. The path of the wall covers only this interval\."),
    (lambda: Panels([0.0], [[1.0]]), r"`edges` must be an array of at least 2 entries, got 1\."),
    (lambda: Panels([0.0, 1.0], np.zeros((1, 21))),
        r"`series` must have at most 20 coefficients per panel, got 21\. Use shorter panels of a lower degree\."),
]


@pytest.mark.parametrize(("make", "message"), MISUSE)
def test_misuse_is_one_sentence(make, message):
    check_sentence(make, message)
