"""The command line: ``python -m lazygrid detect pour.dump``; see ``--help``."""

from __future__ import annotations

import os
import sys

from ._lazygrid import command


def main() -> int:
    """Run the arguments of the process, and return the exit code."""
    if sys.platform == "linux" and not os.path.isabs(os.environ.get("XDG_RUNTIME_DIR", "")):
        # Keeps libwayland, which graphics drivers ask for a display, from complaining about a missing directory.
        os.environ["XDG_RUNTIME_DIR"] = "/dev/null"
    # Python has no `sys.stdout` if the process began with a closed standard output.
    return command(["lazygrid", *sys.argv[1:]], closed=sys.stdout is None)


if __name__ == "__main__":
    sys.exit(main())
