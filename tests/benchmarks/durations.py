"""What is found of attacks that last: one frame, the last quarter, the last half, or all of a drive; by exit code.

Reads scenes that `python -m tests.benchmarks.clean_statistics --attacked` measured:

    python -m tests.benchmarks.durations FOLDER

Each drive is judged by thresholds learnt from the drives of other families, and by the prior alone. A series is a drive
in which the last frames are those of one attack on one set of sensors, drawn anew for each frame; of one frame there is
a series for each place. Printed are the attacked frames in which exactly the attacked sensors are named, the series
with an incident, and those that are found at all: by an incident or an alert, so that a scan ends in 1.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

from tests.benchmarks.incident_series import MEASURED_HZ, RIGS, Drive, Tally, drives_of
from tests.benchmarks.scenes import Case, Scene, load

R = Decimal("0.01")
SHARES = {"a quarter": 0.25, "a half": 0.5, "all": 1.0}
LASTS = ("one frame", *SHARES)


def cell(n: Tally, incident: str = "incident") -> str:
    """Series of one attack and one duration, and which of their incidents count."""
    if not n["series"]:
        return f"{'-':>22}"
    shares = (("named", "frames"), (incident, "series"), ("found", "series"))
    named, incidents, found = (100 * n[hits] / n[of] for hits, of in shares)
    return f"{named:6.0f} /{incidents:5.0f} /{found:5.0f}  "


def series_of(cases: Mapping[int, Case], frames: int) -> Iterator[tuple[str, dict[int, Case]]]:
    """The attacked places of each series, by how long the attack lasts."""
    for place, case in cases.items():
        yield LASTS[0], {place: case}
    for lasts, share in SHARES.items():
        chosen = {place: case for place, case in cases.items() if place >= frames - round(share * frames)}
        if chosen:
            yield lasts, chosen


def tallies(drives: Sequence[Drive]) -> dict[str, dict[str, Tally]]:
    """By attack and duration, over the drives and the attacked sensors."""
    found: dict[str, dict[str, Tally]] = defaultdict(lambda: defaultdict(Tally))
    for drive in drives:
        for attack, of_sensors in drive.attacks.items():
            for who, cases in of_sensors.items():
                for lasts, chosen in series_of(cases, len(drive.clean)):
                    found[attack][lasts].add(drive, chosen, who)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, help="the scenes")
    scenes: list[Scene] = load(parser.parse_args().folder)
    for cameras in RIGS:
        for how, prior in (("learnt from other drives", False), ("by the prior", True)):
            print(f"LiDAR and {len(cameras)} cameras, {how}: frames named / series with an incident / series found, %")
            drives = drives_of(scenes, cameras, R, prior=prior)
            print(f"{'':22}" + "".join(f"{lasts:>22}" for lasts in LASTS))
            for attack, by_duration in sorted(tallies(drives).items()):
                print(f"{attack:22}" + "".join(f"{cell(by_duration[lasts]):>22}" for lasts in LASTS), flush=True)
            clean = [drive.judged(drive.series({}, MEASURED_HZ)) for drive in drives]
            print(f"clean drives found: {sum(any(one.finding for one in each) for each in clean)} of {len(clean)}")


if __name__ == "__main__":
    main()
