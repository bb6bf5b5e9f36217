"""Formulas of docstrings in the form that Markdown has them."""

import re
from typing import Any

import griffe

_INLINE = re.compile(r":math:`([^`]*)`")
_BLOCK = re.compile(r"^( *)\.\. math::(.*(?:\n(?:\1 {4}.*| *$))*)", re.MULTILINE)


class Formulas(griffe.Extension):
    """Turns directives of reStructuredText to formulas between dollars."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object that was read."""
        if obj.docstring:
            text = _BLOCK.sub(_between_dollars, obj.docstring.value)
            obj.docstring.value = _INLINE.sub(r"$\1$", text)


def _between_dollars(found: re.Match[str]) -> str:
    indent, formula = found[1], " ".join(found[2].split())
    return f"{indent}$$ {formula} $$\n"
