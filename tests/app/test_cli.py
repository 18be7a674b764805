"""The `granular` command: what it offers, prints and writes."""

import json
import re
import subprocess
import sys

import pytest

import granular as gr
from granular import Trajectory, cases, md
from granular.app.cli.parser import COMMAND_CLASSES
from granular.cases import build
from granular.cases.case import options_of
from granular.comparison import film


def test_help_teaches_with_examples_units_and_exit_codes(granular):
    code, out, err = granular("--help")
    assert (code, err) == (0, "")
    for text in ("granular compare three-balls --restitution 0.7", "SI units", "1    verify found", "130  interrupted"):
        assert text in out
    assert granular("")[1] == out


def test_version(granular):
    code, out, _ = granular("--version")
    assert code == 0
    assert out.startswith("granular ")


def test_scenes_lists_all_of_them(granular):
    code, out, _ = granular("scenes")
    assert code == 0
    for name in cases.names():
        assert name in out
        assert cases.about(name) in out


def test_a_scene_is_printed_as_a_file_that_runs(granular, tmp_path):
    _, text, _ = granular("scenes three-balls")
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    by_file, by_name = granular("run mine.toml --engine edmd"), granular("run three-balls --engine edmd")
    assert by_file == by_name
    assert by_file[0] == 0


@pytest.mark.parametrize("command", ["run", "compare"])
@pytest.mark.parametrize("name", cases.names())
def test_help_of_a_scene_lists_its_parameters_from_their_one_source(granular, command, name):
    code, out, _ = granular(f"{command} {name} --help")
    assert code == 0
    flat = " ".join(out.split())
    for option in cases.options(name):
        assert f"--{option.name.replace('_', '-')}" in out
    assert "`" not in out
    assert " ".join(cases.about(name).split()) in flat


def test_help_of_run_lists_the_options_of_both_engines(granular):
    _, out, _ = granular("run --help")
    for option in ("--method", "--dt", "--t-end", "--samples", "--save", "--ties"):
        assert option in out
    assert "granular run SCENE --help lists the parameters of a scene" in out


@pytest.mark.parametrize("command", sorted(COMMAND_CLASSES))
def test_help_has_no_python(granular, command):
    _, out, _ = granular(f"{command} --help")
    assert not re.search(r'\bNone\b|\barray\b|\bint\b|\w="', out)
    assert command != "run" or "number of evenly spaced times" in " ".join(out.split())


@pytest.mark.parametrize("engine", ["edmd", "md"])
def test_run_prints_contacts_and_the_state_at_the_end(granular, engine):
    code, out, err = granular(f"run three-balls --engine {engine} --restitution 0.7")
    assert (code, err) == (0, "")
    assert "ended (until): " in out
    assert {"edmd": "hard spheres", "md": "soft spheres"}[engine] in out
    contacts = [line.split()[1] for line in out.splitlines() if line.split()[:1] in (["floor–1"], ["1–2"])]
    assert contacts == ["1", {"edmd": "1", "md": "4"}[engine]]


def test_options_of_every_kind_reach_the_run(granular):
    code, out, _ = granular("run --radii 0.1 0.02 --gap=2e-4 three-balls --t-end 0.1 --method rk4 --dt 1e-6")
    assert code == 0
    assert "t = 0.1 s, 0 contacts" in out
    assert granular("run gas --n 3 --no-walls --t-end 0 --engine edmd")[1].count("ceiling") == 0
    assert granular("run gas --n 3 --walls --t-end 0 --engine edmd")[1].count("ceiling") > 0


def test_numbers_below_zero_in_every_notation_are_values(granular):
    for value in ("-1e-4", "-.5", "-3"):
        code, _, err = granular(f"run three-balls --gravity {value}")
        assert code == 2
        assert err.startswith("granular: `gravity` must be a finite number of at least 0, got -")


def test_dt_beyond_the_stability_limit_is_exit_code_3(granular):
    code, out, _ = granular("run newtons-cradle --engine md --dt 1e-3")
    assert code == 3
    words = r"unstable at t = \d\.\d+ s: dt = 0\.001 s times the highest rate of the contacts is \d"
    assert re.match(words, out.splitlines()[-1])
    assert not re.search(r"\b(nan|inf)", out)


