"""`python -m apo_bench` is `apo-bench`, where that is not on the path."""

import sys

from apo_bench.cli.app import main

if __name__ == "__main__":
    sys.exit(main())
