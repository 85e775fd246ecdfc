"""How many random examples Hypothesis draws: those of the profile that ``HYPOTHESIS_PROFILE`` names."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

_USUAL = settings.get_profile("default").max_examples

# The same examples every time, so that a run tells about the change at hand and nothing else, and no
# time limit for one example, which a busy machine would exceed. HYPOTHESIS_PROFILE=explore draws new ones.
settings.register_profile("steady", derandomize=True, deadline=None, max_examples=_USUAL)
settings.register_profile("explore", deadline=None, max_examples=10 * _USUAL)


def load() -> None:
    """Take the profile that was asked for."""
    settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "steady"))


load()


def examples(usual: int) -> settings:
    """So many examples for a test, in the profile that is used as usual, and in others in proportion. Each
    may be large and take its time."""
    many = usual * settings().max_examples // _USUAL
    return settings(max_examples=many, suppress_health_check=list(HealthCheck))
