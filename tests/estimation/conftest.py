import closed_forms
import pytest

from forceid.config import load_settings
from forceid.estimation.run import estimate_recording


@pytest.fixture(scope="session")
def estimated():
    """The estimate of a recording under settings given by key."""

    def estimate(recording, **settings):
        return estimate_recording(recording, load_settings(**settings))

    return estimate


@pytest.fixture(scope="session")
def flown():
    """A rigid flight and its estimate by the smoother."""
    recording = closed_forms.toss()
    return recording, estimate_recording(recording, load_settings())


@pytest.fixture(scope="session")
def breathing():
    """A flight that breathes by a twentieth, and its estimate by the smoother."""
    recording = closed_forms.toss(breath=0.05)
    return recording, estimate_recording(recording, load_settings())
