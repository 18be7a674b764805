"""What is not needed is not loaded; what is not installed is named."""

import subprocess
import sys
from importlib.util import find_spec

import pytest

IDLE = (
    "granular.run.saved_run", "granular.run.loaded_run", "granular._engine.describe", "granular.run.figures",
    "granular._engine.files", "granular.run.films",
    "granular.cases.case", "granular.cases.ready", "granular.comparison.view", "granular.comparison.figure",
    "granular.comparison.film", "granular.comparison.view", "granular.studies.frontiers", "granular.app.page",
    "granular.studies.reference", "granular.studies.sweeps", "granular.studies.thresholds", "granular.md.waves",
)
HEAVY = ("scipy", "numba", "matplotlib", "xarray", "pandas")


def fresh(code):
    """Run `code` in a fresh interpreter and return what it printed."""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


@pytest.mark.parametrize("module", [
    "granular", "granular.edmd", "granular.md", "granular.comparison", "granular.app.cli", "granular.scene.walls",
])
def test_import_is_light(module):
    assert fresh(f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])") == "[]"


def test_the_table_of_viscoelastic_collisions_is_read_when_it_is_needed():
    module = "granular.laws.viscoelastic_restitution"
    code = (
        f"import sys, granular as gr; law = gr.ViscoelasticHertz(1e9, 1e3); print({module!r} in sys.modules); "
        f"gr.binary.restitution(law, gr.Pair(1.0, 0.1, 0), 1.0); print({module!r} in sys.modules)"
    )
    assert fresh(code).split() == ["False", "True"]


def test_edmd_run_loads_nothing_heavy():
    code = (
        "import sys, granular as gr; "
        "gr.edmd.simulate(gr.scenes.gas(n=10), gr.ConstantRestitution(0.9), t_end=1.0); "
        f"print([m for m in {HEAVY} if m in sys.modules])"
    )
    assert fresh(code) == "[]"


def test_a_comparison_loads_neither_pictures_nor_files_nor_studies():
    assert [name for name in IDLE if not find_spec(name).has_location] == []
    code = (
        "import sys, granular as gr; "
        "print(gr.compare(gr.scenes.three_balls(), gr.LinearDashpot(5e7, 100.0), until=gr.until.contact(0, 2))); "
        f"print([m for m in {IDLE} if m in sys.modules])"
    )
    assert fresh(code).splitlines()[-1] == "[]"


def hidden(module, code):
    return fresh(f"import sys; sys.modules[{module!r}] = None\nimport granular as gr\n{code}")


def test_without_numba_runs_go_on_plain():
    code = (
        "law = gr.LinearDashpot(1e6)\n"
        "print(gr.md.simulate(gr.scenes.newtons_cradle(5), law, t_end=0.05, method='verlet').stats['engine'])\n"
        "try: gr.md.simulate(gr.scenes.newtons_cradle(5), law, t_end=0.05, engine='compiled')\n"
        "except ImportError as error: print(error)"
    )
    engine, advice = hidden("numba", code).splitlines()
    assert engine == "plain"
    assert "pip install 'granular-collisions[fast]'" in advice


def test_without_matplotlib_plot_says_what_to_install():
    code = (
        "report = gr.compare(gr.scenes.newtons_cradle(3), gr.Hertz(1e9))\n"
        "try: report.plot('x.png')\n"
        "except ImportError as error: print(error)"
    )
    assert "pip install 'granular-collisions[plot]'" in hidden("matplotlib", code)


def test_unknown_names_are_refused():
    with pytest.raises(AssertionError, match="module 'granular' has no attribute 'nonsense'"):
        fresh("import granular; granular.nonsense")
