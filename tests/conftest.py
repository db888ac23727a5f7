"""Profile of the property tests, for all folders."""

from properties import load_profile

load_profile()
