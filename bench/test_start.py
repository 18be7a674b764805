"""Import and start-up: wall time of a fresh process."""

import subprocess
import sys

import pytest

RUN = "import granular as gr; gr.edmd.simulate(gr.scenes.three_balls(), gr.ConstantRestitution(0.7){})"
STARTS = {
    "nothing": "pass",
    "import": "import granular",
    "a run": RUN.format(""),
    "a compiled run": RUN.format(", engine='compiled'"),
}


@pytest.mark.benchmark(group="start of a process", min_rounds=3)
@pytest.mark.parametrize("what", STARTS)
def test_start(benchmark, what):
    benchmark(lambda: subprocess.run([sys.executable, "-c", STARTS[what]], check=True))
