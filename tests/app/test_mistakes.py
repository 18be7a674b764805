"""The `granular` command: one clear line for every mistake, and exit codes."""

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from granular import cases
from granular.app import cli

ABSURD = ["1e300", "1e-300", "nan", "inf", "0", "-1", "1e154", "1e-160", "1e17"]


def test_interrupt_is_exit_code_130(granular, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(cases.Case, "simulate", interrupted)
    assert granular("run gas")[::2] == (130, "granular: interrupted\n")


def test_traceback_on_request(granular):
    code, _, err = granular("run three-balls --gravity -1 --traceback")
    assert code == 2
    assert err.startswith("Traceback (most recent call last):")
    assert err.splitlines()[-1].startswith("granular: `gravity` must be a finite number of at least 0, got -1.0. ")


def test_a_bug_is_not_dressed_up_as_a_mistake_of_the_user(granular, monkeypatch):
    def broken(*arguments, **options):
        raise AttributeError("bug")

    monkeypatch.setattr(cases.Case, "simulate", broken)
    with pytest.raises(AttributeError):
        granular("run gas")


@pytest.mark.parametrize(("line", "sentence"), [
    ("rum gas", "unknown command rum; did you mean run?"),
    ("run", "run requires a scene or a TOML file. Known scenes: three-balls, "),
    ("compare", "compare requires a scene or a TOML file. Known scenes: three-balls, "),
    ("run three-bals", "`scene` must be a known name, got 'three-bals'. Did you mean 'three-balls'?"),
    ("scenes gaz", "`scene` must be a known name, got 'gaz'. Did you mean 'gas'?"),
    ("run gas --packng 0.2", "unknown option --packng; did you mean --packing?"),
    ("run gas -x", "unknown option -x; see --help."),
    ("run gas 7", "unexpected argument '7'; see granular run gas --help"),
    ("run gas -7", "unexpected argument '-7'; see granular run gas --help"),
    ("run gas --n 2.5", "argument --n: must be an integer, got '2.5'; see granular run gas --help"),
    ("run gas --n nan", "argument --n: must be an integer, got 'nan'; see granular run gas --help"),
    ("run gas --packing lots", "argument --packing: must be a number, got 'lots'; see granular run gas --help"),
    ("run gas --packing", "argument --packing: expected one argument; see granular run gas --help"),
    ("run gas --engine soft", "argument --engine: invalid choice: 'soft' (choose from "),
    ("run gas --engine edmd --dt 1e-7", "edmd.simulate has no option `dt`; available: "),
    ("run gas --restitution 1.2", "`restitution` must be a number in (0, 1], got 1.2."),
    ("run gas --t-end -1", "`t_end` must be a finite number of at least 0, got -1.0."),
    ("run three-balls --gap nan", "`gap` must be a finite number, got nan"),
    ("threshold three-balls --over gaap", "three-balls has no parameter `gaap`; did you mean `gap`?"),
    ("run none.toml", "none.toml: No such file or directory"),
    ("run gas --save none/out.npz", "none/out.npz: The directory 'none' does not exist. Create it first."),
    ("run gas --save out.txt",
     "`path` must be the name of a file that ends in .npz, .nc, .csv, .extxyz, got 'out.txt'"),
    ("sweep gas --over n=2,3 --save out", "`path` must be the name of a file that ends in .nc, got 'out'"),
    ("sweep gas --over n=2,3 --workers 0", "--workers must be an integer of at least 1, got 0."),
    ("sweep gas --over n=2,3 --workers 1000000", "--workers must be an integer from 1 to 1024, got 1000000."),
    ("sweep gas --over n=2,True", "The values of n must be a list of numbers or words, got [2, True]."),
    ("run gas --save .", ".: This is a directory. Give the name of a file."),
    ("compare gas --json none/out.json", "none/out.json: The directory 'none' does not exist. Create it first."),
    ("compare gas --plot none/out.png", "none/out.png: The directory 'none' does not exist. Create it first."),
    ("compare gas --plot out.pgn", "The suffix of out.pgn must be one of "),
    ("compare gas --plot out", "The suffix of out must be one of "),
    ("compare gas --film out.avi", "The suffix of out.avi must be one of .gif, .mp4, got '.avi'"),
    ("compare gas --film none/out.gif", "none/out.gif: The directory 'none' does not exist. Create it first."),
])
def test_a_mistake_is_one_line_and_exit_code_2(granular, line, sentence):
    code, out, err = granular(line)
    assert (code, out) == (2, "")
    assert err.startswith(f"granular: {sentence}")
    assert err.count("\n") == 1


def test_a_plot_without_matplotlib_says_how_to_get_it(granular, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.backend_bases", None)
    assert granular("compare gas --plot out.png")[::2] == (
        2, "granular: --plot requires matplotlib, which is not installed. Install it with: pip install "
           "'granular-collisions[plot]'\n")


def test_an_output_that_cannot_be_written_is_found_before_the_run(granular, monkeypatch):
    monkeypatch.setattr(cases.Case, "simulate", lambda *a, **k: pytest.fail("it ran"))
    assert granular("run gas --save none/out.npz")[0] == 2


def test_a_mistake_in_a_file_names_file_and_table(granular, tmp_path):
    (tmp_path / "own.toml").write_text('[scene]\nname = "gas"\nsead = 3\n')
    assert granular("run own.toml")[::2] == (2, "granular: own.toml: [scene]: unknown key sead; did you mean seed?\n")


def test_a_warning_is_one_line(granular):
    _, _, err = granular("run three-balls --engine md --dt 3e-6")
    assert err.startswith("granular: warning: ")
    assert err.count("\n") == 1


def test_options_of_a_file_that_compare_ignores_are_named(granular, tmp_path):
    _, text, _ = granular("scenes bouncing-ball")
    (tmp_path / "mine.toml").write_text(text + "samples = 300\nt_start = 1.0\n", encoding="utf-8")
    code, _, err = granular("compare mine.toml")
    assert code == 0
    assert "granular: warning: compare ignores samples, t_start in [run]." in err


@pytest.mark.parametrize(("line", "sentence"), [
    ("run three-balls --samples 1e15", "`samples` must be an integer from 2 to 10000000, got 1000000000000000"),
    ("compare three-balls --height 1e300", "in SI units"),
])
def test_what_is_beyond_machine_or_numbers_is_one_sentence(granular, line, sentence):
    code, _, err = granular(line)
    assert code == cli.EXIT_MISUSE
    assert sentence in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(("line", "named"), [
    ("run bouncing-ball --speed 1e300", "`speed` must be 0 or a number of magnitude 1e-75 to 1e+75, got 1e+300. Check"),
    ("compare chain --mass-ratio 1e308", "`mass_ratio` must be 0 or a number of magnitude 1e-75 to 1e+75, got 1e+308."),
    ("run heated-gas --engine edmd --dimer "
     "1e308", "`dimer` must be 0 or a number of magnitude 1e-75 to 1e+75, got 1e+308."),
    ("run compressed-chain --floor amplitude=1e17 "
     "frequency=1e-320", "`frequency` must be 0 or a number of magnitude 1e-75 to 1e+75, got 1e-320."),
    ("run chain --mass 1e308", "`mass` must be 0 or a number of magnitude 1e-75 to 1e+75, got 1e+308."),
])
def test_a_number_beyond_all_sizes_is_named_and_nothing_warns(granular, line, named):
    code, out, err = granular(line)
    assert (code, out) == (cli.EXIT_MISUSE, "")
    assert err.startswith(f"granular: {named}")
    assert err.count("\n") == 1


@pytest.mark.parametrize("seed", range(12))
def test_absurd_numbers_never_warn_and_are_refused_in_one_sentence(granular, seed):
    """Every scene, any options; 0 done, 3 no proper end, or one sentence."""
    rng = np.random.default_rng(seed)
    scene, engine = rng.choice(cases.names()), rng.choice(["edmd", "md"])
    options = [one.name.replace("_", "-") for one in cases.options(scene) if one.kind.startswith("float")]
    words = [f"--{name} {rng.choice(ABSURD)}" for name in rng.choice(options, 2, replace=False)]
    code, _, err = granular(f"run {scene} --engine {engine} --max-events 50 --max-steps 500 {' '.join(words)}"
                            if engine == "md" else f"run {scene} --engine edmd --max-events 50 {' '.join(words)}")
    assert code in (0, cli.EXIT_MISUSE, cli.EXIT_ABNORMAL)
    assert err.count("\n") == (code == cli.EXIT_MISUSE)


def test_closed_standard_output_is_no_traceback(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    assert cli.main(["run", "bouncing-ball", "--engine", "edmd"]) == 0


def test_a_reader_that_stops_reading_is_no_error():
    line = f"{sys.executable} -m granular scenes | head -n 0"
    done = subprocess.run(line, shell=True, capture_output=True, text=True)
    assert done.stderr == ""


@pytest.mark.rotating
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="the system has no /dev/full")
@pytest.mark.parametrize("line", ["--help", "run --help", "scenes"])
def test_a_full_disk_is_no_success(line):
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "granular", *line.split()], stdout=full, stderr=subprocess.PIPE,
                              text=True, check=False)
    assert done.returncode not in (0, 1)
    assert done.stderr.startswith("granular: ")
    assert "No space left" in done.stderr


@pytest.mark.parametrize(("line", "name"), [
    ("run mine.toml --save mine.toml", "mine.toml"),
    ("compare mine.toml --json ./mine.toml", "./mine.toml"),
    ("compare gas --plot both.svg --json both.svg", "both.svg"),
    ("compare three-balls --film both.gif --plot both.gif", "both.gif"),
    ("view run.npz --output run.npz", "run.npz"),
    ("view run.html", "run.html"),
])
def test_nothing_is_written_over_what_the_command_reads_or_writes(granular, tmp_path, line, name):
    (tmp_path / "mine.toml").write_text(granular("scenes gas")[1], encoding="utf-8")
    run = cases.make("three-balls").simulate("edmd", max_events=3)
    run.save(tmp_path / "run.npz")
    shutil.copy(tmp_path / "run.npz", tmp_path / "run.html")
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    code, out, err = granular(line)
    assert (code, out) == (2, "")
    assert err == f"granular: {name}: This command already reads or writes this file. Give another name.\n"
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_folder_is_no_run_to_view(granular):
    assert granular("view /")[::2] == (2, "granular: /: Is a directory\n")
