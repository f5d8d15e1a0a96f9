"""An estimate with known truth, made by hand: a body thrown on a curve, tumbling, pushed smoothly."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from forceid.records import Estimate, Finding, Verdict
from forceid.report.page import render_page

NAMES = "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"
TRUE_STD = np.array([0.05, 0.04, 0.06, 0.002, 0.003, 0.002])


def make_estimate(
    samples: int = 600, seed: int = 1, **changes: object
) -> tuple[Estimate, dict[str, np.ndarray]]:
    """An estimate whose errors are unit normal times its claim, and the truth it was made from."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 3.0, samples)
    w = 2 * np.pi * 0.4
    force = np.stack([np.cos(w * t), -np.sin(2 * w * t), 1.2 + 0.4 * np.cos(3 * w * t)], axis=-1)
    moment = np.stack([0.06 * np.sin(w * t), 0.04 * np.cos(w * t), -0.05 + 0.02 * np.cos(2 * w * t)], axis=-1)
    momentum = np.stack(
        [
            0.06 * (1 - np.cos(w * t)) / w,
            0.04 * np.sin(w * t) / w,
            0.4 - 0.05 * t + 0.02 * np.sin(2 * w * t) / (2 * w),
        ],
        axis=-1,
    )
    center = np.stack(
        [9 * np.sin(w * t / 1.4), 6 * (1 - np.cos(w * t / 1.4)), 1.7 + 2 * t - 0.6 * t**2], axis=-1
    )
    mass, gravity = 0.15, np.array([0.0, 0.0, -9.81])
    impulse = [np.sin(w * t) / w, np.cos(2 * w * t) / (2 * w), 1.2 * t + 0.4 * np.sin(3 * w * t) / (3 * w)]
    velocity = np.stack(impulse, axis=-1) / mass + gravity * t[:, None]
    error = rng.normal(size=(samples, 6)) * TRUE_STD
    deformation = rng.normal(size=(samples, 8, 3)) * 2e-4
    deformation[..., 2] += 2e-3 * np.sin(2 * np.pi * 8 * t)[:, None] * np.linspace(-1, 1, 8)
    white = rng.normal(size=(samples, 24))
    fields: dict[str, object] = {
        "time": t,
        "force": force + error[:, :3],
        "moment": moment + error[:, 3:],
        "wrench_cov": np.broadcast_to(np.diag(TRUE_STD**2), (samples, 6, 6)),
        "center": center,
        "velocity": velocity,
        "orientation": np.tile([0.0, 0.0, 0.0, 1.0], (samples, 1)),
        "angular_velocity": momentum / 0.02,
        "angular_momentum": momentum,
        "deformation": deformation,
        "mean_shape": rng.normal(size=(8, 3)),
        "nis": np.mean(white**2, axis=1),
        "innovation": white,
        "mass": mass,
        "gravity": gravity,
        "node": tuple(f"m{k}" for k in range(8)),
        "method": "smoother",
        "model": "modal",
        "engine": "numpy",
        "log_likelihood": 12345.6,
        "moment_about": "mass_center",
        "verdict": Verdict(
            "degraded",
            (
                Finding(
                    "band",
                    "degraded",
                    {},
                    "The moment about x has no defense above 12 Hz; add markers off that axis.",
                ),
            ),
        ),
        "mode_amplitude": 2e-3 * np.stack([np.sin(50 * t), 0.4 * np.cos(90 * t)], axis=-1),
        "runtime_s": 0.42,
        "settings": 'method = "smoother"\nmodel = "auto"\n',
        "input_sha256": "ab" * 32,
        "tuned": {"noise_std": 5.1e-4, "force_density": 3.2},
    }
    truth = {"time": t, "force": force, "moment": moment}
    return Estimate(**(fields | changes)), truth  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def throw() -> Callable[..., tuple[Estimate, dict[str, np.ndarray]]]:
    return make_estimate


@pytest.fixture(scope="session")
def page() -> str:
    """The page of one throw, whole and in one body, with its truth."""
    estimate, truth = make_estimate()
    return render_page(estimate, truth, title="toss <3>")


@pytest.fixture
def thrown() -> tuple[Estimate, dict[str, np.ndarray]]:
    return make_estimate()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium without a window."""
    playwright = pytest.importorskip("playwright.sync_api")
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("no Chromium here")
    with playwright.sync_playwright() as started:
        running = started.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield running
        running.close()
