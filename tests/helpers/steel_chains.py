"""Beads of steel as in experiments on chains: radius, the force that presses them, and laws for each of their pairs."""

import granular as gr

RADIUS, FORCE = 0.009525, 20.0


def steel(pair):
    return gr.Hertz.from_material(193e9, 0.3, pair)


def laws_of(scene, law):
    return [law(pair) if callable(law) else law for pair in scene.pairs]
