"""Saved runs of every kind, as files."""

import tarfile
from pathlib import Path

import pytest

from tests.helpers import saved_scenes
from tests.helpers.rewritten_files import ENGINE
from tests.helpers.saved_scenes import ALL


@pytest.fixture(scope="module")
def older(tmp_path_factory):
    """Files of every kind as the release before the table of words wrote them."""
    folder = tmp_path_factory.mktemp("older")
    with tarfile.open(Path(__file__).parents[1] / "reference" / "runs.tar.xz") as packed:
        packed.extractall(folder, filter="data")
    return folder


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The same, written now."""
    folder = tmp_path_factory.mktemp("files")
    for kind, name in ALL:
        saved_scenes.cut(kind, name, **ENGINE[kind]).save(folder / f"{kind}_{name}.npz")
    return folder
