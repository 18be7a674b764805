"""What leaving out saves: each group is a run without one thing and one with it; `leaving_out.py` prints ratios."""

import pytest

from bench.leaving_out import RUN_PAIRS


@pytest.mark.parametrize("there", [False, True], ids=["without", "with"])
@pytest.mark.parametrize("what", RUN_PAIRS)
def test_leaving_out(benchmark, what, there):
    benchmark.group = what
    run = benchmark(RUN_PAIRS[what][there])
    assert run.status.name in ("time", "max_events")
