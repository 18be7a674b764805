"""Cases by name, their options, and parameters as data."""

import math

import pytest

from granular import cases, scenes, until
from granular.cases.case import descriptions, options_of, summary
from granular.laws import Hertz, LinearDashpot, TsujiHertz, ViscoelasticHertz, WaltonBraun
from granular.laws.rules import ConstantRestitution
from tests.helpers.same_scene import assert_same_scene

pytestmark = pytest.mark.core
KINDS = ("float", "int", "bool", "str", "Sequence[float]", "float | None", "Sequence[float] | None",
         "float | Sequence[float]", "str | None", "str | Ball", "str | Ball | None", "Any")
"""What the command line can read."""


@pytest.mark.parametrize("name", cases.names())
def test_every_name_gives_a_whole_case_and_every_option_is_documented(name):
    case = cases.make(name)
    assert len(case.law) == case.scene.n_pairs
    assert isinstance(case.rule, ConstantRestitution)
    assert case.until is not None or case.t_end > 0.0
    assert case.about == cases.about(name) != ""
    for option in cases.options(name):
        assert option.about, f"{option.name} has no description"
        assert option.kind in KINDS


def test_the_paper_s_case():
    case = cases.make("three-balls")
    assert_same_scene(case.scene, scenes.three_balls())
    assert case.law == tuple(LinearDashpot.from_restitution(0.7, 5e7, pair) for pair in case.scene.pairs)
    assert case.rule == ConstantRestitution(0.7)
    assert case.until == until.contact(0, 2)
    assert case.t_end == pytest.approx(10.0 * math.sqrt(2.0 * 0.5 / 9.81))


def test_options_reach_the_scene_the_laws_and_the_rule():
    case = cases.make("three-balls", gap=1e-3, restitution=[0.9, 0.5], stiffness=1e6, law="WaltonBraun", t_end=2.0)
    assert case.scene.gap[1] == 1e-3
    assert case.law == (WaltonBraun.from_restitution(0.9, 1e6), WaltonBraun.from_restitution(0.5, 1e6))
    assert [case.rule(1.0, pair) for pair in case.scene.pairs] == [0.9, 0.5]
    assert case.t_end == 2.0


def test_a_law_whose_restitution_falls_with_speed_gives_the_rule_itself():
    case = cases.make("bouncing-ball", law="ViscoelasticHertz", restitution=0.8)
    speed, pair = math.sqrt(2.0 * 9.81), case.scene.pairs[0]
    assert case.law == (ViscoelasticHertz.from_restitution(0.8, speed, 5e7, pair),)
    assert case.rule is None
    rule = case.physics("edmd")
    assert rule(speed, pair) == pytest.approx(0.8, rel=1e-9)
    assert rule(0.1 * speed, pair) > 0.8


def test_steel_cradle_is_elastic_hertz_unless_told_otherwise():
    law = cases.make("newtons-cradle").law[0]
    assert isinstance(law, TsujiHertz)
    assert law.force(1e-6, 0.3, cases.make("newtons-cradle").scene.pairs[0]) == Hertz(2e10).force(1e-6, 0.3, None)
    assert cases.make("newtons-cradle", restitution=0.9).law[0].alpha > 0.0


def test_elastic_hertz_goes_by_its_name():
    case = cases.make("newtons-cradle", law="Hertz")
    assert set(case.law) == {Hertz(2e10)}
    assert case.rule == ConstantRestitution(1.0)
    assert cases.make("three-balls", law="Hertz", restitution=1.0, stiffness=1e9).law == (Hertz(1e9),) * 2


def test_pairs_that_are_alike_share_one_law():
    gas = cases.make("gas", n=1000)
    assert len({id(law) for law in gas.law}) == 2  # of ball and wall, of two balls
    assert len({id(law) for law in cases.loads(cases.dumps(gas)).law}) == 2


def test_gravity_sets_the_end_where_it_is_needed():
    assert cases.make("column").t_end is None
    assert cases.make("column", gravity=9.81).t_end > 0.0
    assert cases.make("ball-stack", speed=2.0).t_end == pytest.approx(20.0 / 9.81)
    assert cases.make("gas", temperature=0.0).t_end is None


