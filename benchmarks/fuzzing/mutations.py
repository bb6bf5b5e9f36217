"""Files made from real ones by mutation, and from a grammar of nested values."""

import io
import json
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

import numpy as np
from hypothesis import strategies as st

WORDS = (
    *("nan", "inf", "-inf", "1e400", "-1", "0", "1e308", "1e-320", "9" * 5000, "0x10", "1,5"),
    *("true", "null", "[]", "{}", "''", '""', "\0", "\n", "é", "a" * 5000, "[" * 3000, "{" * 3000),
    *("<a>" * 2000, "../../etc/passwd", "package://", "/dev/zero", "&a", "*a", "!!python/object"),
)
NUMBERS = st.sampled_from([np.nan, np.inf, -np.inf, 0, -1, 1e308, 1e-320, 2**70, 10**400, True])
LEAVES = st.none() | NUMBERS | st.floats() | st.integers() | st.text() | st.sampled_from(WORDS)
VALUES = st.recursive(
    LEAVES,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8,
)
DEPTHS = (10, 900, 20_000)

# Else ElementTree writes prefixes, and no reader of Collada finds a mesh.
ElementTree.register_namespace("", "http://www.collada.org/2005/11/COLLADASchema")

Draw = Callable[[Any], Any]
"""Hypothesis' draw from a strategy."""


def mutated_bytes(content: bytes, random: Random) -> bytes:
    """Cut, copy, exchange and overwrite pieces of a file."""
    data = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 5))):
        a = random.randrange(len(data) + 1)
        b = min(len(data), a + random.choice((0, 1, 2, 8, 100, 10_000)))
        piece = random.choice(
            (b"", bytes(data[a:b]) * 2, random.choice(WORDS).encode(), random.randbytes(b - a))
        )
        data[a:b] = piece
    return bytes(data)


def mutated_text(content: bytes, random: Random) -> bytes:
    """Replace words of a text file, or exchange its lines."""
    lines = content.decode("utf-8", "replace").split("\n")
    for _ in range(random.choice((1, 1, 2, 5))):
        k = random.randrange(len(lines))
        words = lines[k].split(" ")
        words[random.randrange(len(words))] = random.choice(WORDS)
        choice = random.randrange(4)
        if choice < 2:
            lines[k] = " ".join(words)
        elif choice == 2:
            lines.insert(k, random.choice(lines))
        elif len(lines) > 1:
            del lines[k]
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def mutated_value(value: Any, random: Random, draw: Draw) -> Any:
    """Return nested data with one of its entries replaced, left out or wrapped."""
    if not isinstance(value, dict | list) or not value or random.random() < 0.15:
        return f"<{random.choice(DEPTHS)} deep>" if random.random() < 0.05 else draw(VALUES)
    copy = value.copy()
    keys = list(copy) if isinstance(copy, dict) else range(len(copy))
    key = random.choice(list(keys))
    if random.random() < 0.1:
        del copy[key]
    elif isinstance(copy, dict) and random.random() < 0.1:
        copy[draw(st.text())] = draw(VALUES)
    else:
        copy[key] = mutated_value(copy[key], random, draw)
    return copy


def deepened(text: str) -> str:
    """Put nested lists where their depth stands."""
    for depth in DEPTHS:
        text = text.replace(f'"<{depth} deep>"', "[" * depth + "]" * depth)
    return text


def dumped(value: Any) -> str:
    """Return JSON."""
    return deepened(json.dumps(value))


def toml(table: dict[Any, Any]) -> str:
    """Return TOML, each entry of the file inline."""
    lines = (f"{json.dumps(str(key))} = {_toml_value(v)}" for key, v in table.items())
    return deepened("\n".join(lines))


def _toml_value(value: Any) -> str:
    if isinstance(value, dict):
        pairs = (f"{json.dumps(str(key))} = {_toml_value(item)}" for key, item in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(_toml_value, value))}]"
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return json.dumps(value)


def mutated_xml(content: bytes, random: Random) -> bytes:
    """Move, copy, drop and rename elements, and change their attributes."""
    root = ElementTree.fromstring(content)
    for _ in range(random.choice((1, 1, 2, 4))):
        parents = [element for element in root.iter() if len(element)] or [root]
        elements = list(root.iter())
        element, parent = random.choice(elements), random.choice(parents)
        choice = random.randrange(6)
        if choice == 0 and len(parent):
            parent.remove(random.choice(list(parent)))
        elif choice == 1:
            element.append(ElementTree.fromstring(ElementTree.tostring(random.choice(elements))))
        elif choice == 2:
            element.tag = random.choice(elements).tag
        elif element.attrib:
            key = random.choice(sorted(element.attrib))
            same = [e.get(key, "") for e in elements if key in e.attrib]
            value = random.choice((random.choice(WORDS), random.choice(same), ""))
            element.set(key, value.replace("\0", ""))
    text = ElementTree.tostring(root)
    if random.random() < 0.02:
        depth = random.choice(DEPTHS)
        tag = random.choice((b"a", b"node"))
        inside, end = b"<%s>" % tag * depth + b"</%s>" % tag * depth, text.rfind(b"</")
        text = text[:end] + inside + text[end:]
    return text


def mutated_npz(content: bytes, random: Random, draw: Draw) -> bytes:
    """Change arrays, their kinds and shapes, headers, or the scenario of a run's file."""
    with np.load(io.BytesIO(content), allow_pickle=False) as data:
        arrays = {name: data[name] for name in data}
    name = random.choice(list(arrays))
    choice = random.randrange(6)
    if choice == 0:
        del arrays[name]
    elif choice == 1:
        kinds = ("f4", "i8", "c16", "O", "U5", "S5", "?", "M8[s]", "f2", "V4")
        arrays[name] = np.zeros(arrays[name].shape, dtype=random.choice(kinds))
    elif choice == 2:
        shape = random.choice(((), (0,), (1,), (2, 3), (1000, 7), (3, 3, 3), (0, 7), (1, 0)))
        arrays[name] = np.zeros(shape)
    elif arrays[name].dtype.kind == "f" and arrays[name].size:
        arrays[name].flat[random.randrange(arrays[name].size)] = draw(st.floats())
    key = random.choice(("scenario", "result"))
    if choice >= 3 and key in arrays and arrays[key].dtype.kind == "U":
        value = mutated_value(json.loads(str(arrays[key])), random, draw)
        arrays[key] = np.array(dumped(value))
    file = io.BytesIO()
    np.savez(file, **arrays)
    if random.random() < 0.1:
        return enlarged_header(file.getvalue(), random)
    return file.getvalue()


def enlarged_header(content: bytes, random: Random) -> bytes:
    """Let an array's header claim more entries than the file has."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        for info in old.infolist():
            data = old.read(info)
            claim = str(10 ** random.randrange(6, 15)).encode()
            start = data.find(b"'shape': (") + len(b"'shape': (")
            end = data.find(b")", start)
            header = data[:start] + claim + b"," + data[end:]
            # The header's length is fixed: take from its padding what the claim added.
            grown = len(header) - len(data)
            new.writestr(info.filename, header.replace(b" " * grown, b"", 1) if grown > 0 else data)
    return out.getvalue()