def test_work_beyond_its_limit_is_exit_code_3(granular):
    code, out, _ = granular("run bouncing-ball --engine edmd --max-events 2")
    assert code == 3
    assert "ended (max_events): " in out


def test_save_writes_the_trajectory(granular, tmp_path):
    assert granular("run three-balls --engine edmd --save out.npz")[0] == 0
    kept = Trajectory.load(tmp_path / "out.npz")
    run = cases.make("three-balls").simulate("edmd")
    assert kept.contacts.tobytes() == run.contacts.tobytes()
    assert kept.velocity.tobytes() == run.velocity.tobytes()


def test_compare_says_where_the_engines_part(granular, tmp_path):
    code, out, err = granular("compare three-balls --restitution 0.7 --json out.json")
    assert (code, err) == (0, "")
    rows = {" ".join(line.split()[:4]).rstrip(","): line.split()[-2:] for line in out.splitlines() if line.strip()}
    assert rows["contacts of pair 1–2"] == ["1", "4"]
    (line,) = (line for line in out.splitlines() if line.startswith("ball 2 leaves, m/s"))
    assert [float(x) for x in line.split()[4:6]] == pytest.approx([5.9104, 2.2818], rel=1e-3)
    assert out.startswith("No: ")
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))


def test_compare_prints_all_that_there_is_with_v(granular):
    whole = granular("compare three-balls -v")[1]
    case = cases.make("three-balls")
    report = gr.compare(case.scene, case.law, case.rule, until=case.until)
    worth = gr.sensitivity("three-balls").line
    assert whole == granular("compare --verbose three-balls")[1] == f"{report.details()}\n{worth}\n"
    assert granular("compare three-balls")[1] == f"{report}\n"
    assert whole.count("  pairs ") == 4


def test_compare_reads_a_file_and_its_run_options(granular, tmp_path):
    _, text, _ = granular("scenes three-balls")
    (tmp_path / "mine.toml").write_text(text + 'method = "rk4"\nsamples = 3\n', encoding="utf-8")
    code, out, _ = granular("compare mine.toml")
    assert code == 0
    assert out.startswith("No: ")


def test_compare_of_an_unstable_run_is_exit_code_3(granular):
    code, out, _ = granular("compare newtons-cradle --dt 1e-3")
    assert code == 3
    assert "warning: " not in out  # overlaps and speeds of such a run mean nothing


def test_compare_draws(granular, tmp_path):
    assert granular("compare three-balls --plot out.png")[0] == 0
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


def test_compare_films(granular, tmp_path, monkeypatch):
    image = pytest.importorskip("PIL.Image")
    monkeypatch.setattr(gr.Comparison, "animate", lambda report, path: film.animate(report, path, seconds=0.2, fps=5))
    assert granular("compare three-balls --film out.gif")[0] == 0
    with image.open(tmp_path / "out.gif") as made:
        assert made.n_frames > 2


def fresh(*arguments: str, **settings) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "granular", *arguments], capture_output=True, text=True, **settings)


def test_listing_scenes_loads_nothing_heavy():
    code = ("import sys, granular.app.cli as cli; cli.main(['scenes']); "
            "print([m for m in ('scipy', 'numba', 'matplotlib', 'xarray') if m in sys.modules], file=sys.stderr)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_the_command_runs_as_a_module():
    done = fresh("run", "bouncing-ball", "--engine", "edmd")
    assert done.returncode == 0
    assert "ended (collapse): " in done.stdout
    assert fresh("run", "bouncing-bal").returncode == 2


def test_every_option_of_the_engines_is_documented():
    for option in options_of(md.simulate):
        assert option.about, option.name


@pytest.mark.parametrize("name", ["mine", "MINE.TOML", "./mine.txt"])
def test_a_file_of_any_name_is_a_scene(granular, tmp_path, name):
    _, text, _ = granular("scenes bouncing-ball")
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert granular(f"run {name} --engine edmd") == granular("run bouncing-ball --engine edmd")


def test_many_balls_are_not_as_many_laws(granular, monkeypatch):
    made, call = [], build.call
    monkeypatch.setattr(build, "call", lambda ways, *given, **more: made.append(ways) or call(ways, *given, **more))
    code, out, _ = granular("run gas --n 20000 --engine edmd --t-end 1e-6")
    assert code == 0
    assert len(made) == 3  # the scene; laws of ball and wall, of two balls
    assert "(19983 more)" in out
