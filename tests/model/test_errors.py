import ast
import pickle
from importlib import import_module

import pytest

from auditor.errors import AuditorError, RecordingError
from tests.test_architecture import modules, nodes

KINDS = sorted(
    (module, node.name)
    for module, path in modules().items()
    for node in nodes(path)
    if isinstance(node, ast.ClassDef) and node.name.endswith("Error")
)
"""The module and name of every kind of error in the package."""


def test_an_error_reads_as_one_line_with_what_where_and_a_remedy() -> None:
    error = RecordingError("the file is empty", where="night/a.mcap", remedy="record it again")
    assert str(error) == "night/a.mcap: the file is empty; record it again"
    assert str(AuditorError("nothing to do")) == "nothing to do"


@pytest.mark.parametrize(("module", "kind"), KINDS)
def test_an_error_of_every_kind_crosses_from_one_process_to_another_whole(module: str, kind: str) -> None:
    error = getattr(import_module(module), kind)("drive.mcap")
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
    if isinstance(error, AuditorError):
        error.where = ""
        placed = error.located("night/a.mcap")
        assert (type(placed), placed.what, placed.where) == (type(error), error.what, "night/a.mcap")


def test_an_error_without_a_place_can_be_given_one_and_one_with_a_place_keeps_it() -> None:
    assert str(RecordingError("cut", remedy="nothing").located("a.mcap")) == "a.mcap: cut; nothing"
    assert str(RecordingError("cut", where="b.mcap").located("a.mcap")) == "b.mcap: cut"
