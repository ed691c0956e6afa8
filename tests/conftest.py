"""Settings that all tests share."""

from hypothesis import settings

# Deadlines measure the machine, not the code.
settings.register_profile("coooler", deadline=None, derandomize=True)
settings.load_profile("coooler")
