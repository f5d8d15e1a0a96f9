"""Pages written from the code: commands from what `--help` says, files from the schema, names from modules.

A page asks for them by a line of its own: `@commands`, `@schema`, `@findings`, `@api MODULE` for what a
package exports, and `@api MODULE.*` for everything public in its modules.
"""

import inspect
import pkgutil
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from plain_docstrings import as_page
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

SAID = re.compile(r"^ *>>>|\bSource:|\bRaises\b", re.M)
BRACED = re.compile(r"\{([^}]*)\}(?:\.\.\.)?")
IMPORTED = re.compile(r"^ *from (forceid(?:\.\w+){2,}) import (\([^)]*\)|[^\n(]+)", re.M)
REQUEST = re.compile(r"^@(commands|schema|findings|api)(?: (\S+))?$", re.M)


def commands() -> str:
    """Every command with its arguments and options, from the objects that print the help."""
    import click
    import typer

    from forceid.cli.app import COMMANDS, app

    group = typer.main.get_command(app)
    page = [command_page("forceid", group, click.Context(group, info_name="forceid"))]
    for name in COMMANDS:
        command = group.get_command(click.Context(group), name)
        parent = click.Context(group, info_name="forceid")
        page.append(command_page(f"forceid {name}", command, click.Context(command, parent, info_name=name)))
    return "\n\n".join(page)


def command_page(name: str, command: Any, context: Any) -> str:
    """One command in Markdown: usage, help, and a table of what it takes."""
    usage = BRACED.sub(r"\1", " ".join([name, *command.collect_usage_pieces(context)]))
    page = [f"## {name}", f"```text\n{usage}\n```"]
    for block in re.split(r"\n\s*\n", inspect.cleandoc(command.help or "")):
        if block.startswith("\b"):  # lines that click keeps as they are
            page.append("```text\n" + block.removeprefix("\b").strip("\n") + "\n```")
        elif block.startswith("Example"):
            page.append("```text\n" + re.sub(r"^Examples?:\s*", "", block) + "\n```")
        else:
            page.append(block)
    rows = []
    for taken in command.get_params(context):
        spelled = sorted((*taken.opts, *taken.secondary_opts), key=len)
        names, metavar = ", ".join(f"`{opt}`" for opt in spelled), taken.metavar or taken.name.upper()
        if taken.param_type_name == "argument":
            names = f"`{metavar}`"
        elif not taken.is_flag:
            names += f" `{metavar}`"
        meaning = cell(taken.help or "") + (" Required." if taken.required else "")
        rows.append(f"| {names} | {meaning} |")
    if rows:
        page.append("\n".join(["| takes | meaning |", "|---|---|", *rows]))
    return "\n\n".join(page)


def cell(text: str) -> str:
    """Text that stays within its cell of a table."""
    return " ".join(text.split()).replace("|", r"\|")


