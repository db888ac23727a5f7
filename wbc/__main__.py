"""`python -m wbc` is the command `wbc`."""

import sys

from wbc.app.cli import main

if __name__ == "__main__":
    sys.exit(main())
