"""Build the site into build/docs/html: run the notebooks, then Sphinx, whose warnings are errors.

python -m docs.build            with the notebooks run
python -m docs.build --plain    with the notebooks as they are, which is quick
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from sphinx.cmd.build import main as sphinx

ROOT = Path(__file__).parents[1]


def main(arguments: list[str] | None = None) -> int:
    """0 when the site is built without a warning."""
    parser = argparse.ArgumentParser(prog="python -m docs.build", description=__doc__.splitlines()[0])
    parser.add_argument("--plain", action="store_true", help="do not run the notebooks")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "docs")
    options = parser.parse_args(arguments)
    source, site = options.output / "source", options.output / "html"
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(ROOT / "docs", source, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"):
        shutil.copy(ROOT / name, source / f"{name.lower()}.txt")
    (source / "notebooks").mkdir()
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        if not options.plain:
            print(f"running {path.name}", flush=True)
            with tempfile.TemporaryDirectory() as folder:
                NotebookClient(notebook, timeout=600, resources={"metadata": {"path": folder}}).execute()
        nbformat.write(notebook, source / "notebooks" / path.name)
    return int(sphinx(["-W", "--keep-going", "-q", "-b", "html", str(source), str(site)]))


if __name__ == "__main__":
    raise SystemExit(main())
