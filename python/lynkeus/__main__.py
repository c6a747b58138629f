"""The command: ``lynkeus``, or ``python -m lynkeus``."""

from __future__ import annotations

import sys

from ._lynkeus import command


def main() -> int:
    """Runs the command line; its exit code."""
    return command(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
