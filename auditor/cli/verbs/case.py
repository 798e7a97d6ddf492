"""`auditor case`: one incident for other tools and other people."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.logged import reading, refuse_altered
from auditor.cli.options import PATH, FiniteRange, LocalPath
from auditor.cli.output import answer, say

if TYPE_CHECKING:
    from auditor.pipeline.workers import LimitsOf


@click.command("case", short_help="One incident as a folder for other tools.")
@click.argument("incident")
@options.store_option
@click.option("--into", type=PATH, required=True, help="The new folder to write.")
@click.option("--zip", "zipped", is_flag=True, help="Write the folder as a zip beside it, too.")
@click.option(
    "--seconds",
    type=FiniteRange(min=0, max=3600),
    default=2.0,
    show_default=True,
    help="How much before and after the incident belongs to it.",
)
@click.option(
    "--redact",
    is_flag=True,
    help="Blur what was not attacked, and leave out names, paths and places. There is no clip then.",
)
@click.option(
    "--private-key",
    type=LocalPath(exists=True, dir_okay=False),
    envvar="AUDITOR_SIGNING_KEY",
    show_envvar=True,
    help="Sign the manifest with this Ed25519 key (PEM).",
)
@options.budget_options
def command(
    incident: str,
    store: Path,
    into: Path,
    seconds: float,
    private_key: Path | None,
    limits: "LimitsOf",
    *,
    zipped: bool,
    redact: bool,
) -> None:
    """Write the case file of an incident: one folder that can be looked at, loaded, handed on and checked.

    \b
    auditor case 39b955 --into case_39b955
    auditor case 39b955 --into for_the_maker --redact --zip --private-key private.pem
    auditor verify case_39b955

    INCIDENT is its id or the beginning of it (auditor query incidents). The folder has a page, pictures of all cameras
    at full resolution and of the cloud, clouds as PLY, the rows as Parquet and CSV, ticket.json, timeline.jsonl for
    Timesketch, clip.mcap with the messages of these seconds as they were recorded, findings.mcap with what was found
    on the same timeline, and a manifest. The recording is read again, and must be what was measured; where it is not
    there any more, the case has no clip, and says so.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.casefile.write import CaseSettings, write_case, write_zip  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.output_files import check_new  # noqa: PLC0415
    from auditor.store.log.signatures import signing_key  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    target = into.with_name(f"{into.name}.zip")
    for new in (into, *([target] if zipped else [])):
        check_new(new)
    settings = CaseSettings(seconds, redact, signing_key(private_key), limits)
    kept = Store.open(store)
    refuse_altered(kept)
    with reading(kept.folder):
        case = write_case(kept, incident, into, settings)
    for remark in case.remarks:
        say(f"{into}: {remark}")
    if zipped:
        write_zip(into, target)
    answer(f"{into}: {case.files} files of incident {case.incident_id[:12]}{f', and {target}' if zipped else ''}")
