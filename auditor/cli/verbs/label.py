"""`auditor label`: ground truth for attacks that somebody else made."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.logged import logged
from auditor.cli.options import SENSOR
from auditor.cli.output import print_rows, say
from auditor.model.stamps import NANOSECONDS

if TYPE_CHECKING:
    from auditor.store.records import RecordingRecord
    from auditor.store.store import Store


@click.command("label", short_help="Ground truth for attacks made elsewhere.")
@click.argument("recording")
@click.option("--sensor", type=SENSOR, help="The sensor that was attacked.")
@click.option("--topic", help="The topic whose data was attacked, in place of --sensor.")
@click.option("--attack", metavar="NAME", help="What the attack was, in your own words.")
@click.option("--from", "first", metavar="WHEN", help="When it begins.  [default: with the recording]")
@click.option("--to", "last", metavar="WHEN", help="When it ends, included.  [default: with the recording]")
@click.option("--clean", is_flag=True, help="The whole recording is known to be clean.")
@click.option("--list", "listed", is_flag=True, help="Only list the recording's labels.")
@click.option("--remove", type=click.IntRange(min=1), metavar="NUMBER", help="Remove the label of this number.")
@options.store_option
def command(
    recording: str,
    sensor: int | None,
    topic: str | None,
    attack: str | None,
    first: str | None,
    last: str | None,
    remove: int | None,
    store: Path,
    *,
    clean: bool,
    listed: bool,
) -> None:
    """Say which sensor of a measured recording was attacked and when, or that the recording is clean.

    WHEN is a frame's number (120), seconds from the recording's start (12.5s), or a time (2026-01-31T12:00:05.5Z).

    \b
    auditor label drive_0009.mcap --sensor S_2 --attack laser --from 120 --to 260
    auditor label drive_0009.mcap --topic /camera/left --attack laser --from 12.5s --to 20s
    auditor label drive_0010.mcap --clean
    auditor label drive_0009.mcap --list
    auditor label drive_0009.mcap --remove 1

    Labels are kept in the store; the recording is not touched, and a later scan leaves them. They count beside those
    that the recording carries: on its page, and in the query identification_rate.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.labels import label_attack, label_clean, recording_called, remove_label  # noqa: PLC0415 - heavy
    from auditor.store.store import Store  # noqa: PLC0415

    described = any(value is not None for value in (sensor, topic, attack, first, last))
    if described + clean + listed + (remove is not None) != 1:
        raise click.UsageError("describe an attack, or give one of --clean, --list and --remove")
    if described and (attack is None or (sensor is None) == (topic is None)):
        raise click.UsageError("an attack has a name (--attack), and either --sensor or --topic")
    kept = Store.open(store)
    recording_id = recording_called(kept, recording)
    with nullcontext() if listed else logged(kept.folder):
        if attack is not None:
            label_attack(kept, recording_id, attack, sensor=sensor, topic=topic, first=first, last=last)
        elif clean:
            label_clean(kept, recording_id)
        elif remove is not None:
            remove_label(kept, recording_id, remove)
    _list(kept, recording_id)


def _list(store: "Store", recording: "RecordingRecord") -> None:
    from auditor.pipeline.labels import sensors_of  # noqa: PLC0415 - heavy

    sensors, given = sensors_of(store, recording), store.given_labels(recording.recording_id)
    carried = [{**vars(label), "sensor": sensors.get(label.topic)} for label in store.labels(recording.recording_id)]
    rows = [_row(recording, None, label) for label in carried]
    rows += [_row(recording, number, vars(label)) for number, label in enumerate(given, start=1)]
    if rows:
        print_rows(rows, tuple(rows[0]))
    else:
        say(f"{recording.name}: it has no labels: whether it was attacked is not known")


def _row(recording: "RecordingRecord", number: int | None, label: dict[str, Any]) -> dict[str, object]:
    def seconds(stamp_ns: int | None) -> str | None:
        if stamp_ns is None or recording.from_ns is None:
            return None
        return f"{(stamp_ns - recording.from_ns) / NANOSECONDS:.3f}s"

    return {
        "number": number,
        "topic": label["topic"],
        "sensor": None if label["sensor"] is None else f"S_{label['sensor']}",
        "attack": label["attack"] if label["topic"] is not None else "none: it is clean",
        "from": seconds(label["from_ns"]),
        "to": seconds(label["to_ns"]),
        "source": "recording" if number is None else "given",
    }
