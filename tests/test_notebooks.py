"""The notebooks run, are stored with their outputs, and show what they print today."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="notebooks need nbformat, nbclient and ipykernel")


def printed(notebook) -> list[str]:
    """The text of each code cell."""
    return [
        "".join(out.text for out in cell.outputs if out.output_type == "stream" and out.name == "stdout")
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["newtons-cradle", "tennis-ball", "what-accuracy-costs"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_small_and_with_its_outputs(path):
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    assert path.stat().st_size < 200_000
    assert all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code")
    kinds = [out.output_type for cell in notebook.cells for out in cell.get("outputs", [])]
    assert "display_data" in kinds
    assert "error" not in kinds


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_prints_what_it_shows(path, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="notebooks need nbformat, nbclient and ipykernel")
    pytest.importorskip("ipykernel", reason="notebooks need nbformat, nbclient and ipykernel")
    pytest.importorskip("matplotlib")
    from test_docs import agree

    notebook = nbformat.read(path, 4)
    shown = printed(notebook)
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources={
        "metadata": {"path": str(tmp_path)}}).execute()  # fmt: skip
    for now, before in zip(printed(notebook), shown, strict=True):
        assert agree(now, before), f"{path.name} shows\n{before}\nbut prints\n{now}"
