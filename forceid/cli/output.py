"""What the commands print: plain JSON on one line, and a short summary for people."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forceid import __version__

if TYPE_CHECKING:
    from forceid.records import Array, Estimate


def to_json(record: Mapping[str, Any]) -> str:
    """The record as one line of strict JSON; what is not finite becomes null.

    >>> to_json({"force_mean": [1.0, float("nan")], "verdict": "ok"})
    '{"force_mean": [1.0, null], "verdict": "ok"}'
    """
    return json.dumps(finite(record), allow_nan=False)


def finite(value: Any) -> Any:
    """The value with every number that is not finite replaced by None."""
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if hasattr(value, "tolist"):
        return finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def describe(
    estimate: Estimate, source: Path, output: Path, truth: Mapping[str, Array] | None = None
) -> dict[str, Any]:
    """What --json says of an estimate: files, verdict, how it was made, and the numbers (SI, per axis)."""
    from forceid.report.numbers import summarize

    return {
        "file": str(source),
        "output": str(output),
        "verdict": estimate.verdict.level,
        "reasons": list(estimate.verdict.reasons),
        "method": estimate.method,
        "model": estimate.model,
        "engine": estimate.engine,
        "moment_about": estimate.moment_about,
        "log_likelihood": estimate.log_likelihood,
        "runtime_s": estimate.runtime_s,
        "tuned": dict(estimate.tuned),
        "input_sha256": estimate.input_sha256,
        "forceid_version": __version__,
        **summarize(estimate, truth).as_dict(),
    }


def summary(record: Mapping[str, Any]) -> str:
    """The same for people: the verdict first, then the numbers, then where the result is."""
    import numpy as np

    from forceid.report.numbers import plus_minus

    lines = [f"verdict  {record['verdict']}"]
    lines += [f"         {reason}" for reason in record["reasons"]]
    lines += [f"method   {record['method']}, model {record['model']}, engine {record['engine']}"]
    for name, unit in (("force", "N"), ("moment", "N m")):
        mean, rms, std, error = (np.array(record[f"{name}_{k}"]) for k in ("mean", "rms", "std", "error"))
        line = f"{name:8} {plus_minus(rms, std, unit)}"
        if np.isfinite(rms).any():
            line += f" rms, mean ({', '.join(f'{v:.3g}' for v in mean)}) {unit}"
        if np.isfinite(error).any():
            score = float(np.sqrt(np.nanmean(np.array(record[f"{name}_score"]) ** 2)))
            line += f"; error {np.linalg.norm(error):.2g} {unit} rms, {score:.2g} of its sigma"
        lines.append(line)
    lines.append(f"result   {record['output']}, {record['runtime_s']:.2g} s")
    return "\n".join(lines)
