"""A drive cut at each of fifty places, scanned: `python -m tests.benchmarks.cuts [--frames 40] [--places 50]`.

For every container and cut: frames measured of those before the cut, damage reported, whether the mass balance
adds up.
"""

import argparse
import io
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from tests.making.cut_scans import KINDS, scan_cuts


def main() -> None:
    """Scan and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--places", type=int, default=50)
    options = parser.parse_args()
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as folder, redirect_stdout(io.TextIOWrapper(io.BytesIO())):
            scan = scan_cuts(Path(folder), kind, options.frames, options.places)
        lost = [options.frames * cut.share - cut.measured for cut in scan.cuts]
        for cut in scan.cuts:
            before = options.frames * cut.share
            print(
                f"{cut.name:12} {cut.measured:3} of {before:5.1f} frames, {cut.damage} damaged, adds up: {cut.adds_up}"
            )
        print(f"{kind}: exit {scan.exit_code}, at most {max(lost):.1f} frames before a cut are not measured")


if __name__ == "__main__":
    main()
