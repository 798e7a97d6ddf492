"""The table of kinds in docs/attacks.md, as the catalogue has them: `python -m tests.attack_table` writes it."""

from collections.abc import Iterator
from pathlib import Path

from auditor.lab.attacks.catalogue import KINDS, ON_CAMERA, ON_LIDAR

DOCUMENT = Path(__file__).resolve().parent.parent / "docs" / "attacks.md"
HEAD = "| `--kind` | on | what it does | `--size` | without it |\n|---|---|---|---|---|\n"


def table() -> str:
    return HEAD + "".join(f"{row}\n" for row in _rows())


def _rows() -> Iterator[str]:
    for name, kind in KINDS.items():
        on = "a camera" if name in ON_CAMERA else "the LiDAR" if name in ON_LIDAR else "either"
        on = "a camera" if name == "pattern" else on
        usual = f"{kind.usual:g}" if kind.usual is not None else "drawn" if kind.size else ""
        yield f"| `{name}` | {on} | {kind.does} | {kind.size} | {usual} |"


if __name__ == "__main__":
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(HEAD)
    DOCUMENT.write_text(before + table() + rest[rest.index("\n\n") + 1 :], encoding="utf-8")
