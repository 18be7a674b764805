"""The page gives the library's answer: scenes and settings of its sliders at random, both ends of them too."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

HERE = Path(__file__).parent / "page"
ENDS = {"k": (4e3, 1e9), "eps": (0.1, 1.0), "gap": (0.0, 1e-7, 0.1), "t1": (1e-5, 0.03), "t2": (1e-5, 0.03)}
CHECK = """
const { check } = await import("GOLDEN");
const { readFileSync } = await import("node:fs");
const cases = JSON.parse(readFileSync("CASES", "utf8"));
const found = cases.map((one, i) => [i, check(one, 0)]);
console.log(JSON.stringify(found.filter(([, faults]) => faults.length)));
"""


@pytest.mark.parametrize("count", [8, pytest.param(500, marks=pytest.mark.soak)])
def test_the_page_answers_as_the_library_does(count, monkeypatch, tmp_path) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the answers of the page are not compared here")
    monkeypatch.syspath_prepend(HERE)
    from make_golden import REAL, SLIDERS, case, settings

    random, cases = np.random.default_rng(count), []
    for i in range(count):
        name = [*SLIDERS, *REAL][i % 5]
        v = settings(random, name)
        v |= {key: float(random.choice(ends)) for key, ends in ENDS.items() if key in v and random.random() < 0.15}
        cases.append(case(name, v, "left", rises=False))
    (tmp_path / "cases.json").write_text(json.dumps(cases), encoding="utf-8")
    script = CHECK.replace("GOLDEN", (HERE / "golden.mjs").as_uri()).replace("CASES", str(tmp_path / "cases.json"))
    run = subprocess.run([node, "--input-type=module", "-e", script], capture_output=True, text=True, check=True)
    assert [(cases[i], faults) for i, faults in json.loads(run.stdout)] == []
    told = [sum(one[key] is not None for one in cases) for key in ("answer", "error", "counts")]
    assert min(told) > 0.75 * count, told
