"""Check what a wheel holds: `python tests/wheel.py FILE.whl`. Everything the program reads, and nothing recorded."""

import sys
import zipfile
from pathlib import Path

RESOURCES = {"schemas": ".toml", "queries": ".sql", "reports": ".html"}
RECORDED = (".mcap", ".bag", ".db3", ".bin", ".png", ".jpg", ".ppm", ".pgm", ".npz", ".tar", ".pth")
DETECTORS = "auditor/lab/evaluation/object_baseline/detectors/streets/"
WEIGHTS = (
    "auditor/measurement/disparity/matchers/psmnet/streets_half_resolution_fp16.safetensors",
    f"{DETECTORS}images_fp16.safetensors",
    f"{DETECTORS}clouds_fp16.safetensors",
)
MOST_BYTES = 2_000_000
"""Of a wheel, what its weights take in it apart."""


def faults(wheel: Path, checkout: Path) -> list[str]:
    """What is missing from a wheel, and what does not belong there."""
    with zipfile.ZipFile(wheel) as archive:
        packed = {entry.filename: entry.compress_size for entry in archive.infolist()}
        weights = {name: archive.read(name) if name in packed else b"" for name in WEIGHTS}
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
    found += [f"missing or another: {n}" for n, held in weights.items() if held != (checkout / n).read_bytes()]
    if wheel.stat().st_size - sum(packed.get(name, 0) for name in WEIGHTS) > MOST_BYTES:
        found.append(f"too large: {wheel.stat().st_size} bytes")
    return found


if __name__ == "__main__":
    wrong = faults(Path(sys.argv[1]), Path(__file__).resolve().parent.parent)
    print("\n".join(wrong) or "the wheel holds what it should")
    sys.exit(bool(wrong))
