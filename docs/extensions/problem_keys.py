"""``{problem-keys} module:Class``: the keys of a section of the problem file, as the code reads them."""

from __future__ import annotations

import inspect
from importlib import import_module
from types import NoneType
from typing import Any, get_args

from docutils import nodes
from docutils.statemachine import StringList
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from trajopt import units

_RANGES = {"positive": "> 0", "nonnegative": "≥ 0", "read_ceiling": "> 0, a ceiling", "read_limit": "a limit"}


class ProblemKeys(SphinxDirective):
    """The docstring of a section and a row a key: what it takes, and what it is by default."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """A paragraph and a table."""
        module, _, name = self.arguments[0].partition(":")
        model = getattr(import_module(module), name)
        lines = [inspect.getdoc(model).replace("``", "`"), "", "| key | takes | default |", "|---|---|---|"]
        for key, field in model.model_fields.items():
            lines.append(f"| `{key}` | {_takes(field)} | {_default(field)} |")
        container = nodes.container()
        self.state.nested_parse(StringList("\n".join(lines).split("\n"), self.arguments[0]), 0, container)
        return container.children


def _takes(field: FieldInfo) -> str:
    for validator in field.metadata:
        read = getattr(validator, "func", None)
        maker = getattr(read, "__qualname__", "").partition(".")[0]
        if maker in _RANGES:
            kind = inspect.getclosurevars(read).nonlocals["kind"]
            shown = dict.fromkeys(units.kinds(rotary)[kind].unit for rotary in (False, True))
            return f"{_RANGES[maker]} [{' or '.join(shown)}]"
        if maker == "plain":
            known = inspect.getclosurevars(read).nonlocals
            return f"a number, for example {known.get('example', '1')}"
    return _named(field.annotation).replace("|", "or")


def _named(annotation: Any) -> str:
    parts = [part for part in get_args(annotation) if part is not NoneType]
    if "Literal" in str(annotation) and all(isinstance(part, str) for part in parts):
        return ", ".join(f'`"{part}"`' for part in parts)
    if parts:
        return ", ".join(dict.fromkeys(_named(part) for part in parts if part is not Ellipsis))
    if isinstance(annotation, str):
        return f'`"{annotation}"`'
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return f"a section: `{annotation.__name__}`"
    plain = {float: "a value", int: "a whole number", str: "a text", bool: "`true` or `false`"}
    return plain.get(annotation, f"`{getattr(annotation, '__name__', annotation)}`")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    default = field.default
    if default is None or default == () or default == "" or isinstance(default, BaseModel):
        return ""
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("problem-keys", ProblemKeys)
    return {"parallel_read_safe": True}
