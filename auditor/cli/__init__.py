"""The command line: one small module a verb, imported when that verb runs."""

import importlib
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import click

from auditor import __version__
from auditor.cli.exit_codes import Exit
from auditor.cli.log_lines import FORMATS, Level, is_json, tell, write_as
from auditor.cli.options import PATH
from auditor.cli.output import answer, say
from auditor.cli.settings import FILE, announced, default_file, from_environment, read_file
from auditor.errors import AuditorError, refused

_GO_ON = "; finished recordings are kept, run the same command again to go on"
_KEEPING = frozenset({"scan", "judge", "calibrate", "refresh", "evaluate"})
"""The verbs that keep each recording as it is finished."""

VERBS = (
    "demo",
    "inspect",
    "convert",
    "attack",
    "calibrate",
    "calibration",
    "refresh",
    "drift",
    "scan",
    "judge",
    "label",
    "review",
    "evaluate",
    "query",
    "views",
    "report",
    "show",
    "case",
    "parameters",
    "store",
    "verify",
    "weights",
    "train-matcher",
)
"""In the order in which a newcomer meets them; each is a module of `verbs`, which has it as `command`."""


class _Verbs(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        return list(VERBS)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        from difflib import get_close_matches  # noqa: PLC0415 - keeps --help quick

        if args[0] not in VERBS and (near := get_close_matches(args[0], VERBS, 1)):
            ctx.fail(f"No such command {args[0]!r}. Did you mean {near[0]!r}?")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's
        if cmd_name not in VERBS:
            return None
        command: click.Command = importlib.import_module(f"auditor.cli.verbs.{cmd_name.replace('-', '_')}").command
        from_environment(command, [cmd_name])
        announced(command)
        return command


def _show_versions(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:  # noqa: FBT001 - click's signature
    if not wanted:
        return
    from auditor.resources import plug_ins  # noqa: PLC0415 - keeps --help quick

    answer(f"auditor, version {__version__}")
    for name, version in plug_ins().items():
        answer(f"plug-in {name}, version {version}: its code is run")
    ctx.exit()


@click.group(
    cls=_Verbs,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    epilog="Exit codes: 0 audited, nothing found; 1 findings; 2 could not run; 3 nothing found but not everything "
    "audited; 4 findings and not everything audited; 130 interrupted; 143 ended.",
)
@click.option(
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_versions,
    help="Show the version, and those of plug-ins.",
)
@click.option(
    "--config",
    type=PATH,
    envvar="AUDITOR_CONFIG",
    help="A file of settings.  [default: ~/.config/auditor/auditor.toml, where there is one]",
)
@click.option(
    "--log-format",
    type=click.Choice(FORMATS),
    default="text",
    envvar="AUDITOR_LOG_FORMAT",
    help="How remarks, progress and errors are written to stderr: text, or JSON, one object a line.  [default: text]",
)
@click.pass_context
def auditor(context: click.Context, config: Path | None, log_format: str) -> None:
    """Detect optical attacks on cameras and LiDAR in recorded drives, and identify the attacked sensors.

    \b
    auditor demo                            make a small fleet, attack it, audit it
    auditor calibrate clean_logs/*.mcap     make thresholds from clean recordings
    auditor scan fleet_logs/*.mcap          audit recordings
    auditor query incidents                 query the store
    auditor report                          write pages of the fleet and of each incident
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    write_as(log_format)
    file = config or default_file()
    if config is not None or file.is_file():
        assert isinstance(context.command, click.Group)
        context.default_map = read_file(file, context.command, context)
    elif Path(FILE).is_file():
        say(f"{FILE} in this folder is not read, as it may be of strangers: --config {FILE} reads it")


class _Termination(BaseException):
    """SIGTERM has come; like KeyboardInterrupt it is nothing that a verb may catch."""


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return its exit code; every expected failure ends in one line on stderr."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with _heeding_sigterm():
            return _run(given)
    except _Termination:
        tell(f"auditor: ended by SIGTERM{_going_on(given)}", Level.ERROR)
        return Exit.ENDED
    except Exception as error:  # noqa: BLE001 - whatever it is: Python's own exit code, 1, would mean findings
        if isinstance(error, OSError) and error.filename and (remedy := refused(error)):
            tell(f"auditor: {error.filename}: it cannot be used ({error.strerror}); {remedy}", Level.ERROR)
        else:
            _show_defect(error)
        return Exit.FAILED


def _going_on(given: Sequence[str]) -> str:
    verb = next((one for one in given if one in VERBS), "")
    return _GO_ON if verb in _KEEPING else ""


def _run(given: list[str]) -> int:
    write_as("text")
    try:
        code = auditor.main(given, standalone_mode=False, obj=given)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        return Exit.FAILED
    except click.ClickException as error:
        _show_usage(error)
        return Exit.FAILED
    except AuditorError as error:
        tell(f"auditor: {error}", Level.ERROR)
        return Exit.FAILED
    except (KeyboardInterrupt, click.Abort):
        tell(f"auditor: interrupted{_going_on(given)}", Level.ERROR)
        return Exit.INTERRUPTED
    except BrokenPipeError:
        # The reader (head, less) has gone; Python must not try to flush into the closed pipe at exit.
        sys.stdout = None
        return Exit.CLEAN
    return code if isinstance(code, int) else Exit.CLEAN


@contextmanager
def _heeding_sigterm() -> Iterator[None]:
    """SIGTERM inside the block raises _Termination there; it reaches the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(_: int, __: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one must not break into what the first one ends
        raise _Termination

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _show_usage(error: click.ClickException) -> None:
    """What click says of a command line; names of files may stand in it."""
    context = error.ctx if isinstance(error, click.UsageError) else None
    if context is not None and not is_json():
        click.echo(context.get_usage(), err=True)
        say(f"Try '{context.command_path} --help' for help.")
    tell(f"Error: {error.format_message()}", Level.ERROR)


def _show_defect(error: Exception) -> None:
    import traceback  # noqa: PLC0415 - keeps --help quick

    for entry in traceback.format_exception(error):
        for line in entry.splitlines() if entry.startswith("  ") else [entry.strip()]:
            tell(line, Level.ERROR)
    tell("auditor: this is a defect of auditor: please report the lines above", Level.ERROR)
