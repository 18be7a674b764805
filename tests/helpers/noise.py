"""Numbers as another machine would give them: the inputs of every scene moved by one unit in the last place, or not.

    NOISE=1 pytest        velocities and open gaps
    NOISE=2 pytest        masses, coefficients of force laws, coefficients of restitution
    NOISE=1:7 pytest      other last digits (any integer; 0 if not said)

A number's last bit is set to one that a hash of its other bits draws. So equal numbers stay equal, what is saved,
replaced or resumed is not moved again, and a mirror image or one in other units (powers of two) is moved alike. Numbers
of few digits (½, 3) stay, for closed forms; so do 0, ∞ and overlaps. Tests about the very digits that they give are
marked `exact`, and skipped here. Nothing in `granular` reads this; other processes are not moved.
"""

import dataclasses
import os
import sys
from functools import wraps
from importlib.util import find_spec

import numpy as np
import pytest

KIND, SEED = (int(x) for x in (os.environ.get("NOISE", "0") + ":0").split(":")[:2])
RECIPES = "granular.cases.scenes", "granular.cases", "granular.cases.balls", "granular.studies.sweeps"
PASSED_THROUGH = "granular.scene.", "granular.laws.", "granular.laws.rules", "dataclasses", __name__
MANTISSA, FEW = np.uint64(2**52 - 2), np.uint64(2**30 - 1)


def moved(numbers):
    """The same numbers, the last bit of each positive or negative one drawn anew."""
    bits = np.atleast_1d(np.asarray(numbers, np.float64)).view(np.uint64)
    upper = bits & MANTISSA
    mixed = (upper ^ np.uint64(SEED + 1)) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(29))) * np.uint64(0xBF58476D1CE4E5B9)
    drawn = (bits & ~np.uint64(1)) | (mixed >> np.uint64(63))
    return np.where(upper & FEW == 0, bits, drawn).view(np.float64).reshape(np.shape(numbers))


def from_outside():
    """Whether a test asks, or a recipe of scenes; not an engine that makes a scene on its way."""
    frame = sys._getframe(2)
    while frame.f_globals["__name__"].startswith(PASSED_THROUGH):
        frame = frame.f_back
    name = frame.f_globals["__name__"]
    return not name.startswith("granular.") or name.startswith(RECIPES)


def there(prefix):
    """Whether a module of that name, or modules below it, can be imported."""
    return find_spec(prefix.removesuffix(".")) is not None


def after(cls, change):
    """Have `change` called with every instance that is made of a class from outside, after its own checks."""
    own = cls.__init__

    @wraps(own)
    def init(self, *args, **more):
        own(self, *args, **more)
        if type(self) is cls and from_outside():
            change(self)

    cls.__init__ = init


def move_state(scene):
    put(scene, "velocity", moved(scene.velocity))
    put(scene, "gap", np.where(scene.gap > 0.0, moved(scene.gap), scene.gap))


def move_masses(scene):
    put(scene, "mass", np.where(np.isinf(scene.mass), np.inf, moved(scene.mass)))


def put(scene, name, numbers):
    numbers.flags.writeable = False
    scene.__dict__[name] = numbers


def move_coefficients(law):
    for field in dataclasses.fields(law):
        value = getattr(law, field.name)
        if isinstance(value, float) and 0.0 < value < np.inf:
            object.__setattr__(law, field.name, float(moved(value)))
        elif isinstance(value, tuple) and value and all(isinstance(x, float) for x in value):
            object.__setattr__(law, field.name, tuple(moved(value).tolist()))


def _patch():
    import granular as gr

    assert [name for name in (*RECIPES, *PASSED_THROUGH) if not there(name)] == []

    if KIND == 1:
        after(gr.Scene, move_state)
    elif KIND == 2:
        after(gr.Scene, move_masses)
        for cls in (gr.LinearDashpot, gr.Hertz, gr.ViscoelasticHertz, gr.TsujiHertz, gr.PowerLaw, gr.WaltonBraun,
                    gr.ConstantRestitution):
            after(cls, move_coefficients)


def pytest_itemcollected(item):
    if KIND and item.get_closest_marker("exact"):
        item.add_marker(pytest.mark.skip(reason="about the very digits that it gives"))


if KIND:
    _patch()
