"""Figure 8: the sequence of contacts of balls of one material over its viscosity

As figure 7, with one dissipative constant A in both contacts, whose ε then differ.
"""

from functools import partial

import numpy as np
import sequence
from setting import contacts, hertz_laws, main
from viscoelastic import LIGHT_SCENE

import granular as gr


def compute(points):
    """Contacts over the dissipative constant A in s of both pairs."""
    grid = np.append(0.0, np.geomspace(1e-7, 3e-5, points))
    return {"parameter": "A in s", **sequence.numerical_sequence(lambda a: contacts(LIGHT_SCENE, laws(a)), grid)}


def laws(a):
    """Laws of both pairs for one material with A = `a` in s: γ = (3/2) A k."""
    return [gr.ViscoelasticHertz(elastic.k, 1.5 * a * elastic.k) for elastic in hertz_laws(LIGHT_SCENE)]


draw = partial(sequence.draw, label=r"$A$  ($\mu$s)", top=10.0, unit=1e6, marked=None)

if __name__ == "__main__":
    main(compute, draw, 300)
