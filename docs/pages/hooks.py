"""What MkDocs shows beside the pages in docs/: files of the repository, names, keys, tutorials.

Links lead from file to file of the repository, as they do there; here they become the site's.
"""

import ast
import os
import posixpath
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import notebooks
import reference
import scenario_keys
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
_HOMES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "examples/README.md": "examples/index.md",
}
"""Where the site has some files of the repository; others keep their paths below `repository/`."""

_LINK = re.compile(r"(?<=\]\()(?!https?:|#|mailto:)([^)#\s]+)")
_sources: dict[str, str] = {}  # page of the site to file of the repository


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are no files of docs/."""
    _sources.clear()
    for path in [*ROOT.glob("docs/**/*.md"), *map(ROOT.joinpath, _HOMES)]:
        _add(path, files, config)
    pages = {"keys.md": scenario_keys.page(), **reference.pages()}
    tutorials = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        shown = list(pool.map(notebooks.page, tutorials))
    for notebook, (text, pictures) in zip(tutorials, shown, strict=True):
        pages[f"tutorials/{notebook.stem}.md"] = text
        _sources[f"tutorials/{notebook.stem}.md"] = notebook.relative_to(ROOT).as_posix()
        for name, content in pictures.items():
            files.append(File.generated(config, f"tutorials/{name}", content=content))
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Lead the links of a file of the repository to where the site has what they name."""
    source = _sources.get(page.file.src_uri)
    if source is None:
        return markdown
    here = posixpath.dirname(page.file.src_uri)
    return _LINK.sub(
        lambda link: posixpath.relpath(_home(_target(source, link[1])), here or "."), markdown
    )


def on_page_content(html: str, **_: Any) -> str:
    """Add what cells show, and turn formulas to MathML, which browsers draw without a script."""

    def formula(found: re.Match[str]) -> str:
        tag, text = found[1], found[2].strip()[2:-2]
        for entity, sign in (("&lt;", "<"), ("&gt;", ">"), ("&amp;", "&")):
            text = text.replace(entity, sign)
        return str(convert(text, "block" if tag == "div" else "inline"))

    html = re.sub(r'<(span|div) class="arithmatex">(.*?)</\1>', formula, html, flags=re.DOTALL)
    return notebooks.with_shown(html)


def _add(path: Path, files: Files, config: MkDocsConfig) -> None:
    """Add a file of the repository, and those that it links to."""
    source = path.relative_to(ROOT).as_posix()
    home = _home(source)
    if home in _sources:
        return
    _sources[home] = source
    text = path.read_text(encoding="utf-8") if path.suffix in (".md", ".py") else ""
    if not source.startswith("docs/"):
        if path.suffix == ".py":
            files.append(File.generated(config, home, content=_program(path.name, text)))
        elif path.suffix == ".md":
            files.append(File.generated(config, home, content=text))
        else:
            files.append(File.generated(config, home, abs_src_path=str(path)))
    if path.suffix == ".md":
        for target in _targets(source, text):
            _add(ROOT / target, files, config)


def _targets(source: str, text: str) -> Iterator[str]:
    for link in _LINK.findall(text):
        target = _target(source, link)
        if (ROOT / target).is_file() and not target.startswith("docs/"):
            yield target


def _target(source: str, link: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(source), link))


def _home(source: str) -> str:
    """Return the page or file of the site for a file of the repository."""
    if not source.startswith(("docs/", "examples/")):
        source = _HOMES.get(source, f"repository/{source}")
    home = _HOMES.get(source, source.removeprefix("docs/"))
    return re.sub(r"\.(py|ipynb)$", ".md", home)


def _program(name: str, text: str) -> str:
    """Return the page of a program: what it says at its top, and itself."""
    said = ast.get_docstring(ast.parse(text)) or ""
    title, _, more = said.partition("\n\n")
    return f"# {name}\n\n{title}\n\n```sh\n{more}\n```\n\n```python\n{text}```\n"
