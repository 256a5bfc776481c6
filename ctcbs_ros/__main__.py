"""`python -m ctcbs_ros` is the command `ctcbs`."""

import sys

from ctcbs_ros.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
