import os

from hypothesis import settings

# No timed checks: the first example of a test may be the one that compiles a kernel. The same examples in every run, so that a
# red run is red again; HYPOTHESIS_PROFILE=anew draws others, to look for what these miss.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("anew", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))
