"""Problem files: TOML with unit texts, read under caps, refused in one line that names the field and the remedy."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pydantic import BaseModel, ValidationError

from trajopt import problem as p
from trajopt import units
from trajopt.curve import written_out
from trajopt.errors import BadInput
from trajopt.fields import nearest

if TYPE_CHECKING:
    from trajopt.axes.problem import AxesProblem
    from trajopt.plant.problem import PlantProblem

LARGEST_FILE: Final = 1_000_000  # bytes
_DEEPEST: Final = 64  # nesting, and parts of a dotted key; tomllib takes quadratic time on more
_LONGEST_WORD: Final = 400  # a number or a bare key
_MOST_VALUES: Final = 100_000  # a key counts for four: with more, reading and refusing takes over a second
_TOKEN: Final = re.compile(
    r'''"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})?|"(?:[^"\\\n]++|\\.)*+"?'''
    r"""|'{3}(?:[^']++|'(?!''))*+(?:'{3,5})?|'[^'\n]*+'?|\#[^\n]*+|[\w+-]++|.""",
    re.DOTALL,
)
_EXAMPLES: Final = {  # what to write for what is missing
    "move": 'write [move] with time = "1 s" and end = { position = "0.25 m" }',
    "axes": 'write [[axes]] with name = "x" and move.end = { position = "0.25 m" }',
    "move.time": 'write time = "1 s", or "free"',
    "move.end": 'write end = { position = "0.25 m" }',
    "move.via.time": 'write { time = "0.5 s", position = "0.1 m" }',
    "plant.input": "write input = [-1.0, 1.0], or input = 1.0 for plus-minus",
    "plant.final_value": "write final_value = 1.0",
    "vibration.frequency": 'write [[vibration]] with frequency = "8 Hz"',
    "objective": 'write [objective] with minimize = "jerk" and norm = "l2"',
    "objective.terms": 'write minimize = "jerk" and norm = "l2", or terms',
    "objective.ceilings.of": 'write for example of = "energy"',
    "objective.ceilings.at_most": 'write for example at_most = "0.9 J"',
    "objective.terms.minimize": f"write minimize = one of {', '.join(p.MINIMIZABLE)}",
}
_LISTS: Final = {
    "vibration": '[{ frequency = "8 Hz" }]',
    "via": '[{ time = "0.5 s", position = "0.1 m" }]',
    "ceilings": '[{ of = "energy", at_most = "0.9 J" }]',
    "terms": '[{ minimize = "jerk", norm = "l2" }]',
}
_WANTED: Final = "a problem file or a ready-made problem's name"
_KEY_EXAMPLE: Final = 'for example move.end.position="0.3 m"'
_SAVE_PLAIN: Final = "save it as plain UTF-8 without a byte order mark or NUL bytes"
_ALIASES: Final = {
    "load": {"mass": "inertia", "force_constant": "torque_constant", "torque": "force"},
    "limits": {"torque": "force", "rms_torque": "rms_force"},
}


def load(path: str | os.PathLike[str], overrides: Sequence[str] = ()) -> p.Problem | PlantProblem | AxesProblem:
    """The problem in a TOML file, or of a ready-made problem's name, with ``key=value`` overrides applied.

    Raises BadInput with one line naming the file, the field and the remedy.
    """
    source = find(Path(path), ready_made())
    return parse(read_text(source), overrides, str(path), source.parent)


def parse(
    text: str, overrides: Sequence[str] = (), name: str = "problem", folder: Path | None = None
) -> p.Problem | PlantProblem | AxesProblem:
    """The problem stated by a TOML text, with the tables it names in ``folder`` (here, by default). Raises BadInput."""
    data = read_toml(text, name)
    for override in overrides:
        _override(data, override)
    return from_dict(data, name, folder)


def read_toml(text: str, name: str) -> dict[str, Any]:
    """The content of a TOML text, under the caps. Raises BadInput."""
    _refuse_marks(text, name)
    _refuse_deep(text, name)
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise refused(name, f"not a TOML file: {_remedied(str(error))}") from None


