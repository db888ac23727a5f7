"""`python -m wbc` is the command `wbc`."""

import os
import sys

# Python puts the current folder first. A file there that is named like a library would be run in its place.
if not sys.flags.safe_path and sys.path[0] != os.path.dirname(os.path.dirname(os.path.abspath(__file__))):
    del sys.path[0]

from wbc.app.cli import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main())
