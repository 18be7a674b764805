"""The `granular` command: what it prints, its exit codes, and one clear line for every mistake."""

import io
import json
import subprocess
import sys
import time

import pytest

from granular import Trajectory, cases, cli, md
from granular.cases.options import options_of
from granular.cli.progress import Progress, clock


@pytest.fixture
def granular(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def command(line: str) -> tuple[int, str, str]:
        code = cli.main(line.split())
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return command


def test_help_teaches_with_examples_units_and_exit_codes(granular):
    code, out, err = granular("--help")
    assert (code, err) == (0, "")
    for text in ("granular compare three-balls --restitution 0.7", "SI units", "exit codes: 0 done; 2 misuse", "130 "):
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


@pytest.mark.parametrize("engine", ["edmd", "md"])
def test_run_prints_contacts_and_the_state_at_the_end(granular, engine):
    code, out, err = granular(f"run three-balls --engine {engine} --restitution 0.7")
    assert (code, err) == (0, "")
    assert "until: " in out
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
        assert err.startswith("granular: gravity is -")


def test_dt_beyond_the_stability_limit_is_exit_code_3(granular):
    code, out, _ = granular("run three-balls --engine md --dt 1e-2")
    assert code == 3
    assert "unstable: " in out


def test_work_beyond_its_limit_is_exit_code_3(granular):
    code, out, _ = granular("run bouncing-ball --engine edmd --max-events 2")
    assert code == 3
    assert "max_events: " in out


def test_save_writes_the_trajectory(granular, tmp_path):
    assert granular("run three-balls --engine edmd --save out.npz")[0] == 0
    kept = Trajectory.load(tmp_path / "out.npz")
    run = cases.make("three-balls").simulate("edmd")
    assert kept.contacts.tobytes() == run.contacts.tobytes()
    assert kept.velocity.tobytes() == run.velocity.tobytes()


def test_interrupt_is_exit_code_130(granular, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(cases.Case, "simulate", interrupted)
    assert granular("run gas")[::2] == (130, "granular: interrupted\n")


def test_traceback_on_request(granular):
    with pytest.raises(ValueError, match="gravity is"):
        granular("run three-balls --gravity -1 --traceback")


def test_a_bug_is_not_dressed_up_as_a_mistake_of_the_user(granular, monkeypatch):
    def broken(*arguments, **options):
        raise AttributeError("bug")

    monkeypatch.setattr(cases.Case, "simulate", broken)
    with pytest.raises(AttributeError):
        granular("run gas")


@pytest.mark.parametrize(("line", "sentence"), [
    ("rum gas", "'rum' is no command; did you mean run?"),
    ("run", "run needs a scene: one of three-balls, "),
    ("compare", "compare needs a scene: one of three-balls, "),
    ("run three-bals", "scene is 'three-bals': one of three-balls, ball-stack, newtons-cradle, chain, column, gas, "
                       "bouncing-ball is needed; did you mean three-balls?"),
    ("scenes gaz", "scene is 'gaz': one of "),
    ("run gas --packng 0.2", "'--packng' is no option of granular run gas; did you mean --packing?"),
    ("run gas -x", "'-x' is no option of granular run gas"),
    ("run gas 7", "'7' is one argument too many; see granular run gas --help"),
    ("run gas -7", "'-7' is one argument too many; see granular run gas --help"),
    ("run gas --n 2.5", "argument --n: '2.5' is no whole number; see granular run gas --help"),
    ("run gas --n nan", "argument --n: 'nan' is no whole number; see granular run gas --help"),
    ("run gas --packing lots", "argument --packing: 'lots' is no number; see granular run gas --help"),
    ("run gas --packing", "argument --packing: expected one argument; see granular run gas --help"),
    ("run gas --engine soft", "argument --engine: invalid choice: 'soft' (choose from "),
    ("run gas --engine edmd --dt 1e-7", "'dt' is no option of edmd.simulate"),
    ("run gas --restitution 1.2", "restitution is 1.2: "),
    ("run gas --t-end -1", "t_end is -1.0: "),
    ("run three-balls --gap nan", "gap is nan: a finite number is needed."),
    ("run none.toml", "none.toml: No such file or directory"),
    ("run gas --save none/out.npz", "none/out.npz: there is no directory 'none'; make it first."),
    ("run gas --save .", ".: is a directory; the name of a file is needed."),
    ("compare gas --json none/out.json", "none/out.json: there is no directory 'none'; make it first."),
    ("compare gas --plot none/out.png", "none/out.png: there is no directory 'none'; make it first."),
    ("compare gas --plot out.pgn", "ending of out.pgn is 'pgn': one of "),
    ("compare gas --plot out", "ending of out is '': one of "),
])
def test_a_mistake_is_one_line_and_exit_code_2(granular, line, sentence):
    code, out, err = granular(line)
    assert (code, out) == (2, "")
    assert err.startswith(f"granular: {sentence}")
    assert err.count("\n") == 1


def test_a_plot_without_matplotlib_says_how_to_get_it(granular, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.backend_bases", None)
    assert granular("compare gas --plot out.png")[::2] == (
        2, "granular: --plot needs matplotlib, which is not installed: pip install matplotlib.\n")


def test_an_output_that_cannot_be_written_is_found_before_the_run(granular, monkeypatch):
    monkeypatch.setattr(cases.Case, "simulate", lambda *a, **k: pytest.fail("it ran"))
    assert granular("run gas --save none/out.npz")[0] == 2


def test_a_mistake_in_a_file_names_file_and_table(granular, tmp_path):
    (tmp_path / "own.toml").write_text('[scene]\nname = "gas"\nsead = 3\n')
    assert granular("run own.toml")[::2] == (2, "granular: own.toml: [scene]: 'sead' is no key; did you mean seed?\n")


def test_a_warning_is_one_line(granular):
    _, _, err = granular("run three-balls --engine md --dt 3e-6")
    assert err.startswith("granular: warning: ")
    assert err.count("\n") == 1


# compare

def test_compare_says_where_the_engines_part(granular, tmp_path):
    code, out, err = granular("compare three-balls --restitution 0.7 --json out.json")
    assert (code, err) == (0, "")
    rows = {" ".join(line.split()[:4]).rstrip(","): line.split()[-2:] for line in out.splitlines() if line.strip()}
    assert rows["contacts of pair 1"] == ["1", "4"]
    assert [float(x) for x in rows["v_rel′ pair 1, m/s"]] == pytest.approx([3.7272, 0.17728], rel=1e-3)
    assert out.splitlines()[-1].startswith("No: ")
    assert json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))


def test_compare_reads_a_file_and_its_run_options(granular, tmp_path):
    _, text, _ = granular("scenes three-balls")
    (tmp_path / "mine.toml").write_text(text + 'method = "rk4"\nsamples = 3\n', encoding="utf-8")
    code, out, _ = granular("compare mine.toml")
    assert code == 0
    assert out.splitlines()[-1].startswith("No: ")


def test_compare_of_an_unstable_run_is_exit_code_3(granular):
    assert granular("compare three-balls --dt 1e-2")[0] == 3


def test_compare_draws(granular, tmp_path):
    assert granular("compare three-balls --plot out.png")[0] == 0
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


# progress

class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_says_how_long_a_run_will_take():
    progress = Progress(10.0, Terminal())
    assert progress.line(2.5, 7, 60.0) == "t = 2.5 s, 7 contacts, 1:00 so far, 25% of 10 s, at most 3:00 to go"
    share = Progress(1.0, Terminal(), "cells")
    assert share.line(0.25, 7, 60.0) == "7 cells, 1:00 so far, 25%, at most 3:00 to go"
    assert Progress(None, Terminal()).line(2.5, 7, 3700.0) == "t = 2.5 s, 7 contacts, 1:01:40 so far"


def test_progress_is_silent_on_short_runs_and_without_a_terminal(monkeypatch):
    now = time.monotonic()
    for stream, later in ((Terminal(), 0.1), (io.StringIO(), 100.0)):
        monkeypatch.setattr(time, "monotonic", lambda: now)
        with Progress(10.0, stream) as progress:
            monkeypatch.setattr(time, "monotonic", lambda later=later: now + later)
            progress(1.0, 1)
        assert stream.getvalue() == ""


def test_progress_shows_now_and_then_on_a_long_run_and_clears_its_line(monkeypatch):
    stream, now = Terminal(), time.monotonic()
    with Progress(10.0, stream) as progress:
        for later in (3.0, 3.1, 3.6):
            monkeypatch.setattr(time, "monotonic", lambda later=later: now + later)
            progress(1.0, 1)
    assert stream.getvalue().count("to go") == 2
    assert stream.getvalue().endswith("\r\x1b[K")


def test_clock():
    assert [clock(s) for s in (0.4, 59.6, 3599.0, 3600.0)] == ["0:00", "1:00", "59:59", "1:00:00"]


# as a process

def fresh(*arguments: str, **settings) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "granular", *arguments], capture_output=True, text=True, **settings)


