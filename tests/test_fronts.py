"""Command, library, file and sweep are one program: the same question gets the same numbers from all of them."""

import json

import numpy as np
import pytest

import granular as gr
from granular import isolation

pytest.importorskip("xarray")


def question(seed):
    """A ready-made scene, options of it and of its contacts, at random."""
    random = np.random.default_rng(seed)
    eps = float(random.uniform(0.3, 1.0))
    own = {
        "three-balls": {"gap": float(10.0 ** random.uniform(-6, -2)), "height": float(random.uniform(0.2, 2.0))},
        "ball-stack": {"n": int(random.integers(2, 4)), "mass_ratio": float(random.uniform(0.05, 0.5))},
        "newtons-cradle": {"n": int(random.integers(3, 6)), "gap": float(10.0 ** random.uniform(-7, -3))},
        "chain": {"n": int(random.integers(2, 6))},
    }
    name = str(random.choice(list(own)))
    law = str(random.choice(["LinearDashpot", "WaltonBraun", "TsujiHertz"]))
    return name, own[name] | {"restitution": eps, "law": law, "stiffness": float(10.0 ** random.uniform(6, 8))}


@pytest.mark.parametrize("seed", range(8))
def test_all_fronts_give_the_same_numbers(seed, granular, tmp_path):
    name, options = question(seed)
    case = gr.cases.make(name, **options)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    said = json.loads(json.dumps(report.to_dict()))

    flags = " ".join(f"--{option.replace('_', '-')} {value!r}".replace("'", "") for option, value in options.items())
    gr.cases.save(case, tmp_path / "case.toml")
    for line in (f"{name} {flags}", "case.toml"):
        assert granular(f"compare {line} --json out.json")[0] in (0, 3)
        written = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
        assert written["pairs"] == said["pairs"]
        assert written["verdict"] == said["verdict"]
        assert all(written[name] == said[name] for name in ("isolated", "contacts", "first_disturbed"))
        assert isolation.sentence(report.soft) in granular(f"run {line}")[1]

    results = ["contacts", "hard_contacts", "v_rel", "t_f", "error", "isolated_share"]
    fixed = {key: value for key, value in options.items() if key != "stiffness"}
    swept = [gr.sweep(name, {"stiffness": [options["stiffness"]]}, results, **fixed),
             gr.sweep(tmp_path / "case.toml", {"gravity": [case.scene.gravity]}, results),
             gr.sweep(case, {"gravity": [case.scene.gravity]}, results)]
    for data in swept:
        assert data["contacts"].values[0].tolist() == [pair.soft_contacts for pair in report.pairs]
        assert data["hard_contacts"].values[0].tolist() == [pair.hard_contacts for pair in report.pairs]
        assert np.array_equal(data["v_rel"].values[0], [pair.soft_v_rel for pair in report.pairs], equal_nan=True)
        assert np.array_equal(data["t_f"].values[0], [pair.soft_t_f for pair in report.pairs], equal_nan=True)
        assert np.array_equal(data["error"].values[0], report.error, equal_nan=True)
        share = report.soft.stats["isolated"] / report.soft.stats["contacts"]
        assert data["isolated_share"].values[0] == report.measures["isolated_share"] == share
