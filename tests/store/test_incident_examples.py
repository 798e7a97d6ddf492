"""The frames that show an incident: chosen by its verdicts, for any number of seeded attacks."""

import random
from pathlib import Path

from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store
from tests.making.report_stores import add_recording, new_store

FRAMES, ATTACKS = 200, 12


def seeded_attacks(seed: int) -> list[tuple[tuple[int, ...], int, int]]:
    """Attacks on one or two sensors of 1 to 8 frames, in places of their own, some at the very edges."""
    rng = random.Random(seed)
    attacks = []
    for place in range(ATTACKS):
        first = place * FRAMES // ATTACKS + (0 if place == 0 else rng.randrange(3))
        length = rng.randrange(1, 9)
        last = FRAMES - 1 if place == ATTACKS - 1 else first + length - 1
        attacks.append((rng.choice([(1,), (2,), (3,), (0,)]), first, last))
    return attacks


def rows(store: Store, sql: str) -> list[dict[str, object]]:
    return rows_of(run_sql(store, sql))


def test_each_incident_has_its_strongest_frame_and_the_nearest_ones_that_are_not_its_own(tmp_path: Path) -> None:
    store = new_store(tmp_path)
    measurements = [
        add_recording(store, f"{seed}.mcap", frames=FRAMES, attacks=seeded_attacks(seed), vehicle=f"car {seed}")
        for seed in (1, 2)
    ]
    verdicts = {
        known: {
            row["frame"]: row for row in rows(store, f"FROM verdicts WHERE measurement_id = '{known}' ORDER BY frame")
        }
        for known in measurements
    }
    examples: dict[object, dict[object, object]] = {}
    for row in rows(store, "FROM incident_examples"):
        assert row["example"] not in examples.setdefault(row["incident_id"], {})
        examples[row["incident_id"]][row["example"]] = row["frame"]
    incidents = rows(store, "FROM incidents")
    assert len(incidents) >= 2 * ATTACKS
    assert examples.keys() == {incident["incident_id"] for incident in incidents}
    for incident in incidents:
        frames = verdicts[str(incident["measurement_id"])]
        before = [frame for frame in frames if frame < incident["first_frame"]]
        after = [frame for frame in frames if frame > incident["last_frame"]]
        clean = [frame for frame, row in frames.items() if row["kind"] == "clean"]
        strongest = incident["strongest_frame"]
        due = {
            "strongest": strongest,
            **({"before": max(before)} if before else {}),
            **({"after": min(after)} if after else {}),
            "clean": min(clean, key=lambda frame: (abs(frame - strongest), frame)),
        }
        assert examples[incident["incident_id"]] == due
