"""The notebook as a page: its text, its code and, where it is run, what it prints and draws."""

import base64
import re
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "analysis" / "paper_case.ipynb"


def executed() -> Any:
    """The notebook, run from top to bottom."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": NOTEBOOK.parent}})
    return client.execute()


def notebook_page(notebook: Any, site: Path) -> str:
    """The page's text; drawings are written beside it."""
    parts = []
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "markdown":
            parts.append(cell.source)
            continue
        parts.append(f"```python\n{cell.source}\n```")
        for output in cell.get("outputs", []):
            parts += _shown(output, site / "notebooks", name=f"paper_case_{number}.png")
    return "\n\n".join(parts) + "\n"


def _shown(output: Any, folder: Path, *, name: str) -> list[str]:
    data = output.get("data", {})
    if "image/png" in data:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(base64.b64decode(data["image/png"]))
        return [f"![What the cell draws]({name})"]
    if "text/html" in data:
        table = re.sub(r"<style.*?</style>\s*", "", data["text/html"], flags=re.DOTALL)
        return [re.sub(r"\n\s*", "\n", re.sub(r' (?:border|class|style)="[^"]*"', "", table)).strip()]
    text = output.get("text") if output.output_type == "stream" and output.get("name") == "stdout" else data.get("text/plain")
    return [f"```text\n{text.rstrip()}\n```"] if text else []