def test_listing_scenes_loads_nothing_heavy():
    code = ("import sys, granular.cli as cli; cli.main(['scenes']); "
            "print([m for m in ('scipy', 'numba', 'matplotlib', 'xarray') if m in sys.modules], file=sys.stderr)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_the_command_runs_as_a_module():
    done = fresh("run", "bouncing-ball", "--engine", "edmd")
    assert done.returncode == 0
    assert "collapse: " in done.stdout
    assert fresh("run", "bouncing-bal").returncode == 2


def test_a_reader_that_stops_reading_is_no_error():
    line = f"{sys.executable} -m granular scenes | head -n 0"
    done = subprocess.run(line, shell=True, capture_output=True, text=True)
    assert done.stderr == ""


def test_every_option_of_the_engines_is_documented():
    for option in options_of(md.simulate):
        assert option.about, option.name


def test_options_of_a_file_that_compare_ignores_are_named(granular, tmp_path):
    _, text, _ = granular("scenes bouncing-ball")
    (tmp_path / "mine.toml").write_text(text + "samples = 300\nt_start = 1.0\n", encoding="utf-8")
    code, _, err = granular("compare mine.toml")
    assert code == 0
    assert "granular: warning: compare makes no use of samples, t_start in [run]." in err


@pytest.mark.parametrize("name", ["mine", "MINE.TOML", "./mine.txt"])
def test_a_file_of_any_name_is_a_scene(granular, tmp_path, name):
    _, text, _ = granular("scenes bouncing-ball")
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert granular(f"run {name} --engine edmd") == granular("run bouncing-ball --engine edmd")


@pytest.mark.parametrize(("line", "sentence"), [
    ("run three-balls --samples 1e15", "the memory of this machine is too small for that"),
    ("compare three-balls --height 1e300", "use other units"),
])
def test_what_is_beyond_machine_or_numbers_is_one_sentence(granular, line, sentence):
    code, _, err = granular(line)
    assert code == cli.MISUSE
    assert sentence in err
    assert err.count("\n") == 1


def test_closed_standard_output_is_no_traceback(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(["run", "bouncing-ball", "--engine", "edmd"]) == 0


def test_a_folder_for_figures_is_made(granular, tmp_path):
    pytest.importorskip("matplotlib")
    assert granular("figure sketch -o new/folder")[0] == 0
    assert (tmp_path / "new" / "folder" / "paper-sketch.png").read_bytes().startswith(b"\x89PNG")


def test_who_watches_is_told_once_that_machine_code_is_made(monkeypatch):
    from granular import _kernels
    from granular._roots import first_up_crossing

    pytest.importorskip("numba")
    said = io.StringIO()
    said.isatty = lambda: True
    monkeypatch.setattr(sys, "stderr", said)
    monkeypatch.setattr(_kernels, "on_making", [cli._say_compiling])
    _kernels.compiled.cache_clear()
    for known in (True, False, False):
        monkeypatch.setattr(_kernels, "on_disk", lambda function, inline, known=known: known)
        _kernels.compiled(first_up_crossing)
        assert bool(said.getvalue()) is not known
        _kernels.compiled.cache_clear()
    assert said.getvalue().count("compiling, once") == 1


@pytest.mark.parametrize(("work", "memory", "disk", "pays"), [
    (10, True, True, False), (100, False, False, False), (100, False, True, True), (100, True, False, True),
    (1000, False, False, True),
])
def test_machine_code_must_pay(work, memory, disk, pays, monkeypatch):
    from granular import _kernels

    monkeypatch.setattr(_kernels, "have_numba", lambda: True)
    monkeypatch.setattr(_kernels, "in_memory", lambda function, inline: memory)
    monkeypatch.setattr(_kernels, "on_disk", lambda function, inline: disk)
    assert _kernels.worth(_kernels.kernel, work, 50, 500) is pays
