"""Documented: `help` of a dataclass tells what its fields are."""

import ast
import inspect
from collections.abc import Iterator
from itertools import pairwise
from textwrap import dedent, indent
from typing import TypeVar

_Class = TypeVar("_Class", bound=type)


def documented(cls: _Class) -> _Class:
    """Add the strings under a dataclass's fields, and under those it inherits, to its ``__doc__``.

    They are read from its source when somebody asks for them.
    """
    type.__setattr__(cls, "__doc__", _Documentation(cls.__doc__ or ""))
    return cls


class _Documentation:
    def __init__(self, summary: str) -> None:
        self._summary = summary

    def __get__(self, instance: object, owner: type) -> str:
        found = {name: doc for cls in reversed(owner.__mro__) for name, doc in _field_docs(cls)}
        described = "".join(f"{name}:\n{indent(doc, '    ')}\n" for name, doc in found.items())
        summary = inspect.cleandoc(self._summary)
        return f"{summary}\n\nAttributes:\n{indent(described, '    ')}" if found else summary


def _field_docs(cls: type) -> Iterator[tuple[str, str]]:
    try:
        body = ast.parse(dedent(inspect.getsource(cls))).body
    except (OSError, TypeError):  # built in, or installed without its source
        return
    statements = body[0].body if isinstance(body[0], ast.ClassDef) else []
    for statement, doc in pairwise(statements):
        match statement, doc:
            case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(text))):
                yield name, inspect.cleandoc(text)
