"""Entry point of `auditor` and `python -m auditor`."""

import sys


def main() -> None:
    """Run the command line; imports sit inside the verbs so that `--help` is quick."""
    from auditor.cli import run  # noqa: PLC0415

    sys.exit(run())


if __name__ == "__main__":
    main()
