"""Arrow without pandas, which it imports for the first list that becomes an array, wherever pandas is installed."""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from types import ModuleType

import pyarrow as pa

from auditor.resources import plug_ins


class _NoPandas(MetaPathFinder):
    """Finds no pandas."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> None:
        del path, target
        if fullname == "pandas":
            raise ModuleNotFoundError("pandas is left out", name=fullname)


def leave_pandas_out() -> None:
    """Have Arrow take pandas for missing in this process, unless it is imported already: it takes 0.17 s of CPU.

    For processes in which nobody asks Arrow for a data frame. Code of plug-ins may, so where one is installed pandas
    stays; code that imports pandas itself gets it in any case.
    """
    if "pandas" in sys.modules or plug_ins():
        return
    nowhere = _NoPandas()
    sys.meta_path.insert(0, nowhere)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(nowhere)