def schema() -> str:
    """The variables of motion file and result file, with dimensions and units."""
    from forceid.files import schema

    page = []
    groups = {"BODY": "body", "MOTION": "motion", "KNOWN_LOADS": "load_known"}
    groups |= {"ESTIMATE": "estimate", "MODAL": "estimate, of modes", "IMPULSE": "estimate, in pieces"}
    groups |= {name: name.lower() for name in ("LOAD", "INTERFACE", "FLOWN", "AERO")}
    for group, where in groups.items():
        table: Mapping[str, Any] = getattr(schema, group)
        rows = [
            f"| `{name}` | {', '.join(v.dims) or 'one number'} | {v.units} | {cell(v.long_name)} |"
            for name, v in table.items()
        ]
        head = ["| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
        page.append("\n".join([f"## `/{where}`", "", *head, *rows]))
    return "\n\n".join(page)


def findings() -> str:
    """Every finding of the catalogue: code, what it costs, what it means, what to do, and its sentence."""
    from forceid.estimation.verdict.catalogue import GROUPS

    page = []
    for title, entries in GROUPS.items():
        page.append(f"## {title}")
        for entry in entries:
            said = re.sub(r"\{(\w+)[^}]*\}", r"`\1`", entry.sentence)
            page += [
                f"### {entry.code}",
                f"*Verdict: {entry.level}.* {entry.meaning}",
                f"**What to do.** {entry.action}",
                f"> {said}",
            ]
    return "\n\n".join(page)


def exported(package: ModuleType) -> list[str]:
    """The names that a package offers, in the order of the modules they come from."""
    names: list[str] = list(getattr(package, "__all__", ()))
    if not names:
        local = f"{package.__name__}."
        text = inspect.getsource(package)
        names = [n for n in re.findall(r"import \w+ as (\w+)", text) if hasattr(package, n)]
        names.sort(key=lambda n: inspect.ismodule(getattr(package, n)))
        names += re.findall(rf"from {re.escape(local)}\w+ import (\w+)\s*$", text, re.M)
        names += re.findall(r"^def (\w+)", text, re.M)
    return [n for n in dict.fromkeys(names) if not n.startswith("_")]


def meant(package: ModuleType, name: str) -> Any:
    """What a name of a package is; the function, where a package below it has its name (`NamedAlike`)."""
    thing = getattr(package, name)
    return package.__getattr__(name) if inspect.ismodule(thing) and callable(thing) else thing


def public(module: ModuleType) -> list[str]:
    """Functions and classes that a module defines for others, in the order of its lines.

    Those are the records, and the functions that say where they come from, what they raise or how they are
    called, or that another package imports.
    """
    own = [
        (inspect.getsourcelines(thing)[1], name)
        for name, thing in vars(module).items()
        if not name.startswith("_")
        and getattr(thing, "__module__", "") == module.__name__
        and (
            inspect.isclass(thing)
            or (inspect.isfunction(inspect.unwrap(thing)) and offered(module.__name__, name, thing))
        )
    ]
    return [name for _, name in sorted(own)]


def offered(module: str, name: str, function: Any) -> bool:
    """Whether a function is for others: by its docstring, or because another package imports it."""
    return bool(SAID.search(function.__doc__ or "")) or name in imported_elsewhere()[module]


@cache
def imported_elsewhere() -> Mapping[str, set[str]]:
    """By module, the names that packages other than its own import from it."""
    names: defaultdict[str, set[str]] = defaultdict(set)
    root = Path(import_module("forceid").__path__[0])
    for path in root.rglob("*.py"):
        for module, listed in IMPORTED.findall(path.read_text(encoding="utf-8")):
            if module.split(".")[1] != path.relative_to(root).parts[0]:
                names[module] |= set(re.findall(r"\w+", listed))
    return names


def concepts(wanted: str) -> Iterator[tuple[ModuleType, list[str]]]:
    """Module by module, the dotted names to show: of a package, of all its modules, or of one module."""
    package = import_module(wanted.removesuffix(".*"))
    if wanted.endswith(".*"):
        for found in pkgutil.iter_modules(package.__path__):
            if not found.name.startswith("_"):
                module = import_module(f"{package.__name__}.{found.name}")
                if names := public(module):
                    yield module, [f"{module.__name__}.{name}" for name in names]
        return
    if not hasattr(package, "__path__"):
        yield package, [f"{package.__name__}.{name}" for name in public(package)]
        return
    homes: dict[str, list[str]] = {}
    for name in exported(package):
        thing = meant(package, name)
        if inspect.ismodule(thing):
            homes[thing.__name__] = [f"{thing.__name__}.{inner}" for inner in public(thing)]
        elif not isinstance(thing, int | float):  # limits are listed by `forceid settings --thresholds`
            home = getattr(thing, "__module__", None) or package.__name__
            home = home if home.startswith("forceid.") else package.__name__
            homes.setdefault(home, []).append(f"{package.__name__}.{name}")
    for home, names in homes.items():
        yield import_module(home), names


def api(wanted: str) -> str:
    """Sections of a reference page, one a module: what it is about, then its names."""
    page: list[str] = []
    for module, names in concepts(wanted):
        title = module.__name__.removeprefix("forceid.")
        page += [title, "-" * len(title), ""]
        if module.__name__ != wanted.removesuffix(".*") or not hasattr(module, "__path__"):
            page += as_page(inspect.cleandoc(module.__doc__ or "").splitlines())
        for name in names:
            home, _, own = name.rpartition(".")
            thing = meant(import_module(home), own)
            if thing is not getattr(import_module(home), own):
                page += [f".. py:function:: {name}{inspect.signature(thing)}", ""]
                lines = as_page(inspect.cleandoc(thing.__doc__ or "").splitlines())
                page += [f"   {line}".rstrip() for line in lines]
            elif inspect.isclass(thing):
                page += [f".. autoclass:: {name}", "   :members:", ""]
            elif callable(thing):
                page += [f".. autofunction:: {name}", ""]
            elif isinstance(thing, str | dict | tuple):
                page += [f".. py:data:: {name}", "", f"   {told(thing)}", ""]
    return "\n".join(page)


def told(thing: str | tuple[str, ...] | dict[str, Any]) -> str:
    """A constant in words: its value, or what can be looked up in it."""
    return (
        f"``{thing!r}``"
        if isinstance(thing, str)
        else ("" if isinstance(thing, tuple) else "By name: ") + ", ".join(f"``{k}``" for k in thing) + "."
    )


def write(app: Sphinx, docname: str, source: list[str]) -> None:
    """Put what a page asks for in the place of the line that asks."""
    makers = {"commands": commands, "schema": schema, "findings": findings}
    source[0] = REQUEST.sub(lambda found: makers.get(found[1], lambda: api(found[2]))(), source[0])


def always(app: Sphinx, env: BuildEnvironment, *_: Any) -> list[str]:
    """Pages from the code are read again in every build."""
    return [name for name in env.found_docs if REQUEST.search(env.doc2path(name).read_text(encoding="utf-8"))]


def setup(app: Sphinx) -> dict[str, Any]:
    """Listen to the reading of pages."""
    app.connect("source-read", write)
    app.connect("env-get-outdated", always)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
