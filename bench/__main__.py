"""`python -m aliasbench.bench`: the command line, where the script is not on the path."""

import sys

from aliasbench.bench.cli import main

sys.exit(main())
