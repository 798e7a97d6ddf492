"""Entry point of `auditor` and `python -m auditor`."""

import io
import sys


def main() -> None:
    """Run the command line; imports sit inside the verbs so that `--help` is quick."""
    from auditor.cli import run  # noqa: PLC0415

    if isinstance(sys.stdout, io.TextIOWrapper):  # what a terminal of another encoding cannot show is written out
        sys.stdout.reconfigure(errors="backslashreplace")
    sys.exit(run())


if __name__ == "__main__":
    main()
