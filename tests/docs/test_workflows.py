"""The workflows of the code host call the scripts of .ci/run, on the Python and numba versions that are declared."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from granular._engine.kernels import TESTED_NUMBA
from granular._engine.package import VERSION

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml", reason="workflows are YAML")
WORKFLOWS = {path.name: yaml.safe_load(path.read_text(encoding="utf-8"))
             for path in sorted((ROOT / ".github" / "workflows").glob("*.yml"))}
JOBS = {f"{file}:{name}": job for file, workflow in WORKFLOWS.items() for name, job in workflow["jobs"].items()}
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
SCRIPT = re.compile(r"(?<![\w/])\.ci/(\w+)")


def commands(job):
    """Commands of a job in order, one per row of its matrix if they depend on it."""
    rows = job.get("strategy", {}).get("matrix", {}).get("include", [{}])
    return [re.sub(r"\$\{\{ matrix\.(\w+) \}\}", lambda hit: row[hit[1]], step["run"])  # noqa: B023
            for row in rows for step in job.get("steps", []) if "run" in step]


CALLED = {name for job in JOBS.values() for line in commands(job) for name in SCRIPT.findall(line)}


def test_each_workflow_has_a_start_and_jobs():
    assert set(WORKFLOWS) == {"tests.yml", "release.yml", "pages.yml"}
    for workflow in WORKFLOWS.values():
        assert workflow[True]  # the key `on` in YAML 1.1
        assert workflow["permissions"] == {"contents": "read"}
    for name, job in JOBS.items():
        assert ("uses" in job) != ("steps" in job), name
        assert "needs" not in job or job["needs"] in WORKFLOWS[name.partition(":")[0]]["jobs"], name
        assert "uses" not in job or (ROOT / job["uses"]).is_file()


@pytest.mark.parametrize("name", sorted(path.name for path in (ROOT / ".ci").iterdir()))
def test_a_script_is_executable_bash_without_errors_of_syntax(name):
    script = ROOT / ".ci" / name
    assert os.access(script, os.X_OK)
    assert script.read_text(encoding="utf-8").startswith("#!/usr/bin/env bash\n")
    assert subprocess.run(["bash", "-n", script], capture_output=True, check=False).stderr == b""


def test_workflows_and_ci_run_call_the_same_scripts():
    """A script that only one of them calls would be a step that the other lacks."""
    text = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    by_run = set(SCRIPT.findall("\n".join(line for line in text.splitlines() if not line.startswith("#")))) - {"run"}
    there = {path.name for path in (ROOT / ".ci").iterdir()} - {"run"}
    assert by_run == there - {"dist", "notes"}  # artefacts and a release, not tests
    assert there == CALLED


def test_a_step_is_one_script():
    """Logic in a workflow could not be run anywhere else."""
    others = [line for job in JOBS.values() for line in commands(job) if not re.match(r"\.ci/\w+( |$)", line)]
    assert [line.split()[:3] for line in others] == [["gh", "release", "create"]]
    assert not [line for job in JOBS.values() for line in commands(job) if re.search(r"&&|\|\||;|\n", line)]


def test_scripts_run_in_the_order_that_they_need():
    for name, job in JOBS.items():
        called = [SCRIPT.findall(line)[0] for line in commands(job) if SCRIPT.search(line)]
        assert not {"suite", "style", "site"} & set(called) or "install" in called, name
        order = ["browsers", "comparison", "install", "suite", "style", "site", "core", "notes", "dist"]
        assert [order.index(one) for one in called] == sorted(order.index(one) for one in called), name


def test_pythons_are_those_of_the_classifiers():
    declared = {one.rpartition(" ")[2] for one in PROJECT["classifiers"] if re.search(r":: 3\.\d+$", one)}
    matrix = WORKFLOWS["tests.yml"]["jobs"]["suite"]["strategy"]["matrix"]["python"]
    assert set(matrix) == declared
    assert PROJECT["requires-python"] == f">={min(declared, key=lambda one: int(one.partition('.')[2]))}"
    rows = WORKFLOWS["tests.yml"]["jobs"]["core"]["strategy"]["matrix"]["include"]
    used = {row["python"] for row in rows} | {
        step["with"]["python-version"] for job in JOBS.values() for step in job.get("steps", [])
        if "python-version" in step.get("with", {}) and "matrix" not in step["with"]["python-version"]}
    assert used <= declared
    assert all(row["arguments"].split()[0] in ("newest", f"python{row['python']}") for row in rows)


def test_versions_of_numba_are_the_lowest_and_the_tested():
    rows = commands(WORKFLOWS["tests.yml"]["jobs"]["core"])
    versions = {hit[1] for line in rows if (hit := re.search(r"numba==([\d.]+)\.\*", line))}
    lowest, = (line.removeprefix("numba>=") for line in PROJECT["optional-dependencies"]["fast"])
    assert versions == {lowest} | {".".join(map(str, one)) for one in TESTED_NUMBA}
    assert sum(line.endswith(" lowest") for line in rows) == sum(line.endswith(" newest") for line in rows) == 1


def test_no_file_names_a_registry():
    texts = [path.read_text(encoding="utf-8") for folder in (".ci", ".github") for path in (ROOT / folder).rglob("*.*")]
    texts += [path.read_text(encoding="utf-8") for path in (ROOT / ".ci").iterdir()] + [
        (ROOT / "pyproject.toml").read_text(encoding="utf-8")]
    assert len(texts) > 10
    assert not [hit for text in texts for hit in re.findall(r"index-url|pypi|https?://(?!doi\.org)\S+", text)]


def test_the_notes_of_a_release_are_its_section_of_the_changelog():
    notes = ROOT / ".ci" / "notes"
    done = subprocess.run([notes, f"v{VERSION}"], capture_output=True, text=True, check=True)
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert done.stdout.startswith("### Answers that changed\n- ")
    assert done.stdout.splitlines()[-1] in changelog.partition("\n## ")[2].partition("\n## ")[0]
    assert done.stdout.count("### Added") == 1
    other = subprocess.run([notes, "v0.0.1"], capture_output=True, text=True, check=False)
    assert (other.returncode, other.stdout) == (1, "")
    assert other.stderr == f"The tag must be v{VERSION}, the version of the package, got v0.0.1.\n"
