"""Driven walls and forces that cannot be: one sentence, in the library, in files and in the command."""

import math

import pytest

import granular as gr
from granular import cases
from granular.scene.places import with_fitted_walls
from granular.scene.walls import Motion, Panels, Piecewise, Sine
from tests.helpers.driven_fronts import INF, LAW, TEXT, scene, shake
from tests.helpers.misused import check_sentence

# --- what is refused ----------------------------------------------------------------------------------------------

def of_toml(wall):
    return lambda: cases.loads(TEXT.format(wall))


def adiabatic(one):
    return lambda: gr.adiabatic.contacts(one, LAW)


MISUSE = [
    (lambda: scene(ceiling=Sine(1.0, 1.0)),
        r"`ceiling` must be None if the last body is a ball, got Sine\(amplitude=1\.0, frequency=1\.0, "
        r"phase=0\.0\)\. Give the body the mass math\.inf\."),
    (lambda: scene(floor=50.0), r"`floor` must be a wall of granular\.walls, such as Sine\(1e-3, 50\.0\), got 50\.0\."),
    (lambda: scene(floor=shake), r"`floor` must be a wall of granular\.walls, such as Sine\(1e-3, 50\.0\), got .*\."),
    (lambda: scene(external_force=[1.0, 0.0, 0.0]),
        r"`external_force\[0\]` must be 0, got 1\.0\. Forces do not act on walls\. Move a wall with floor= or "
        r"ceiling=\."),
    (lambda: scene(external_force=[0.0, INF, 0.0]), r"`external_force\[1\]` must be finite.*, got inf"),
    (lambda: scene(external_force=[1.0]),
        r"`external_force` must be an array of shape \(3,\), got an array of shape \(1,\)\. Give one force per "
        r"body, 0 for walls\."),
    (lambda: with_fitted_walls(scene(floor=Piecewise([0.0, 1.0], [[0.0]])), 0.0, 2.0),
        r"`t_end` must be a number in \[0, 1\], got 2\.0\. The path of the wall covers only this interval\."),
    (lambda: with_fitted_walls(scene(floor=Motion(shake)), 0.0, INF),
        r"`t_end` must be a finite number of at least 0, got inf\. A wall moved by a function requires t_end=\."),
    (lambda: with_fitted_walls(scene(floor=Motion(lambda t: math.nan)), 0.0, 1.0),
        r"`function\(6\.690864879364128e-05\)` must be a finite number, got nan\. The wall needs a position at "
        r"every time of the run\."),
    (lambda: Panels([0.0, 2.0], [[1.0]], frequency=3.0),
        r"`edges` must go from 0 to 1 turns if a frequency is given, got 0 to 2\."),
    (lambda: Panels([0.0, 1.0], [[1.0]], turn=3.0),
        r"`turn` must be two numbers, a float and its rounding error, got 3\.0\."),
    (lambda: Panels([0.0, 1.0], [[1.0]], error=-1.0), r"`error` must be a finite number of at least 0.*, got -1.0"),
    (of_toml("floor = 3"),
        r"\[scene\]: `floor` must be a wall of granular\.walls, such as Sine\(1e-3, 50\.0\), got 3\."),
    (of_toml("floor = { amplitude = 1.0 }"),
        r"\[scene\]: floor: The keys must be \(amplitude, frequency\) or \(gamma, frequency\), got "
        r"\(amplitude\)\."),
    (of_toml('floor = { type = "sine" }'),
        r"\[scene\]: floor: `type` must be one of Motion, Panels, Piecewise, Sine, Thermal, got 'sine'\. Did you "
        r"mean 'Sine'\?"),
    (of_toml('floor = { type = "Sine", amplitude = 1.0, frequenz = 3.0 }'),
        r"\[scene\]: floor: unknown key frequenz; did you mean frequency\?"),
    (of_toml('floor = { type = "Sine", amplitude = 1.0 }'),
        r"\[scene\]: floor: The keys must be \(amplitude, frequency\) or \(gamma, frequency\), got "
        r"\(amplitude\)\."),
    (of_toml('floor = { type = "Sine", amplitude = -1.0, frequency = 3.0 }'),
        r"\[scene\]: floor: `amplitude` must be a number in \[0, 1e\+150\], got -1\.0\. A phase of π reverses the "
        r"motion\."),
    (of_toml('flor = { type = "Sine", amplitude = 1.0, frequency = 3.0 }'),
        r"\[scene\]: unknown key flor; did you mean floor\?"),
    (of_toml('ceiling = { type = "Sine", amplitude = 1.0, frequency = 3.0 }'), r"the last body is a ball"),
    (of_toml('floor = { type = "Motion", function = "nowhere.py:f" }'),
        r"\[scene\]: floor: `function` must be 'file\.py:name' of a file beside this one, or 'module:name' of an "
        r"importable module, got 'nowhere\.py:f', which was not found \(\[Errno 2\] No such file or directory: "
        r"'nowhere\.py'\)\."),
    (of_toml('floor = { type = "Motion", function = "math:nothing" }'),
        r"\[scene\]: floor: `function` must be 'file\.py:name' of a file beside this one, or 'module:name' of an "
        r"importable module, got 'math:nothing', which was not found \(module 'math' has no attribute "
        r"'nothing'\)\."),
    (of_toml('floor = { type = "Motion", function = "sin" }'),
        r"\[scene\]: floor: `function` must be 'file\.py:name' of a file beside this one, or 'module:name' of an "
        r"importable module, got 'sin', which was not found \(No module named 'sin'\)\."),
    (of_toml('floor = { type = "Motion", function = "math:pi" }'),
        r"\[scene\]: floor: `function` must name a function m\(t\), got 'math:pi', which is 3\.141592653589793\."),
    (of_toml('floor = { type = "Motion", function = 3.0 }'), r"`function` must be a function m\(t\).*, got 3.0"),
    (of_toml('floor = { type = "Piecewise", breaks = [0, 1, 2], coefficients = [[0, 1]] }'),
        r"\[scene\]: floor: `coefficients` must give a continuous path, got a jump of 1 m at breaks\[1\] = 1\. "
        r"Change the constant of the later piece\."),
    (of_toml("external_force = [0, "
             "1]"), r"`external_force` must be an array of shape \(3,\), got an array of shape \(2,\)"),
    (lambda: cases.dumps(gr.Case(scene(floor=Motion(lambda t: t)), LAW)),
        "`function` must be importable by its name to be written to TOML, got <function "
        r"<lambda>\.<locals>\.<lambda> at 0x\w+>\. Put it into a module\."),
    (lambda: gr.scenes.vibrated_column(gamma=-1.0), "`gamma` must be a finite number of at least 0, got -1.0."),
    (lambda: gr.scenes.vibrated_column(gravity=0.0), r"`gravity` must be a finite number above 0.*, got 0.0"),
    (lambda: gr.scenes.bouncing_ball(plate=3.0),
        r"`floor` must be a wall of granular\.walls, such as Sine\(1e-3, 50\.0\), got 3\.0\."),
    (lambda: gr.sweep(gr.Case(scene(), LAW), {"floor.amplitude": [1.0]}),
        r"floor\.amplitude is not a parameter, because the case has no floor\."),
    (lambda: gr.sweep(gr.Case(scene(floor=Sine(1, 1)), LAW), {"floor.gamma": [1.0]}),
        r"Sine has no parameter `gamma`; available: amplitude, frequency, phase\."),
    (lambda: gr.sweep("bouncing-ball", {"plate.amplitude": [1.0]}),
        r"plate: The keys must be \(amplitude, frequency\) or \(gamma, frequency\), got \(amplitude\)\."),
    (adiabatic(gr.scenes.three_balls().replace(floor=Sine(1e-3, 50.0))),
        r"`scene` must have a floor at constant velocity and no forces, got Scene\(2 balls, floor, g = 9\.81 m/s², "
        r"floor Sine\(amplitude=0\.001, frequency=50\.0, phase=0\.0\)\)\. For other scenes use granular\.md\."),
    (adiabatic(gr.scenes.three_balls().replace(external_force=[0.0, 1.0, 0.0])),
        r"`scene` must have a floor at constant velocity and no forces, got Scene\(2 balls, floor, g = 9\.81 m/s², "
        r"forces\)\. For other scenes use granular\.md\."),
]


@pytest.mark.parametrize(("make", "message"), MISUSE)
def test_misuse_is_one_sentence(make, message):
    check_sentence(make, message)


@pytest.mark.parametrize(("line", "message"), [
    ("run bouncing-ball --plate Sine", "must be NAME=VALUE, such as type=Sine, got 'Sine'"),
    ("run bouncing-ball --plate type=Sin "
     "gamma=2", "plate: `type` must be one of Motion, .*, got 'Sin'. Did you mean 'Sine'?"),
    ("run bouncing-ball --plate type=Sine gamma=two frequency=3", "plate: `gamma` must be a single number, got 'two'."),
    ("run vibrated-column --gamma=-1", "`gamma` must be a finite number of at least 0, got -1.0."),
])
def test_the_command_refuses_in_a_line(line, message, granular):
    code, _, error = granular(line)
    assert code == 2
    assert error.count("\n") == 1
    assert message.partition(".*")[0] in error