def from_dict(
    data: dict[str, Any], name: str = "problem", folder: Path | None = None
) -> p.Problem | PlantProblem | AxesProblem:
    """The problem stated by a dictionary laid out as a problem file, with unit texts. Raises BadInput."""
    if "plant" in data:
        return _plant(data, name)
    if "axes" in data or "arm" in data:
        return _axes(data, name, folder)
    written = data
    data = {key: _renamed(key, value, name) for key, value in data.items()}
    rotary = _rotary(data)
    context = {"rotary": rotary, "texts_only": True, "folder": folder or Path()}
    try:
        return p.Problem.model_validate({"rotary": rotary, **data}, context=context)
    except ValidationError as error:
        raise refused(name, _as_written(explain(error), written)) from None


def carry_tables(data: dict[str, Any], name: str, folder: Path) -> dict[str, Any]:
    """``data`` with the tables of its loads, which it names beside the file, written into it: for those who solve it
    elsewhere. Raises BadInput."""
    axes = data.get("axes")
    if isinstance(axes, list):
        data = data | {"axes": [carry_tables(x, name, folder) if isinstance(x, dict) else x for x in axes]}
    load = data.get("load")
    load = load if isinstance(load, dict) else {}
    named = {key: value for key, value in load.items() if isinstance(value, dict) and "csv" in value}
    if not named:
        return data
    renamed = {section: _renamed(section, value, name) for section, value in data.items()}
    context = {"rotary": _rotary(renamed), "folder": folder}
    for key, value in named.items():
        try:
            named[key] = written_out(value, _ALIASES["load"].get(key, key), context)
        except ValueError as error:
            raise refused(name, f"load.{key}: {error}") from None
    return data | {"load": load | named}


def _plant(data: dict[str, Any], name: str) -> PlantProblem:
    from trajopt.plant.problem import PlantProblem

    for key in ("move", "limits", "load", "vibration", "objective", "transcription", "rotary"):
        if key in data:
            raise refused(name, f"{key}: belongs to an axis and cannot stand beside [plant]; leave one of them out")
    try:
        return PlantProblem.model_validate(data, context={"texts_only": True})
    except ValidationError as error:
        raise refused(name, explain(error, PlantProblem)) from None


def _axes(data: dict[str, Any], name: str, folder: Path | None) -> AxesProblem:
    """Several axes: each read as a problem of one is, and on an arm in angles unless it says otherwise."""
    from trajopt.axes.problem import AxesProblem

    for key in ("limits", "load", "vibration", "rotary"):
        if key in data:
            raise refused(name, f"{key}: belongs to each of the axes; write it below [[axes]]")
    if "tip" in data and "arm" not in data:
        raise refused(name, 'tip: needs an arm; write [arm] with kind = "scara"')
    axes = data.get("axes")
    if isinstance(axes, list):
        arm = {"rotary": True} if "arm" in data else {}
        data = data | {"axes": [_axis({**arm, **x}, name) if isinstance(x, dict) else x for x in axes]}
    context = {"rotary": False, "texts_only": True, "folder": folder or Path()}
    try:
        return AxesProblem.model_validate(data, context=context)
    except ValidationError as error:
        raise refused(name, _as_written(explain(error, AxesProblem), data)) from None


def _axis(data: dict[str, Any], name: str) -> dict[str, Any]:
    data = {section: _renamed(section, value, name) for section, value in data.items()}
    return {"rotary": _rotary(data), **data}


