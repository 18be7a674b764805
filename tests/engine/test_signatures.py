"""A call that does not fit a public function is one sentence with the nearest parameter."""

import inspect
import pickle
import re
from enum import EnumType

import pytest

import granular as gr
from granular import laws

MODULES = [gr, laws, *(getattr(gr, name) for name in gr.__all__ if inspect.ismodule(getattr(gr, name)))]
OPTIONS = "has no option|has no parameter"
"""Functions that pass options on name their receiver."""


def public():
    """Public callables of the package and of its public modules, except for those that pass options on."""
    for module in MODULES:
        names = getattr(module, "__all__", None) or [
            name for name, thing in vars(module).items()
            if name[0] != "_" and getattr(thing, "__module__", "") == module.__name__]
        for name in names:
            thing = getattr(module, name)
            odd = inspect.ismodule(thing) or isinstance(thing, EnumType) or getattr(thing, "_is_protocol", False)
            if callable(thing) and not odd and all(
                    p.kind is not p.VAR_KEYWORD for p in inspect.signature(thing).parameters.values()):
                yield pytest.param(thing, id=f"{module.__name__}.{name}")


@pytest.mark.parametrize("function", list(public()))
def test_an_unknown_keyword_is_one_sentence(function):
    given = list(inspect.signature(function).parameters.values())
    with pytest.raises(TypeError, match=r"^`[\w.]+` has no parameter `zzqx`; see help\([\w.]+\)\.$"):
        function(zzqx=1.0)
    long = [p.name for p in given if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD) and len(p.name) > 4]
    for name in long[:2]:
        with pytest.raises(TypeError, match=rf"^`[\w.]+` has no parameter `{name}x`; did you mean `\w+`\?$"):
            function(**{name + "x": 1.0})


SCENE, LAW = gr.scenes.three_balls(), gr.LinearDashpot(1e6)
CALLS = {
    "compare": (lambda: gr.compare(SCENE, LAW, drag=1.0), "`compare` has no parameter `drag`; see help(compare)."),
    "near": (lambda: gr.compare(SCENE, LAW, t_ende=1.0), "`compare` has no parameter `t_ende`; did you mean `t_end`?"),
    "scene": (lambda: gr.Scene([1.0], graviti=1.0), "`Scene` has no parameter `graviti`; did you mean `gravity`?"),
    "replace": (lambda: SCENE.replace(gapp=1.0), "`Scene` has no parameter `gapp`; did you mean `gap`?"),
    "constructor": (lambda: gr.Hertz.from_material(0.5, stif=1.0),
                    "`Hertz.from_material` has no parameter `stif`; see help(Hertz.from_material)."),
    "measure": (lambda: gr.measures.height(runn=1), "`height` has no parameter `runn`; did you mean `run`?"),
    "from arrays": (lambda: gr.Trajectory.from_arrays(SCENE, position=[[0.0] * 4]),
                    "`Trajectory.from_arrays` requires `time`, which is missing."),
    "two missing": (lambda: gr.compare(), "`compare` requires `scene`, `law`, which are missing."),
    "positional": (lambda: gr.md.simulate(SCENE, LAW, 1.0), "`simulate` takes 2 positional arguments, got 3. Pass the "
                                                            "other arguments by name."),
    "resume": (lambda: gr.edmd.resume(None, t_edn=1.0), "`resume` has no parameter `t_edn`; did you mean `t_end`?"),
}


@pytest.mark.parametrize(("call", "sentence"), CALLS.values(), ids=CALLS)
def test_the_sentence(call, sentence):
    with pytest.raises(TypeError, match=f"^{re.escape(sentence)}$"):
        call()


@pytest.mark.parametrize("call", [
    lambda: next(gr.edmd.events(SCENE, gr.ConstantRestitution(0.5), t_edn=1.0)),
    lambda: next(gr.md.events(SCENE, LAW, t_edn=1.0)),
    lambda: gr.cases.make("three-balls", gapp=1.0),
    lambda: gr.cases.make("three-balls").simulate("md", t_edn=1.0),
    lambda: gr.sweep("three-balls", "gap=1,2", gapp=1.0),
    lambda: gr.sensitivity("three-balls", gapp=1.0),
    lambda: gr.threshold("three-balls", over="gap", gapp=1.0),
])
def test_options_that_are_passed_on_are_refused_with_the_nearest_name(call):
    with pytest.raises(TypeError, match=rf"({OPTIONS}).*did you mean `\w+`\?$"):
        call()


def test_errors_from_within_pass_unchanged():
    def force(xi, xi_dot, pair):
        raise TypeError("mine")

    class Broken:
        def __init__(self):
            self.force = force

    with pytest.raises(TypeError, match=r"^mine$"):
        gr.md.simulate(SCENE, Broken(), t_end=1.0)
    with pytest.raises(TypeError, match=r"^`gap` must be an array of numbers, got 'x'"):
        SCENE.replace(gap="x")


def test_signatures_help_and_pickles_are_those_of_the_functions():
    assert "t_end" in inspect.signature(gr.compare).parameters
    assert inspect.signature(gr.Scene).parameters["gravity"].default == 0.0
    assert gr.md.simulate.__doc__.startswith("Run a scene as soft spheres")
    for thing in (gr.compare, gr.scenes.three_balls, gr.scenes.gas, gr.edmd.simulate, gr.Scene, LAW):
        assert pickle.loads(pickle.dumps(thing)) == thing
