"""Hostile files, odd surroundings, kills and odd outputs, and what `forceid` makes of each, counted.

    python -m evidence.attack -o docs [--count 1000] [--seed 1] [--only files contradictions ...]

Writes attack.md. Every file is made from the seed and its number alone. Each command runs in a process of
its own, which has half a minute of CPU and 3 GB of address space.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path

from evidence.attack.bodies import BASES, write
from evidence.attack.contradictions import KINDS, Clash
from evidence.attack.damaged import damaged_files
from evidence.attack.files import each_file
from evidence.attack.kills import killed
from evidence.attack.outputs import odd_outputs
from evidence.attack.surroundings import odd_surroundings
from evidence.attack.units import flights_compared
from evidence.attack.watched import End, forked, warm
from evidence.written import asked, paged, table

FAULT_KINDS = (
    "unexpected",
    "traceback",
    "noise on stderr",
    "late",
    "overwritten",
    "lost",
    "torn",
    "another result",
    "unnamed",
    "no next step",
    "escapes on the terminal",
)
PARTS = ("files", "damaged", "surroundings", "outputs", "kills", "units", "contradictions")
ABOUT = "`{command}`: what was done, and how it ended."
CLEAN = """\
No unexpected end, no warning of a library, none over 30 s; no file overwritten, lost or torn; every refusal \
names the file and what to do."""
FOUND = """\
`unexpected`: no exit code of the contract, or no error foreseen. `noise on stderr`: warnings of libraries. \
`late`: over 30 s. `overwritten`, `lost`, `torn`: of files that were there. `another result`: of one flight \
by other units or scales, 1e-6 of sigma off and more. `unnamed`: a refusal that does not name the file. `no \
next step`: one that does not say what to do."""
LISTED = 12  # kinds that a line names; of more it tells the number
Ended = Iterable[tuple[str, End, list[str]]]


def told(kind: Clash, folder: Path, plainly: dict[str, set[str]]) -> tuple[str, End]:
    """How a contradiction is told: refused, said in the verdict by codes, or not at all."""
    path = write(folder / "c.h5", kind.base, kind.edit)
    end = forked(["estimate", path.name, "--json"], folder)
    for left in folder.glob("c.*"):
        left.unlink()
    if end.code in (2, 3):
        return f"refused: {end.last.partition(path.name + ':')[2].partition(';')[0][:110]}", end
    new = codes(end) - plainly[kind.base]
    return f"said: {', '.join(sorted(new))}" if new else "silently accepted", end


def codes(end: End) -> set[str]:
    """The codes of what a verdict says."""
    try:
        return set(json.loads(end.out)["reason_codes"])
    except (ValueError, KeyError):
        return set()


def contradictions(folder: Path) -> list[tuple[str, str, End]]:
    """Every kind of contradiction, how it is told, and how the command ended."""
    plainly = {}
    for base in BASES:
        plainly[base] = codes(forked(["estimate", write(folder / "c.h5", base).name, "--json"], folder))
        (folder / "c.result.h5").unlink(missing_ok=True)
    return [(kind.name, *told(kind, folder, plainly)) for kind in KINDS]


def by_answer(found: Iterable[tuple[str, str]]) -> str:
    """How contradictions are told: how many are refused, and how many the verdict says by which codes."""
    answers = [how for _, how in found]
    said = Counter(code for how in answers if how.startswith("said") for code in how[6:].split(", "))
    refused = sum(how.startswith("refused") for how in answers)
    codes = ", ".join(f"`{code}` {many}" for code, many in said.most_common())
    return f"{refused} are refused, with variable and value. The verdict says the others: {codes}."


def counted(found: Ended) -> tuple[str, list[str]]:
    """How runs ended; a table of ends and faults by kind where one is wrong, and a line for each of those."""
    rows: dict[str, Counter[str]] = defaultdict(Counter)
    odd = []
    for number, (kind, end, faults) in enumerate(found, 1):
        for row in (kind, "all"):
            rows[row].update(["runs", f"exit {end.code}", *faults])
        if faults:
            odd.append(
                f"- {number}, {kind}, `{' '.join(end.words)[:80]}`: {', '.join(faults)}; {end.last[:160]}"
            )
            print(odd[-1], file=sys.stderr, flush=True)
    heads = ["kind", "runs", *sorted({k for c in rows.values() for k in c if k.startswith("exit")})]
    heads += [fault for fault in FAULT_KINDS if rows["all"][fault]]
    names = [*(k for k in sorted(rows) if k != "all"), "all"]
    if not odd:
        ends = ", ".join(f"{end} {rows['all'][end]}" for end in heads[2:])
        kinds = f" ({', '.join(names[:-1])})" if len(names) - 1 <= LISTED else ""
        return f"{number} runs of {len(names) - 1} kinds{kinds}: {ends}.", odd
    return table([{"kind": k, **{h: rows[k][h] for h in heads[1:]}} for k in names], heads), odd


def main() -> int:
    """Do what was asked for; the exit code says whether anything was wrong."""
    args = asked("evidence.attack", __doc__, count=1000, seed=1, only=PARTS)
    texts, wrong = [], 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        warm(folder)
        work: dict[str, Callable[[Path], Ended]] = {
            "files": lambda f: (
                (k.split(":")[0], e, x) for _, k, e, x in each_file(f, args.seed, 0, args.count)
            ),
            "damaged": lambda f: ((k, e, x) for k, _, e, x in damaged_files(f, args.seed, 0, args.count)),
            "surroundings": lambda f: ((k, e, x) for k, _, e, x in odd_surroundings(f)),
            "outputs": lambda f: ((k, e, x) for k, _, e, x in odd_outputs(f)),
            "units": lambda f: ((b, e, x) for b, _, e, x in flights_compared(f)),
            "kills": lambda f: ((f"{k} {s}", e, x) for s, k, e, x in killed(f, args.seed, args.count // 10)),
        }
        for part in args.only:
            own = folder / part
            own.mkdir()
            if part == "contradictions":
                found = contradictions(own)
                silent = sum(how == "silently accepted" for _, how, _ in found)
                wrong += silent + sum(bool(end.faults()) for *_, end in found)
                told_as = by_answer((kind, how) for kind, how, _ in found)
                texts += [f"## Contradictions: {silent} of {len(found)} silently accepted", told_as]
                continue
            shown, odd = counted(work[part](own))
            wrong += len(odd)
            texts += [f"## {part.capitalize()}", shown, *["\n".join(odd)] * bool(odd)]
    about = [ABOUT.format(command=args.command), FOUND if wrong else CLEAN]
    paged(args.output, "attack", "Under attack", *about, *texts)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
