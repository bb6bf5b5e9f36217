"""Documented: what `help` and `repr` tell of a dataclass."""

import ast
import inspect
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from itertools import pairwise
from textwrap import dedent, indent
from typing import Any, TypeVar

_Class = TypeVar("_Class", bound=type)


def documented(cls: _Class) -> _Class:
    """Let a dataclass tell of itself, at length by `help` and in short by `repr`.

    The strings under its fields, and under those it inherits, join its ``__doc__``; they are read
    from its source when somebody asks for them. A ``__repr__`` of its own stays.
    """
    if hasattr(cls.__repr__, "__wrapped__"):  # as `dataclass` makes it, and nobody else does
        type.__setattr__(cls, "__repr__", _brief)
    type.__setattr__(cls, "__doc__", _Documentation(cls.__doc__ or ""))
    return cls


def in_short(value: Any) -> str:
    """Return a value in a few characters: an array by its shape, but a few numbers as they are."""
    if hasattr(value, "tolist"):
        if value.ndim > 1 or value.size > _FEW:
            return f"array of {'×'.join(map(str, value.shape))}"
        value = value.tolist()
    if isinstance(value, list | tuple) and all(isinstance(x, float | int) for x in value):
        text = ", ".join(f"{round(x, 12) + 0.0:.4g}" for x in value)
        return f"({text})" if isinstance(value, tuple) else f"[{text}]"
    text = " ".join(repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


_FEW, _LONGEST = 16, 60
"""Numbers, and characters, that are told as they are."""


def _brief(self: Any) -> str:
    told = [x for x in fields(self) if not _is_default(x, getattr(self, x.name))]
    pairs = (f"{x.name}={in_short(getattr(self, x.name))}" for x in told)
    return f"{type(self).__name__}({', '.join(pairs)})"


def _is_default(field: Field[Any], value: Any) -> bool:
    default = field.default
    if field.default_factory is not MISSING:
        default = field.default_factory()
    return value is default or (type(value) is type(default) and bool(value == default))


class _Documentation:
    def __init__(self, summary: str) -> None:
        self._summary = summary

    def __get__(self, instance: object, owner: type) -> str:
        found = {name: doc for cls in reversed(owner.__mro__) for name, doc in field_docs(cls)}
        described = "".join(f"{name}:\n{indent(doc, '    ')}\n" for name, doc in found.items())
        summary = inspect.cleandoc(self._summary)
        return f"{summary}\n\nAttributes:\n{indent(described, '    ')}" if found else summary


def field_docs(cls: type) -> Iterator[tuple[str, str]]:
    """Yield name and docstring of each field of a dataclass, or member of an enum."""
    try:
        body = ast.parse(dedent(inspect.getsource(cls))).body
    except (OSError, TypeError):  # built in, or installed without its source
        return
    statements = body[0].body if isinstance(body[0], ast.ClassDef) else []
    for statement, doc in pairwise(statements):
        match statement, doc:
            case (
                ast.AnnAssign(target=ast.Name(name)) | ast.Assign(targets=[ast.Name(name)]),
                ast.Expr(ast.Constant(str(text))),
            ):
                yield name, inspect.cleandoc(text)
