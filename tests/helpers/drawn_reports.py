"""Comparisons of scenes drawn at random."""

import math

import granular as gr
from tests.helpers.scenes_to_judge import question

INF = math.inf


def drawn(kind, seed):
    scene, law, end = question(kind, seed)
    return gr.compare(scene, law, t_end=end, max_events=20_000)
