"""What the commands print: plain JSON on one line, and a short summary for people."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from forceid import __version__

if TYPE_CHECKING:
    from forceid.records import Array, Estimate, Feet, Interface, Verdict, Witness

UNITS = {"force": "N", "moment": "N m"}
ESTIMATE_SAID = (
    "method", "model", "engine", "moment_about", "log_likelihood", "runtime_s", "timing", "model_choice",
    "tuned", "ladder", "leakage", "sensitivity", "input_sha256",
)  # fmt: skip


def to_json(record: Mapping[str, Any]) -> str:
    """The record as one line of strict JSON; what is not finite becomes null."""
    return json.dumps(finite_or_none(record), allow_nan=False)


def finite_or_none(value: Any) -> Any:
    """The value in plain lists and dictionaries, every number that is not finite replaced by None."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(value, inf_nan_mode="null", fallback=lambda array: array.tolist())


def describe(
    estimate: Estimate, source: Path, output: Path, truth: Mapping[str, Array] | None = None
) -> dict[str, Any]:
    """What --json says of an estimate: files, verdict, how it was made, and the numbers (SI, per axis)."""
    from forceid.report import wrench_numbers

    h, joints = estimate.hidden, estimate.interface
    return {
        "file": str(source),
        "output": str(output),
        **verdict_of(estimate.verdict),
        **{name: getattr(estimate, name) for name in ESTIMATE_SAID},
        "forceid_version": __version__,
        **({} if joints is None else {"interface": joints_of(joints)}),
        **({} if estimate.feet is None else {"foot": feet_record(estimate.feet)}),
        **({} if h is None else {"band": h.band, "frequency": h.frequency, "hidden_load": h.amplitude}),
        **witness_record(estimate.witness),
        **wrench_numbers(estimate, truth).as_dict(),
    }


def verdict_of(verdict: Verdict) -> dict[str, Any]:
    """A verdict, and what it rests on: sentences, codes, levels and the values in them, in one order."""
    return {"verdict": verdict.level, "reasons": list(verdict.reasons), **verdict.coded}


def witness_record(witness: Witness | None) -> dict[str, Any]:
    """How far an estimate is from the plain route in joint errors by axis, and what chance allows."""
    if witness is None:
        return {}
    return {
        f"witness_{load}_{number}": getattr(witness, f"{number}_{load}")
        for load in UNITS
        for number in ("difference", "limit")
    }


def witness_line(record: Mapping[str, Any]) -> str:
    """How far force and moment are from the plain route, along the axis where it is most for chance."""
    import numpy as np

    texts = []
    for load in UNITS:
        off, limit = (np.array(record[f"witness_{load}_{n}"], float) for n in ("difference", "limit"))
        if np.isfinite(off).any():
            most = int(np.nanargmax(off / limit))
            texts.append(f"{load} {off[most]:.2g} (by chance {limit[most]:.2g})")
    return f"witness  joint errors from the plain route: {', '.join(texts)}" if texts else ""


def band_line(band: Array) -> str:
    """Up to which frequency force and moment were followed, each along the axis with the widest band."""
    import numpy as np

    texts = []
    for name, own in zip(UNITS, (band[:3], band[3:]), strict=True):
        if np.isfinite(own).any():
            widest = float(np.nanmax(own))
            texts.append(f"{name} followed up to {widest:.2g} Hz" if widest > 0 else f"{name} as a constant")
    return f"band     {', '.join(texts)}; hidden_load says what may act beyond"


def worse_verdict(record: Mapping[str, Any]) -> str:
    """The verdict of an estimate or of its joints, whichever is worse."""
    found: list[str] = [record["verdict"], record.get("interface", {}).get("verdict", "ok")]
    return max(found, key=("ok", "degraded", "refused").index)


def joints_of(interface: Interface) -> dict[str, Any]:
    """What there is to say of joints: their verdict, and of each the rms of what passes through it."""
    import numpy as np

    from forceid.report import rms

    columns = {name: getattr(interface, name) for kind in UNITS for name in (kind, f"{kind}_std")}
    sizes = {name: np.linalg.norm(rms(values), axis=-1) for name, values in columns.items()}
    return {
        **verdict_of(interface.verdict),
        "consistency": interface.consistency,
        "joint": [
            {"name": name, "parts": list(pair), **{key: a[k] for key, a in sizes.items()}}
            for k, (name, pair) in enumerate(zip(interface.name, interface.parts, strict=True))
        ],
    }