def read_text(path: Path, largest: int = LARGEST_FILE, wanted: str = _WANTED) -> str:
    """The text of a regular UTF-8 file of at most ``largest`` bytes. Raises BadInput."""
    name = str(path)
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        try:
            regular = stat.S_ISREG(os.fstat(handle).st_mode)
            raw = _first_bytes(handle, largest + 1) if regular else b""
        finally:
            os.close(handle)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise refused(name, f"cannot be read: {reason}; give {wanted}") from None
    if not regular:
        raise refused(name, f"not a regular file; give {wanted}")
    if len(raw) > largest:
        raise refused(name, f"larger than {largest // 1_000_000} MB; give {wanted}")
    if raw.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")) or b"\0" in raw:
        raise refused(name, _SAVE_PLAIN)
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise refused(name, f"not UTF-8 at byte {error.start}; save it as plain UTF-8") from None


def _first_bytes(handle: int, most: int) -> bytes:
    parts: list[bytes] = []
    while most > 0 and (part := os.read(handle, most)):
        parts.append(part)
        most -= len(part)
    return b"".join(parts)


def _refuse_marks(text: str, name: str) -> None:
    if text.startswith("\ufeff") or "\0" in text:
        raise refused(name, _SAVE_PLAIN)


def find(path: Path, ready: Mapping[str, Path], what: str = "problem", folder: Path = Path()) -> Path:
    """The file at ``path``, seen from ``folder``, or the ``ready``-made one of that name. Raises BadInput."""
    if path.suffix == "" and path.name == str(path) and not os.path.exists(folder / path):
        if str(path) not in ready:
            raise refused(str(path), f"no such file or ready-made {what}{nearest(str(path), list(ready))}")
        return ready[str(path)]
    return folder / path


def ready_made(folder: str = "") -> dict[str, Path]:
    """The ready-made problems, or what is in a folder beside them: name -> file, sorted. (Data of the package
    ``problems``, which is not imported.)"""
    from importlib.resources import files

    return {path.stem: path for path in sorted((Path(str(files("problems"))) / folder).glob("*.toml"))}


def _refuse_deep(text: str, name: str) -> None:
    """Refuse, in time linear in ``text``, what tomllib or Python would take long or deep over."""
    depth = parts = values = 0
    for token in _TOKEN.finditer(text):
        first, excess = token[0][0], ""
        if first in "=,.[]{}\n":
            values += 1 if first in ",]}" else 0 if first == "\n" else 4
            depth += (first in "[{") - (first in "]}")
            parts = parts + 1 if first == "." else 0
            if depth > _DEEPEST:
                excess = f"nested deeper than {_DEEPEST}"
            elif parts >= _DEEPEST:
                excess = f"a key of more than {_DEEPEST} parts"
            elif values > _MOST_VALUES:
                excess = f"more than {_MOST_VALUES} values or a quarter as many keys"
        elif first not in "\"'#" and len(token[0]) > _LONGEST_WORD:
            excess = f"a number or key of more than {_LONGEST_WORD} digits or letters"
        if excess:
            line = text.count("\n", 0, token.start()) + 1
            raise refused(name, f"line {line}: {excess}; a problem file needs nothing of the kind")


def _remedied(message: str) -> str:
    """A message of tomllib with a remedy."""
    if "overwrite" in message or "twice" in message or "mutate" in message or "redefine" in message:
        return f"{message}; write each key and section once"
    return f'{message}; write keys as time = "1 s", texts and quantities in quotes'


def _override(data: dict[str, Any], override: str) -> None:
    """Apply ``move.end.position=0.3 m``."""
    key, equals, text = override.partition("=")
    if not equals:
        raise refused(f"--set {override}", f"write key=value, {_KEY_EXAMPLE}")
    where = f"--set {key.strip()}"
    assign(data, key, read_value(text, where), where)


def read_value(text: str, where: str) -> Any:
    """The value of an override: TOML where it reads as TOML, else a text. Raises BadInput."""
    _refuse_marks(text, where)
    _refuse_deep(text, where)
    try:
        (value,) = tomllib.loads(f"value = {text}").values()  # more than one: the text smuggles further keys in
    except (tomllib.TOMLDecodeError, RecursionError, ValueError):
        value = text.strip()
        if value[:1] in ("[", "{"):
            raise refused(where, f'{units.shown(value)} is no TOML list or table; quote it for the shell, such as'
                           """ 'limits.velocity=["0 m/s", "0.5 m/s"]'""") from None
    return value


