"""`python -m wive` is the `wive` command."""

import sys

from wive.cli import main

if __name__ == "__main__":
    sys.exit(main())