@pytest.mark.parametrize(("call", "sentence"), [
    (lambda: cases.make("three-bals"),
        r"`scene` must be a known name, got 'three-bals'\. Did you mean 'three-balls'\?"),
    (lambda: cases.make("gas", paking=0.2), r"gas has no option `paking`; did you mean `packing`\?"),
    (lambda: cases.make("gas", zzz=0.2),
        "gas has no option `zzz`; available: law, length, mass, mass_spread, material, n, packing, restitution, "
        r"seed, speeds, stiffness, temperature, walls\."),
    (lambda: cases.make("gas", law="Herz"),
        r"`law` must be one of Hertz, LinearDashpot, TsujiHertz, ViscoelasticHertz, WaltonBraun, got 'Herz'\. Did "
        r"you mean 'Hertz'\?"),
    (lambda: cases.make("gas", law="Hertz"),
        r"`restitution` must be 1, got 0\.9\. Hertz's law is elastic\. For damping use TsujiHertz or "
        r"ViscoelasticHertz\."),
    (lambda: cases.make("gas", n=-1), r"`n` must be an integer of at least 1, got -1"),
    (lambda: cases.make("gas", n=10**9), r"`n` must be an integer from 1 to 10000000, got 1000000000\."),
    (lambda: cases.make("gas", restitution=1.2), r"`restitution` must be a number in \(0, 1\], got 1\.2"),
    (lambda: cases.make("three-balls", restitution=[0.7]),
        r"The length of `restitution` must be 2 \(the number of pairs\).*, got 1"),
    (lambda: cases.make("gas", stiffness=-1.0), r"`stiffness` must be a finite number above 0, got -1\.0"),
    (lambda: cases.make("gas", t_end=-1.0), r"`t_end` must be a finite number of at least 0, got -1\.0"),
    (lambda: cases.loads(None), r"`text` must be the text of a TOML file, got None\. To read a file, use load\."),
    (lambda: cases.make("gas").simulate("mdd"), r"`engine` must be one of edmd, md, got 'mdd'\. Did you mean"),
    (lambda: cases.make("gas").simulate("edmd", dt=1e-7),
        r"edmd\.simulate has no option `dt`; available: collapse, elastic_below, engine, log, max_events, "
        r"merge_below, on_event, on_progress, progress, samples, seed, t_end, t_start, tc, ties, until, watch\."),
    (lambda: cases.Case(scenes.gas(), None).simulate("md"),
        r"`law` must be a force law for md, got None\. Give one, such as LinearDashpot\(k=5e7\)\."),
    (lambda: cases.Case(scenes.gas(), None).simulate("edmd"),
        r"`law` must be a force law for edmd, got None\. Give one, such as LinearDashpot\(k=5e7\)\."),
])
def test_misuse_of_names_and_options_is_a_sentence(call, sentence):
    with pytest.raises((ValueError, TypeError), match=sentence):
        call()


def test_a_docstring_is_read_parameter_by_parameter():
    def function(a, b=1.0, c="x", *, d=None):
        """Do something
        useful.

        And more.

        Parameters
        ----------
        a, b : float
            Two numbers,
            in m.
        c : {"x", "y"}
            A choice.

        Returns
        -------
        e : float
            Not a parameter.
        """

    both = "Two numbers, in m."
    assert descriptions(function) == {"a": both, "b": both, "c": '{"x", "y"}: A choice.'}
    assert summary(function) == "Do something useful."
    assert [(o.name, o.default, o.about) for o in options_of(function)] == [
        ("b", 1.0, "Two numbers, in m."), ("c", "x", '{"x", "y"}: A choice.'), ("d", None, "")]


def test_modules_show_what_is_theirs():
    from granular import adiabatic, binary, theory, until

    for module in (adiabatic, binary, scenes, theory, until):
        assert dir(module) == module.__all__
        room = ".".join(module.__name__.split(".")[:2])
        assert all(getattr(module, name).__module__.startswith(room) for name in module.__all__)