def assign(data: dict[str, Any], key: str, value: Any, where: str) -> None:
    """Set a dotted key of a problem file's content; what says the same in other words goes. Raises BadInput."""
    parts = [part.strip() for part in key.split(".")]
    if not all(parts) or len(parts) > _DEEPEST:
        raise refused(where, f"write key=value, {_KEY_EXAMPLE}")
    section: Any = data
    for i, part in enumerate(parts[:-1]):
        among = section
        section = _listed(section, part) if isinstance(section, list) else section.setdefault(part, {})
        if section is None:
            names = [x.get("name", k) if isinstance(x, dict) else k for k, x in enumerate(among)]
            raise refused(where, f"{'.'.join(parts[:i])} has no {part}; one of {', '.join(map(str, names))}")
        if not isinstance(section, dict) and not (isinstance(section, list) and i < len(parts) - 2):
            raise refused(where, f"{'.'.join(parts[: i + 1])} is not a section; set it as a whole")
    for other in _replaced(parts, value):
        section.pop(other, None)
    section[parts[-1]] = value


def _listed(sections: list[Any], part: str) -> Any:
    """The section of a list, such as [[axes]], that has this name or this number, counted from 0."""
    named = [x for x in sections if isinstance(x, dict) and x.get("name") == part]
    return named[0] if named else sections[int(part)] if part.isdecimal() and int(part) < len(sections) else None


def _replaced(parts: list[str], value: Any) -> tuple[str, ...]:
    """The keys beside an overridden one that say the same in other words, and go."""
    if len(parts) != 2:
        return ()
    section, key = parts
    if section == "objective":
        without = ("norm",) if key == "minimize" and value in p.WITHOUT_NORM else ()
        return {"terms": ("minimize", "norm", "weight", "axes", "combine")}.get(key, ("terms", *without))
    twins = _ALIASES.get(section, {})
    return tuple(alias for alias, field in twins.items() if field == key) + ((twins[key],) if key in twins else ())


def _renamed(section: str, value: Any, name: str) -> Any:
    if not isinstance(value, dict) or section not in _ALIASES:
        return value
    value = dict(value)
    for alias, field in _ALIASES[section].items():
        if alias in value:
            if field in value:
                raise refused(name, f"{section}.{alias}: give {alias} or {field}, not both")
            value[field] = value.pop(alias)
    return value


def _rotary(data: dict[str, Any]) -> bool:
    """A rotary axis has an inertia in kg m²; without a load the unit of the end position tells."""
    if isinstance(data.get("rotary"), bool):
        return bool(data["rotary"])
    inertia: Any = data.get("load", {}).get("inertia") if isinstance(data.get("load"), dict) else None
    if isinstance(inertia, dict):
        values = inertia.get("value")
        inertia = values[0] if isinstance(values, list) and values else None
    move = data.get("move")
    end = move.get("end") if isinstance(move, dict) else None
    position = end.get("position") if isinstance(end, dict) else None
    masses = {axis["inertia"].dimension[:3]: axis is units.ROTARY for axis in (units.LINEAR, units.ROTARY)}
    known = masses.get(_dimension(inertia)[:3])
    return known if known is not None else _dimension(position)[3] == 1


def _dimension(text: Any) -> units.Dimension:
    try:
        return units.parse(text)[1] if isinstance(text, str) else (0, 0, 0, 0, 0)
    except units.UnitError:
        return (0, 0, 0, 0, 0)


