"""What all tests share: property tests draw the same examples every time, so that a red run can be repeated.

HYPOTHESIS_PROFILE=explore draws new ones, many more of them.
"""

import os

from hypothesis import settings

settings.register_profile("steady", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))
