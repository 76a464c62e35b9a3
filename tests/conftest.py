from hypothesis import settings

# No timed checks: the first example of a test may be the one that compiles a kernel.
settings.register_profile("wzsumo", deadline=None)
settings.load_profile("wzsumo")
