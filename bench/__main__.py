"""Runs the command line as `python -m aliasbench.bench`, where no script is installed."""

from aliasbench.bench.cli import main

raise SystemExit(main())
