from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "analysis" / "paper_case.ipynb"


def test_notebook_of_the_papers_case_runs_from_top_to_bottom(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its own assertions hold; the demand is small. The notebook itself lies there without outputs."""
    monkeypatch.setenv("NOTEBOOK_DURATION_S", "200")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)
    ran = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": NOTEBOOK.parent}}
    ).execute()
    printed = "".join(output.get("text", "") for cell in ran.cells for output in cell.get("outputs", []))
    assert "5 traces make the map" in printed
    assert "FOUND" in printed
    assert any("image/png" in output.get("data", {}) for cell in ran.cells for output in cell.get("outputs", []))
