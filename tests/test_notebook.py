"""docs/notebook.ipynb runs from a store to its plot, and shows the counts of the program."""

import base64
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from auditor.store.queries import run_query
from tests.making.report_stores import add_recording, new_store

NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebook.ipynb"


def read() -> Any:
    """The notebook as it is kept. Raises ValidationError where it is none."""
    import nbformat  # noqa: PLC0415 - it takes a second, in this file alone

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    return notebook


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A store of two attacked recordings, and what each cell of code shows: its texts and its pictures."""
    from nbclient import NotebookClient  # noqa: PLC0415 - it takes a second, in this file alone

    folder = tmp_path_factory.mktemp("notebook")
    store = new_store(folder)
    for name, last in (("a.mcap", 19), ("b.mcap", 24)):
        add_recording(store, name, attacks=[((1,), 10, last)], pictured=(12,), drives=2)
    notebook = read()
    NotebookClient(notebook, resources={"metadata": {"path": str(folder)}}, kernel_name="python3").execute()
    return store, [cell.outputs for cell in notebook.cells if cell.cell_type == "code"]


def texts(outputs):
    return "".join(one.get("text", "") or one.get("data", {}).get("text/html", "") for one in outputs)


def test_the_kept_notebook_has_no_outputs():
    assert [cell for cell in read().cells if cell.get("outputs")] == []


def test_the_notebook_shows_the_incidents_of_the_program(told):
    store, (summary, incidents, longest, _, pictures) = told
    assert all(name in texts(summary) for name in ("a.mcap", "b.mcap", "S_1 right"))
    found = run_query(store, "incidents").to_pylist()
    assert [row["frames"] for row in found] == [10, 15]
    assert all(row["incident_id"] in texts(incidents) for row in found)
    assert texts(longest) == "15 frames of b.mcap\n"
    assert "12_S" in texts(pictures)


def test_the_plot_shows_the_incident(told):
    _, (*_, plot, _) = told
    [png] = [one.data["image/png"] for one in plot if "image/png" in one.get("data", {})]
    pixels = cv2.imdecode(np.frombuffer(base64.b64decode(png), np.uint8), cv2.IMREAD_COLOR).astype(int)
    blue, _, red = np.moveaxis(pixels, 2, 0)
    shaded = np.flatnonzero((red - blue > 40).mean(axis=0) > 0.5)
    assert 0.2 < (shaded.max() - shaded.min()) / pixels.shape[1] < 0.4  # 1.4 s of 3.9 s, beside the margins