def feet_record(feet: Feet) -> list[dict[str, Any]]:
    """What there is to say of feet: of each the rms of its force, and how long it touches, as a share."""
    import numpy as np

    from forceid.records import deviation
    from forceid.report import rms

    size, std = (np.linalg.norm(rms(a), axis=-1) for a in (feet.force, deviation(feet.force_cov)))
    touches = feet.contact.mean(0)
    return [
        {"name": name, "force": size[k], "force_std": std[k], "contact": touches[k]}
        for k, name in enumerate(feet.name)
    ]


def foot_line(foot: Mapping[str, Any]) -> str:
    """A line for a foot."""
    import numpy as np

    from forceid.report import plus_minus

    size = plus_minus(np.array(foot["force"]), np.array(foot["force_std"]), "N")
    return wrap(f"foot     {foot['name']}: {size} rms, touches {100 * foot['contact']:.0f} % of the time")


def joint_lines(interface: Mapping[str, Any]) -> list[str]:
    """A line for the verdict of the joints, one for each of its reasons and one for each joint."""
    import numpy as np

    from forceid.report import plus_minus

    lines = [f"joints   {interface['verdict']}", *(wrap(f"       - {text}") for text in interface["reasons"])]
    for joint in interface["joint"]:
        size = [
            plus_minus(np.array(joint[kind]), np.array(joint[f"{kind}_std"]), unit)
            for kind, unit in UNITS.items()
        ]
        first, second = joint["parts"]
        lines.append(wrap(f"joint    {joint['name']}, {first} on {second}: {', '.join(size)} rms"))
    return lines


def summary(record: Mapping[str, Any], verbose: bool = False) -> str:
    """The same for people: the verdict, force and moment as a table, then where the result is.

    verbose: also how the model was chosen, and how far the plain route is.
    """
    import numpy as np

    lines = [f"verdict  {record['verdict']}", *load_table(record)]
    if errors := [known_error(record, name) for name in UNITS if np.isfinite(record[f"{name}_error"]).any()]:
        lines.append(wrap(f"error    {'; '.join(errors)}"))
    if "band" in record and np.isfinite(record["band"]).any():
        lines.append(wrap(band_line(np.array(record["band"]))))
    lines += [foot_line(foot) for foot in record.get("foot", ())]
    if "interface" in record:
        lines += joint_lines(record["interface"])
    lines += [wrap(f"       - {reason}") for reason in record["reasons"]]
    lines.append(f"method   {record['method']}, model {record['model']}, engine {record['engine']}")
    if verbose and record["model_choice"]:
        lines.append(wrap(f"model    {record['model_choice'].removeprefix('the model is ')}"))
    if verbose and "witness_force_limit" in record and (line := witness_line(record)):
        lines.append(wrap(line))
    lines.append(f"result   {record['output']}, {record['runtime_s']:.2g} s")
    return "\n".join(lines)


def load_table(record: Mapping[str, Any]) -> list[str]:
    """Force and moment: the mean along each axis, and the rms of the vector with its sigma."""
    import numpy as np

    from forceid.report import plain, plus_minus

    rows, seen = [], False
    for name, unit in UNITS.items():
        mean, rms, std = (np.array(record[f"{name}_{k}"]) for k in ("mean", "rms", "std"))
        known = bool(np.isfinite(rms).any())
        cells = (
            "".join(f"{plain(v, 3) if np.isfinite(v) else '-':>11}" for v in mean) + "   " if known else ""
        )
        rows.append(f"{name:9}{cells}{plus_minus(rms, std, unit)}")
        seen = seen or known
    head = "".join(f"{'mean ' + axis:>11}" for axis in "xyz")
    return [f"{'':9}{head}   rms and sigma", *rows] if seen else rows


def known_error(record: Mapping[str, Any], name: str) -> str:
    """The error of the `force` or the `moment` against the truth, and what the estimate claimed of it."""
    import numpy as np

    from forceid.report import plain

    size = plain(float(np.linalg.norm(record[f"{name}_error"])), 2)
    times = plain(float(np.sqrt(np.nanmean(np.square(record[f"{name}_score"])))), 2)
    return f"{name} {size} {UNITS[name]} rms, {times} times its sigma"


def wrap(line: str) -> str:
    """A line of nine columns and text, folded at the width of the terminal, at most 100, under its text."""
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    return textwrap.fill(
        line, width, subsequent_indent=" " * 9, break_long_words=False, break_on_hyphens=False
    )
