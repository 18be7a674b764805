"""Figure 7: the sequence of contacts of viscoelastic balls over ε

As figure 3, with viscoelastic Hertz contacts. Both contacts have this ε at 3 m/s.
"""

from functools import partial

import numpy as np
import sequence
from setting import contacts, hertz_laws, main

import granular as gr

IMPACT_SPEED = 3.0
"""Speed in m/s of both balls when the lower ball hits the floor."""
LIGHT_SCENE = gr.scenes.three_balls((0.1, 0.0025), height=0.1).replace(velocity=[0.0, -IMPACT_SPEED, -IMPACT_SPEED])
"""Scene in which the lower ball hits the floor at t = 0."""


def compute(points):
    """Contacts over an ε that both pairs have at 3 m/s.

    γ/k then differs between the pairs.
    """
    found = sequence.numerical_sequence(lambda eps: contacts(LIGHT_SCENE, laws(eps)), np.linspace(0.3, 1.0, points))
    return {"parameter": "restitution at 3 m/s", **found}


def laws(restitution):
    """Laws of both pairs with one ε at 3 m/s."""
    return [gr.ViscoelasticHertz.from_restitution(restitution, k=elastic.k, speed=IMPACT_SPEED, pair=pair)
            for elastic, pair in zip(hertz_laws(LIGHT_SCENE), LIGHT_SCENE.pairs, strict=True)]


draw = partial(sequence.draw, label=r"$\varepsilon$ of both contacts, each at an impact speed of 3 m/s", top=10.0,
               marked=None)

if __name__ == "__main__":
    main(compute, draw, 300)
