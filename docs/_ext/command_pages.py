"""The reference of the commands, from click itself."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import click

from softstart.cli.commands import cli


def commands() -> str:
    """Every command with its arguments and options, in the order of `softstart --help`."""
    context = click.Context(cli, info_name="softstart", **cli.context_settings)
    return "\n".join(line for name in cli.list_commands(context) for line in _command(name, context))


def _command(name: str, parent: click.Context) -> Iterator[str]:
    command = cli.get_command(parent, name)
    assert command is not None
    context = click.Context(command, info_name=name, parent=parent)
    yield from (f"## softstart {name}", "")
    usage = " ".join(command.collect_usage_pieces(context))
    yield from ("```text", f"{context.command_path} {usage}", "```", "")
    yield from (*paragraphs(command.help or ""), "")
    options = [p for p in command.get_params(context) if isinstance(p, click.Option) and not p.hidden]
    yield from ("| option | meaning |", "|---|---|")
    for option in options:
        record = option.get_help_record(context)
        if record is not None:
            names, meaning = record
            yield f"| `{cell(names)}` | {cell(prose(meaning))} |"
    yield from ("", *paragraphs(command.epilog or ""), "")


def paragraphs(text: str) -> Iterator[str]:
    """Click's help text as Markdown; what stands after a line of \\b keeps its lines."""
    for block in re.split(r"\n\s*\n", inspect.cleandoc(text).split("\f")[0]):
        lines = block.splitlines()
        if lines and lines[0].strip() == "\b":
            yield from ("```text", *lines[1:], "```", "")
        elif lines:
            yield from (prose(" ".join(line.strip() for line in lines)), "")


def prose(text: str) -> str:
    """Plain words, with what Markdown would take for marks made safe, and code as code."""
    safe = re.sub(r"([<>*\[\]_$])", r"\\\1", " ".join(text.split()))
    return re.sub(r"(?<![\w-])(--[a-z][\w-]*)", r"`\1`", safe)


def cell(text: str) -> str:
    """What may stand in a cell of a table."""
    return text.replace("|", "\\|")
