"""The engine that runs suites, times them and keeps their records, and the command line."""
