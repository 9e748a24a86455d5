"""The command ``trajopt``, also as ``python -m trajopt``; an interrupt while it is loaded ends it quietly."""

from __future__ import annotations

import sys


def main() -> None:
    """Run `trajopt.cli.main`."""
    try:
        from trajopt import cli
    except KeyboardInterrupt:
        print("trajopt: stopped by the user", file=sys.stderr)
        sys.exit(130)
    cli.main()


if __name__ == "__main__":
    main()
