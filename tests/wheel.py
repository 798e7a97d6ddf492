"""Check what a wheel holds: `python tests/wheel.py FILE.whl`. Everything the program reads, and nothing recorded."""

import sys
import zipfile
from pathlib import Path

RESOURCES = {"schemas": ".toml", "queries": ".sql", "reports": ".html"}
RECORDED = (".mcap", ".bag", ".db3", ".bin", ".png", ".jpg", ".ppm", ".pgm", ".npz", ".tar", ".pth")
WEIGHTS = "auditor/measurement/disparity/matchers/psmnet/streets_half_resolution_fp16.safetensors"
MOST_BYTES = 2_000_000
"""Of a wheel, what its weights take in it apart."""


def faults(wheel: Path, checkout: Path) -> list[str]:
    """What is missing from a wheel, and what does not belong there."""
    with zipfile.ZipFile(wheel) as archive:
        packed = {entry.filename: entry.compress_size for entry in archive.infolist()}
        weights = archive.read(WEIGHTS) if WEIGHTS in packed else b""
    names = list(packed)
    found = [
        f"missing: auditor/data/{path.relative_to(checkout)}"
        for folder, ending in RESOURCES.items()
        for path in sorted((checkout / folder).rglob(f"*{ending}"))
        if f"auditor/data/{path.relative_to(checkout)}" not in names
    ]
    found += [
        f"empty: auditor/data/{f}" for f in RESOURCES if not any(n.startswith(f"auditor/data/{f}/") for n in names)
    ]
    found += [f"recorded data: {name}" for name in names if name.endswith(RECORDED)]
    found += [f"outside the package: {n}" for n in names if not n.startswith("auditor/") and ".dist-info/" not in n]
    if "auditor/py.typed" not in names:
        found.append("missing: auditor/py.typed")
    if weights != (checkout / WEIGHTS).read_bytes():
        found.append(f"missing or another: {WEIGHTS}")
    if wheel.stat().st_size - packed.get(WEIGHTS, 0) > MOST_BYTES:
        found.append(f"too large: {wheel.stat().st_size} bytes")
    return found


if __name__ == "__main__":
    wrong = faults(Path(sys.argv[1]), Path(__file__).resolve().parent.parent)
    print("\n".join(wrong) or "the wheel holds what it should")
    sys.exit(bool(wrong))
