"""forceid coefficients: what air and ground do to a body, as coefficients, from one motion or many."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from forceid.cli.boundary.output import to_json, wrap
from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Force, Json, written
from forceid.errors import ConfigError

TABLE, GROUPS = ".toml", ".h5"


def run(
    results: Annotated[
        list[Path], typer.Argument(metavar="RESULT.h5...", help="Results of forceid estimate.")
    ],
    config: Annotated[
        Path, typer.Option("-c", "--config", metavar="LAW.toml", help="Terms to choose from, and sizes.")
    ],
    output: Annotated[
        Path | None, written("MODEL.toml", "Coefficients with covariance; MODEL.h5 for HDF5.")
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Fit a law of air or ground to motions: coefficients with 95 % intervals, no more terms than needed.

    LAW.toml names terms by component, as `lift = ["1", "alpha", "spline(alpha, 0.2)"]` under [law], of the
    ground as `contact = ["depth", "depth_rate"]`, `friction = ["1"]`, `rolling = ["1"]`. The law is flown
    again from the start of every motion, beside what was seen of it.

    Example: forceid coefficients throws/*.result.h5 -c law.toml -o model.toml
    """
    from forceid.files import check_output, read_result
    from forceid.laws import fit_flights, law_setting
    from forceid.sections import read_toml

    if output is not None:
        if output.suffix not in (TABLE, GROUPS):
            raise ConfigError(f"ends in {output.suffix!r}, expected .toml or .h5", str(output), "rename it")
        check_output(output, "settings" if output.suffix == TABLE else "model", [config, *results], force)
    setting = law_setting(read_toml(config), str(config))
    law = fit_flights([(str(path), read_result(path)) for path in results], setting, str(config))
    record = law.as_dict()
    if output is not None:
        write_model(output, record)
    tell(to_json(record) if json else summary(record))


def write_model(path: Path, record: dict[str, Any]) -> None:
    """The coefficients as TOML, or as HDF5 with the same names."""
    import tomli_w

    from forceid.files import write_model as write_groups_of
    from forceid.files.stored.atomic import write_whole

    if path.suffix == GROUPS:
        write_groups_of(path, record)
    else:
        write_whole(path, "# made by forceid coefficients\n" + tomli_w.dumps(record))


def summary(record: dict[str, Any]) -> str:
    """The same for people: a line for every coefficient, what was left out, and every flight flown again."""
    fit, flights = record["fit"], record["flight"]
    lines = [f"law      {len(record['coefficient'])} terms, {len(flights)} flights, "
             f"chi-square {fit['chi_square'] / fit['freedoms']:.3f} per freedom"]  # fmt: skip
    lines += [wrap(f"       - {note}") for note in fit["notes"]]
    for one in record["coefficient"]:
        ends = f"95 %: {one['low']:.6g} to {one['high']:.6g}"
        apart = f"; scatter {one['scatter']:.2g}" if "scatter" in one else ""
        lines.append(f"{one['name']:22} {one['value']:.6g} +- {one['std']:.2g}, {ends}{apart}")
    if record["left_out"]:
        lines.append(wrap(f"left out {', '.join(record['left_out'])}: evidence asks for none of them"))
    for one in flights:
        off = f"off by {1e3 * one['center_rms_m']:.3g} mm and {1e3 * one['turn_rms_rad']:.3g} mrad rms"
        lines.append(wrap(f"flown    {one['name']}: {off}, {one['misfit']:.2f} times the noise"))
    return "\n".join(lines)
