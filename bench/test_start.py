"""Import and start-up: wall time of a fresh process."""

import subprocess
import sys

import pytest

RUN_SCRIPT = "import granular as gr; gr.edmd.simulate(gr.scenes.three_balls(), gr.ConstantRestitution(0.7){})"
START_SCRIPTS = {
    "nothing": "pass",
    "import": "import granular",
    "a run": RUN_SCRIPT.format(""),
    "a compiled run": RUN_SCRIPT.format(", engine='compiled'"),
}


@pytest.mark.rotating
@pytest.mark.benchmark(group="start of a process", min_rounds=3)
@pytest.mark.parametrize("what", START_SCRIPTS)
def test_start(benchmark, what):
    benchmark(lambda: subprocess.run([sys.executable, "-c", START_SCRIPTS[what]], check=True))
