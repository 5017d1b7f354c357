"""Lets the tests of all renderers import `closed_forms`."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))
