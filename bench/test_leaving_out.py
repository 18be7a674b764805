"""Cost of features: each group is a run without and with one feature.

`leaving_out.py` prints the ratios.
"""

import pytest

from bench.leaving_out import RUN_PAIRS


@pytest.mark.rotating
@pytest.mark.parametrize("present", [False, True], ids=["without", "with"])
@pytest.mark.parametrize("feature", RUN_PAIRS)
def test_leaving_out(benchmark, feature, present):
    benchmark.group = feature
    run = benchmark(RUN_PAIRS[feature][present])
    assert run.status.name in ("time", "max_events")
