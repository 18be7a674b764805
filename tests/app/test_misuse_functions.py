"""A function that takes other arguments than it is given is refused in one sentence."""

import pytest

import granular as gr


class Own:
    """A law whose methods are given."""

    def __init__(self, **methods):
        self.__dict__.update(methods)


THREE, RULE = gr.scenes.three_balls(gap=1e-3), gr.ConstantRestitution(0.5)
NEEDED = r"must be a function with the arguments \(xi, xi_dot, pair\), got"
HINT = r"\. With xi_max, set memory = True\."
ARITIES = {
    "force": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, xi_dot: 1.0)),
              rf"`force` of the law of pair floor–1 {NEEDED} \(xi, xi_dot\){HINT}"),
    "order": (lambda: gr.compare(THREE, Own(force=lambda pair, xi, xi_dot: 1.0), t_end=1.0),
              rf"`force` of the law of pair floor–1 {NEEDED} \(pair, xi, xi_dot\){HINT}"),
    "no memory": (lambda: gr.binary.restitution(Own(force=lambda xi, v, p, top: 1.0), THREE.pairs[0], 1.0),
                  rf"`force` of `law` {NEEDED} \(xi, v, p, top\){HINT}"),
    "memory": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: 1.0, memory=True)),
               r"`force` of the law of pair floor–1 must be a function with the arguments \(xi, xi_dot, pair, "
               r"xi_max\), got \(xi, v, p\)\. Without xi_max, leave `memory` out\."),
    "trait": (lambda: gr.md.simulate(THREE, Own(force=lambda xi, v, p: xi, linear=lambda: (1.0, 0.0))),
              r"`linear` of the law of pair floor–1 must be a function with the argument \(pair\), got \(\)\."),
    "watch": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, watch=Own(force=lambda xi: 1.0)),
              rf"`force` of `watch` {NEEDED} \(xi\){HINT}"),
    "rule": (lambda: gr.edmd.simulate(THREE, lambda v: 0.5, t_end=0.1),
             r"`rule` must be a function with the arguments \(speed, pair\), got \(v\)"),
    "class": (lambda: gr.edmd.simulate(THREE, gr.ConstantRestitution, t_end=0.1),
              r"`rule` must be a function with the arguments \(speed, pair\), got \(restitution\)"),
    "on_event": (lambda: gr.edmd.simulate(THREE, RULE, t_end=0.1, on_event=lambda: 0),
                 r"`on_event` must be a function with the argument \(row\), got \(\)"),
    "keyword": (lambda: gr.md.simulate(THREE, gr.Hertz(1e7), t_end=0.1, on_event=lambda row, *, more: 0),
                r"`on_event` must be a function with the argument \(row\), got \(row, \*, more\)"),
    "motion": (lambda: gr.walls.Motion(lambda: 0.0),
        r"`function` must be a function with the argument \(t\), got \(\)"),
    "result": (lambda: gr.sweep("three-balls", {"gap": [1e-3]}, results=[lambda: 0.0]),
               r"`results` must be a function with the argument \(case\), got \(\)"),
    "observable": (lambda: gr.compare(THREE, gr.Hertz(1e7), t_end=0.1).effective_restitution(lambda: 0.0),
                   r"`observable` must be a function with the argument \(run\), got \(\)"),
    "pressed": (lambda: gr.scenes.rows._pressed(THREE, lambda: gr.Hertz(1e7), 1.0, 0),
                r"`law` must be a function with the argument \(pair\), got \(\)"),
}


@pytest.mark.parametrize("case", ARITIES)
def test_functions_of_other_arguments(case):
    act, sentence = ARITIES[case]
    with pytest.raises(TypeError, match=sentence):
        act()


def test_what_takes_anything_or_says_nothing_of_itself_is_let_through():
    seen = []
    run = gr.edmd.simulate(THREE, lambda *given: 0.5, t_end=0.5, on_event=seen.append, on_progress=lambda *so_far: 0)
    assert len(seen) == len(run.contacts) > 0
    assert gr.md.simulate(THREE, Own(force=lambda *given: 1e7 * given[0]), t_end=0.1).status.name == "time"


def test_mistakes_within_a_function_pass_through():
    with pytest.raises(TypeError, match="has no len"):
        gr.edmd.simulate(THREE, lambda speed, pair: len(3), t_end=0.5)
    with pytest.raises(TypeError, match="has no len"):
        gr.md.simulate(THREE, Own(force=lambda xi, xi_dot, pair: len(3)), t_end=0.5)
