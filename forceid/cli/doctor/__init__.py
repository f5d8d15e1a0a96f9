"""forceid doctor: what there is on this machine, and whether forceid works here."""

from __future__ import annotations

from typing import Annotated

import typer

from forceid.cli.boundary.output import to_json, wrap
from forceid.cli.boundary.terminal import tell
from forceid.cli.estimate import Json


def run(
    attack: Annotated[
        bool,
        typer.Option("--attack", help="Also run a short battery: hostile files, odd outputs, interrupts."),
    ] = False,
    json: Json = False,
) -> None:
    """Show versions, engine, BLAS, compiler and threads, and test an estimate whose answer is known.

    Exit code 1 when a check fails. The test takes about 5 s, the battery half a minute; both write into a
    folder of their own, which is gone afterwards.

    Example: forceid doctor --attack
    """
    from forceid.cli.doctor.battery import attacked
    from forceid.cli.doctor.self_test import checked
    from forceid.cli.doctor.surroundings import found

    around, checks = found(), []
    if not json:
        tell("\n".join(wrap(f"{what:9}{said}") for what, said in around.items()))
    for check in (*checked(), *(attacked() if attack else ())):
        checks.append(check)
        if not json:
            tell(wrap(f"{'ok' if check.good else 'FAULT':9}{check.claim}: {check.said}"))
    faults = sum(not check.good for check in checks)
    if json:
        listed = [{"claim": c.claim, "good": c.good, "said": c.said} for c in checks]
        tell(to_json({**around, "checks": listed, "faults": faults}))
    else:
        tell(f"{'verdict':9}{f'{faults} of {len(checks)} checks failed' if faults else 'all is well'}")
    if faults:
        raise typer.Exit(1)
