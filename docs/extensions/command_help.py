"""``{command-help}``: every command with its arguments and options, as the program says them."""

from __future__ import annotations

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.main import get_command

from trajopt.cli import app as commands


class CommandHelp(SphinxDirective):
    """A section a command."""

    def run(self) -> list[nodes.Node]:
        """Paragraphs and tables, in the order in which the code has them."""
        lines: list[str] = []
        for name, command in get_command(commands).commands.items():  # type: ignore[attr-defined]
            lines += [f"**`trajopt {name}`**: {command.help}", "", "| argument | meaning |", "|---|---|"]
            for parameter in command.params:
                option = parameter.opts[0][0] == "-"
                written = ", ".join(parameter.opts) if option else parameter.metavar or parameter.name
                lines.append(f"| `{written}` | {getattr(parameter, 'help', '') or ''} |")
            lines.append("")
        container = nodes.container()
        self.state.nested_parse(StringList(lines, "command-help"), 0, container)
        return container.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True}
