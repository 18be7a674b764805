"""Scenes, laws and runs that are misused, and the check of a sentence."""

import math
import re
from dataclasses import dataclass

import pytest

from granular import edmd, laws, md, scenes
from granular.laws import rules
from granular.scene import Scene

STACK = scenes.three_balls()
PAIR = STACK.pairs[1]
SOFT = laws.LinearDashpot(5e7, 100.0)
HARD = rules.ConstantRestitution(0.7)
OVERLAP = Scene([1.0, 1.0], [0.1, 0.1], [-0.01], [0.0, 0.0])


def scene(**changes):
    values = {"mass": [math.inf, 2.0, 1.0], "radius": [0.0, 0.1, 0.2], "gap": [0.5, 1e-3], "velocity": [0.0, -1.0, 2.0]}
    return Scene(**(values | changes))


def soft(*arguments, **options):
    return md.simulate(*(arguments or (STACK, SOFT)), **({"t_end": 0.01} | options))


def hard(*arguments, **options):
    return edmd.simulate(*(arguments or (STACK, HARD)), **({"t_end": 0.01} | options))


@dataclass(frozen=True)
class Forceless:
    k: float = 1.0


@dataclass(frozen=True)
class Contradiction:
    """Its force and its trait disagree."""

    k: float = 1.0

    def force(self, xi, xi_dot, pair):
        return self.k * xi

    def linear(self, pair):
        return 2.0 * self.k, 0.0


def check_sentence(call, sentence):
    """Whether a call raises an error of one clear sentence that contains a pattern."""
    with pytest.raises((ValueError, TypeError)) as caught:
        call()
    message = str(caught.value)
    assert re.search(sentence, message), message
    assert message[-1] in ".?"
    assert "\n" not in message
