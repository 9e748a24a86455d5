"""The documentation: links lead somewhere, snippets run, problem files in it are valid, and the site builds."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

import norms
import trajopt
from docs.build import main as build
from trajopt import problem_file
from trajopt.cli import app

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MOVE = """
[move]
time = "1 s"
end = { position = "0.254 m" }
[limits]
velocity = ["0 m/s", "0.5 m/s"]
acceleration = "4.905 m/s^2"
jerk = "98.1 m/s^3"
[load]
mass = "10 kg"
[objective]
minimize = "power"
norm = "linf"
[transcription]
intervals = 20
"""


def blocks(*languages: str) -> list[tuple[Path, str]]:
    """(page, text) of the code blocks in some languages."""
    found = [(page, match) for page in PAGES for match in BLOCK.finditer(page.read_text())]
    return [(page, match[2]) for page, match in found if match[1] in languages]


def _anchors(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", BLOCK.sub("", page.read_text())):
        if link.startswith("https://"):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), f"{page.name} links to {link}"
        assert not anchor or anchor in _anchors(target), f"{page.name} links to {link}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_python_runs_top_to_bottom(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(norms, "_KNOWN", dict(norms._KNOWN))  # a page registers its own
    Path("move.toml").write_text(MOVE)
    Path("study.toml").write_text('problem = "move.toml"\n[grid]\n"move.time" = ["1 s", "1.2 s"]\n')
    found = [text for other, text in blocks("python") if other == page]
    names: dict[str, object] = {"trajopt": trajopt}
    if found:
        names["solution"] = trajopt.solve(trajopt.load("move.toml"))
        names["problem"] = trajopt.load("scara_throw", ["transcription.intervals=8", "search.starts=1"])
    for text in found:
        exec(compile(text, page.name, "exec"), names)


def _commands() -> list[tuple[str, list[str]]]:
    lines = [(page.name, line) for page, text in blocks("console", "sh") for line in text.splitlines()]
    shown = [(name, line.removeprefix("$ ").partition("   #")[0].strip()) for name, line in lines]
    return [(name, shlex.split(line)[1:]) for name, line in shown if line.startswith("trajopt ") and "…" not in line]


@pytest.mark.parametrize(("page", "words"), _commands(), ids=lambda x: x if isinstance(x, str) else " ".join(x)[:40])
def test_commands_have_the_options_that_they_are_shown_with(page: str, words: list[str]) -> None:
    command = get_command(app).commands[words[0]]  # type: ignore[attr-defined]
    command.make_context(words[0], words[1:])  # parses, and runs nothing


def test_problem_files_are_valid_or_parts_of_one(tmp_path: Path) -> None:
    seen = 0
    for page, text in blocks("toml"):
        if "…" in text or ".csv" in text:
            continue
        data = problem_file.read_toml(text, page.name)
        if ({"move", "objective"} <= data.keys() or "plant" in data) and "problem" not in data:
            problem_file.from_dict(data, page.name)
            seen += 1
    assert seen >= 3


def test_the_site_builds_without_a_warning(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert build(["--plain", "-o", str(tmp_path)]) == 0, capfd.readouterr().err
    for page in ("index", "keys", "commands", "api", "mathematics", "notebooks/3_pareto"):
        assert (tmp_path / "html" / f"{page}.html").stat().st_size > 5000
    keys = (tmp_path / "html" / "keys.html").read_text()
    for model in (trajopt.Move, trajopt.Limits, trajopt.Load, trajopt.Transcription):
        assert all(f">{key}<" in keys for key in model.model_fields), model
    commands = (tmp_path / "html" / "commands.html").read_text()
    assert all(f'<span class="pre">{name}</span>' in commands for name in get_command(app).commands)  # type: ignore[attr-defined]