def explain(error: ValidationError, root: type[BaseModel] = p.Problem) -> str:
    """The first fault of a validation of ``root`` as one line: the field, what is wrong, what would be right."""
    faults = error.errors(include_url=False)
    first = next((fault for fault in faults if fault["type"] == "extra_forbidden"), faults[0])
    field = _dotted(first["loc"])
    kind, got = first["type"], units.shown(first["input"])
    if kind == "extra_forbidden":
        return f"{field}: unknown key{_meant(first['loc'], root)}"
    if kind == "missing":
        known = ".".join(str(part) for part in first["loc"] if isinstance(part, str))
        return f"{field}: is missing; {_EXAMPLES.get(known, 'write it')}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"{field}: must be a section with keys {', '.join(_keys(first['loc'], root))}, got {got}"
    if kind == "tuple_type":
        return f"{field}: must be a list of sections such as {_LISTS.get(str(first['loc'][-1]), '[...]')}, got {got}"
    if kind == "literal_error":
        choices = re.findall(r"'(\w+)'", str(first.get("ctx", {}).get("expected")))
        near = nearest(str(first["input"]), choices).partition("; known")[0]
        return f"{field}: unknown {got}; one of {', '.join(choices)}{near}"
    if kind == "bool_type":
        return f"{field}: must be true or false, got {got}"
    if kind.startswith("string"):
        return f"{field}: must be a text in quotes, got {got}"
    message = first["msg"].removeprefix("Value error, ").removeprefix("Assertion failed, ")
    below = re.match(r"[a-z\[][\w.\[\]]*: ", message)  # it names a field below the one that pydantic knows
    joint = "" if message.startswith("[") else "." if below else ": "
    return f"{field}{joint}{message}" if field else message


def _meant(loc: Sequence[int | str], root: type[BaseModel]) -> str:
    """A hint at the key meant: one misspelt, or one of another section."""
    key, known = str(loc[-1]), _keys(loc[:-1], root)
    hint = nearest(key, known)
    sections = ("move", "limits", "load", "objective", "transcription") if root is p.Problem else ()
    homes = [section for section in sections if key in _keys([section], root)]
    return f"; it belongs in [{homes[0]}]" if homes and len(loc) <= 2 else hint


def _dotted(loc: Sequence[int | str]) -> str:
    field = ""
    for part in loc:
        name = part if isinstance(part, int) or re.fullmatch(r"[\w-]{1,60}", part) else units.shown(part)
        field += f"[{name}]" if isinstance(part, int) else f".{name}" if field else str(name)
    return field


def _as_written(message: str, data: dict[str, Any]) -> str:
    """``message`` with the names that the file uses: load.mass, objective.norm."""
    field, colon, rest = message.partition(": ")
    objective = data.get("objective")
    if isinstance(objective, dict) and "terms" not in objective:
        field = field.replace("objective.terms[0]", "objective")
    for section, twins in _ALIASES.items():
        for alias, known in twins.items():
            if isinstance(data.get(section), dict) and alias in data[section]:
                field = re.sub(rf"^{section}\.{known}\b", f"{section}.{alias}", field)
    return field + colon + rest


def _keys(loc: Sequence[int | str], root: type[BaseModel]) -> list[str]:
    """The keys known at a place of ``root``, with the names that files may use for them."""
    model: Any = root
    for part in loc:
        if isinstance(part, int):
            continue
        models = [a for a in _named_in(model.model_fields[part].annotation) if isinstance(a, type)]
        model = next((m for m in models if issubclass(m, BaseModel)), None)
        if model is None:
            return []
    aliases = _ALIASES.get(str(loc[-1]), {}) if loc else {}
    extra = ["minimize", "norm", "weight"] if model is p.Objective else ["plant"] if model is p.Problem else []
    return [*model.model_fields, *aliases, *extra]


def _named_in(annotation: Any) -> Iterator[Any]:
    """An annotation and all that it is made of."""
    yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _named_in(part)


def refused(name: str, message: str) -> BadInput:
    """One printable line of at most 500 characters."""
    return BadInput(f"{_one_line(name, 110)}: {_one_line(message, 380)}")


def _one_line(text: str, most: int) -> str:
    line = " ".join("".join(c if c.isprintable() else " " for c in text[: 4 * most]).split())
    return line if len(line) <= most else f"{line[: most - 3]}..."
