"""Scenes that the benchmarks keep: what was measured is not measured again, unless the code has changed."""

import pickle
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.kept_scenes import digest, measure_kept


@dataclass(frozen=True)
class Numbered:
    number: int

    @property
    def name(self) -> str:
        return f"scene-{self.number}"


def squared(scene: Numbered) -> int:
    return scene.number**2


def test_a_run_goes_on_where_it_was(tmp_path: Path) -> None:
    (tmp_path / "scene-3").write_bytes(pickle.dumps("measured before"))
    (tmp_path / "scene-4.part").write_bytes(b"half a pickle")
    found = measure_kept([Numbered(4), Numbered(3)], squared, tmp_path, processes=1)
    assert found == {Numbered(4): 16, Numbered(3): "measured before"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene-3", "scene-4"]


def test_a_changed_source_is_another_folder(tmp_path: Path) -> None:
    sources = [tmp_path / "b.py", tmp_path / "a.py"]
    for path in sources:
        path.write_text(path.name)
    before = digest(sources)
    assert digest(reversed(sources)) == before
    sources[0].write_text("changed")
    assert digest(sources) != before
