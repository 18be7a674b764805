"""Command, library, file and sweep are one program: the same question gets the same numbers from all of them."""

import json

import numpy as np
import pytest

import granular as gr
from granular.comparison.outcome import combine_simultaneous, counts
from granular.md import isolation

pytest.importorskip("xarray")


def question(seed):
    """A ready-made scene, be it driven, hot, a ring or hanging, options of it and of its contacts, at random; steps."""
    random = np.random.default_rng([2, seed])
    shaken = {"gamma": float(random.uniform(0.5, 5.0)), "frequency": float(random.uniform(20.0, 60.0))}
    own = [
        ("three-balls", {"gap": float(10.0 ** random.uniform(-6, -2)), "height": float(random.uniform(0.2, 2.0))}),
        ("vibrated-column", shaken | {"n": int(random.integers(1, 4)), "phase": float(random.uniform(0.0, 3.0))}),
        ("ring-gas", {"n": 4, "length": 4.0, "t_end": 4.0}),
        ("ball-stack", {"n": int(random.integers(2, 4)), "mass_ratio": float(random.uniform(0.05, 0.5))}),
        ("bouncing-ball", {"plate": {"type": "Sine", **shaken}, "height": float(random.uniform(0.005, 0.02))}),
        ("heated-gas", {"n": 3, "length": 3.0, "t_end": 4.0} if random.random() < 0.5 else
         {"n": 3, "gravity": 4.0, "packing": 0.0, "t_end": 3.0}),
        ("newtons-cradle", {"n": int(random.integers(3, 6)), "gap": float(10.0 ** random.uniform(-7, -3))}),
        ("pendulum-cradle", {"n": 3, "rest_gap": float(10.0 ** random.uniform(-4, -2)), "t_end": 2.0}),
        ("chain", {"n": int(random.integers(2, 6))}),
    ]
    name, options = own[seed % len(own)]
    if "gamma" in options or "plate" in options:
        contacts = {"restitution": 0.6, "stiffness": 1e5, "t_end": 0.1}
        return name, options | contacts, {} if seed < len(own) else {"method": "verlet", "dt": 2e-6}
    if "t_end" in options:
        return name, options | {"stiffness": 1e5, "law": "LinearDashpot"}, {}
    law = str(random.choice(["LinearDashpot", "WaltonBraun", "TsujiHertz"]))
    eps, k = float(random.uniform(0.3, 1.0)), float(10.0 ** random.uniform(6, 8))
    return name, options | {"restitution": eps, "law": law, "stiffness": k}, {}


def flag(name, value):
    """An option as the command has it."""
    words = [f"{key}={entry}" for key, entry in value.items()] if isinstance(value, dict) else [str(value)]
    return f"--{name.replace('_', '-')} {' '.join(words)}"


@pytest.mark.rotating
@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("seed", range(16))
def test_all_fronts_give_the_same_numbers(seed, granular, tmp_path):
    name, options, steps = question(seed)
    case = gr.cases.make(name, **options, run=steps)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end, **steps)
    assert len(report.soft.contacts) > 0
    assert "nan" not in report.details()
    said = json.loads(json.dumps(report.to_dict()))

    gr.cases.save(case, tmp_path / "case.toml")
    flags = " ".join(flag(*option) for option in (options | steps).items())
    for line in (f"{name} {flags}", "case.toml"):
        assert granular(f"compare {line} --json out.json")[0] in (0, 3)
        written = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
        for key in ("pairs", "verdict", "groups", "scene", "isolated", "contacts", "first_disturbed"):
            assert written[key] == said[key], key
        for run in ("hard", "soft"):
            assert written[run]["account"] == said[run]["account"]
        assert steps or isolation.sentence(report.soft) in granular(f"run {line}")[1]

    driven = case.scene.floor is not None and not case.scene.heated
    over = {"floor.amplitude": [case.scene.floor.amplitude]} if driven else {"gravity": [case.scene.gravity]}
    swept = [gr.sweep(subject, over, RESULTS) for subject in (tmp_path / "case.toml", case)]
    if not steps and not driven:
        fixed = {key: value for key, value in options.items() if key != "stiffness"}
        swept.append(gr.sweep(name, {"stiffness": [options["stiffness"]]}, RESULTS, **fixed))
    rows, end = report.followed.contacts, report.soft.time[-1]  # those go on after the run, a sweep ends with it
    own = [rows[(rows["pair"] == pair.pair) & (rows["t_begin"] <= end)] for pair in report.pairs]
    last = [(np.diff(row["v_out"][-1])[0], row["t_end"][-1]) if len(row) else (np.nan, np.nan) for row in own]
    v_rel, t_f = np.array(last).T
    for data in swept:
        assert data["contacts"].values[0].tolist() == [len(row) for row in own]
        assert data["hard_contacts"].values[0].tolist() == counts(combine_simultaneous(report.hard)).tolist()
        assert np.array_equal(data["v_rel"].values[0], v_rel, equal_nan=True)
        assert np.array_equal(data["t_f"].values[0], np.where(t_f > end, np.nan, t_f), equal_nan=True)
        assert np.array_equal(data["error"].values[0], report.error, equal_nan=True)
        if not steps:
            assert data["isolated_share"].values[0] == report.measures["isolated_share"]
            share = report.soft.stats["isolated"] / report.soft.stats["contacts"]
            assert data["isolated_share"].values[0] == share or len(rows) > len(report.soft.contacts)


RESULTS = ["contacts", "hard_contacts", "v_rel", "t_f", "error", "isolated_share"]
