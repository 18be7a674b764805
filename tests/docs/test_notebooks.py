"""The notebooks run, are stored with their outputs, and show what they print today."""

import contextlib
import io
import warnings
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
nbformat = pytest.importorskip("nbformat", reason="notebooks need nbformat, nbclient and ipykernel")


def printed(notebook) -> list[str]:
    """The text of each code cell."""
    return [
        "".join(out.text for out in cell.outputs if out.output_type == "stream" and out.name == "stdout")
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def test_there_are_five():
    stems = ["calibration", "first-session", "newtons-cradle", "tennis-ball", "what-accuracy-costs"]
    assert [path.stem for path in NOTEBOOKS] == stems


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_small_and_with_its_outputs(path):
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    assert path.stat().st_size < 200_000
    assert all(cell.execution_count for cell in notebook.cells if cell.cell_type == "code")
    kinds = [out.output_type for cell in notebook.cells for out in cell.get("outputs", [])]
    assert "display_data" in kinds
    assert "error" not in kinds


def test_the_first_session_shows_its_tables_and_figures():
    notebook = nbformat.read(FOLDER / "first-session.ipynb", 4)
    results = [out.data for cell in notebook.cells for out in cell.get("outputs", [])
               if out.output_type == "execute_result"]
    assert ["text/html" if "text/html" in data else "image/png" if "image/png" in data else "" for data in results] == [
        "text/html", "image/png", "text/html", "text/html"]  # scene, run.plot(), run, report


@pytest.mark.rotating
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_notebook_runs_in_jupyter(tmp_path):
    """One of them does, which takes three seconds more than its cells."""
    nbclient = pytest.importorskip("nbclient", reason="notebooks need nbformat, nbclient and ipykernel")
    pytest.importorskip("ipykernel", reason="notebooks need nbformat, nbclient and ipykernel")
    pytest.importorskip("matplotlib")
    notebook = nbformat.read(FOLDER / "newtons-cradle.ipynb", 4)
    shown, kinds = printed(notebook), drawn(notebook)
    nbclient.NotebookClient(notebook, timeout=None, kernel_name="python3", resources={
        "metadata": {"path": str(tmp_path)}}).execute()
    assert kinds == drawn(notebook)
    as_shown("newtons-cradle", printed(notebook), shown)


@pytest.mark.rotating
@pytest.mark.parametrize("name", ["calibration", "first-session", "tennis-ball", "what-accuracy-costs"])
def test_the_cells_of_a_notebook_run_and_print_what_it_shows(name, monkeypatch, tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("xarray")  # sweeps
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    plt.switch_backend("Agg")
    notebook, names, now, figures = nbformat.read(FOLDER / f"{name}.ipynb", 4), {"__name__": name}, [], []
    with matplotlib.rc_context(), warnings.catch_warnings():
        matplotlib.rcdefaults()  # an example may have set its style in this process
        for cell in (cell for cell in notebook.cells if cell.cell_type == "code"):
            with contextlib.redirect_stdout(io.StringIO()) as said:
                exec(compile(cell.source, name, "exec"), names)
            now.append(said.getvalue())
            figures.append(bool(plt.get_fignums()))
            plt.close("all")
    assert figures == drawn(notebook)
    as_shown(name, now, printed(notebook))


def drawn(notebook) -> list[bool]:
    """Whether each code cell shows a figure."""
    return [
        any(out.output_type == "display_data" for out in cell.outputs)
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def as_shown(name, printed_now, shown) -> None:
    """Raise where a cell does not print what its notebook shows."""
    from tests.docs.test_pages import agree

    for now, before in zip(printed_now, shown, strict=True):
        assert agree(now, before), f"{name} shows\n{before}\nbut prints\n{now}"
