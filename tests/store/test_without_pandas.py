"""A scan spares the import of pandas, and takes it from nobody who uses it."""

import subprocess
import sys

import pytest

from auditor.store import export

BEGINNING = "import sys; import pyarrow as pa; from auditor.store.export import leave_pandas_out; leave_pandas_out()"


def told(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_lists_become_arrays_without_pandas_and_who_imports_it_gets_it():
    asked = "print(pa.array([1]).to_pylist(), 'pandas' in sys.modules); import pandas; print(pandas.Series([2]).sum())"
    assert told(f"{BEGINNING}; {asked}") == "[1] False\n2"


def test_where_pandas_is_imported_already_arrow_makes_data_frames():
    assert told(f"import pandas; {BEGINNING}; print(len(pa.table({{'a': [1, 2]}}).to_pandas()))") == "2"


def test_where_a_plug_in_is_installed_pandas_stays(monkeypatch: pytest.MonkeyPatch):
    modules = {name: module for name, module in sys.modules.items() if name.split(".")[0] != "pandas"}
    monkeypatch.setattr(sys, "modules", modules)
    monkeypatch.setattr(export, "plug_ins", lambda: {"a-reader": "1.0"})
    monkeypatch.setattr(export.pa, "array", lambda _: pytest.fail("Arrow looked for pandas"))
    export.leave_pandas_out()
