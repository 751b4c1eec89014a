"""A schema in words: every key with what is to be written, its default and its meaning."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from textwrap import wrap
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from openecho.scene.fields import File, Flag, OnOff, Quantity, Whole

WIDTH = 100
"""Columns of a line."""


def lines(section: type[BaseModel], indent: str = "", told: set[str] | None = None) -> Iterator[str]:
    """Yield the lines of a section's keys: ``key: (what is to be written) [default] meaning``.

    Parameters
    ----------
    section : type of BaseModel
        Its keys' meanings are their descriptions; those of a section within it may be its docstring.
    indent : str, optional
        Before each line.
    told : set of str, optional
        Sections that need not be told again.
    """
    told = set() if told is None else told
    own = [name for name in section.model_fields if name in section.__annotations__]
    for name in [*own, *(name for name in section.model_fields if name not in own)]:
        field = section.model_fields[name]
        parts = list(_parts(field.annotation, field.metadata))
        nested = [part for part in parts if isinstance(part, type) and issubclass(part, BaseModel)]
        what = "" if nested else f"({_written(field.annotation, parts)})"
        meaning = field.description or "".join(summary(part) for part in nested)
        known = "as above" if nested and nested[0].__name__ in told else ""
        words = [f"{name}:", what, _state(field, parts), meaning, known and f"({known})"]
        yield from wrap(
            " ".join(word for word in words if word), WIDTH, initial_indent=indent, subsequent_indent=f"{indent}    "
        )
        for part in nested if not known else ():
            told.add(part.__name__)
            if len(nested) > 1:
                comment = f"{indent}  # "
                yield from wrap(summary(part), WIDTH, initial_indent=comment, subsequent_indent=comment)
            yield from lines(part, f"{indent}  ", told)


def _state(field: FieldInfo, parts: list[Any]) -> str:
    """In brackets what a key is if it is left out; nothing if it can't be."""
    if field.is_required():
        return ""
    said = field.default not in (None, "") and not isinstance(field.default, BaseModel)
    return f"[{_shown(field.default, parts) if said else 'optional'}]"


def _parts(annotation: Any, metadata: Iterable[Any] = ()) -> Iterator[Any]:
    """Markers and sections in an annotation, in order."""
    yield from metadata
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        yield from _parts(inner, more)
    elif get_args(annotation) and get_origin(annotation) is not Literal:
        for part in get_args(annotation):
            yield from _parts(part)
    else:
        yield annotation


def _written(annotation: Any, parts: list[Any]) -> str:
    """What is to be written for a key, in words."""
    texts = [part.text for part in parts if isinstance(part, (Quantity, Whole, File, Flag, OnOff))]
    texts += [" | ".join(get_args(part)) for part in parts if get_origin(part) is Literal]
    return f"[{', '.join(texts)}]" if get_origin(annotation) is tuple or len(texts) > 1 else (texts or ["text"])[0]


def _shown(default: Any, parts: list[Any]) -> str:
    """A default as it may be written."""
    markers = [part for part in parts if isinstance(part, Quantity)]
    if isinstance(default, tuple):
        return f"[{', '.join(marker.short(value) for marker, value in zip(markers, default, strict=True))}]"
    if isinstance(default, bool):
        return "on" if default else "off"
    return markers[0].short(default) if markers else str(default)


def summary(section: type[BaseModel]) -> str:
    """A section's docstring on one line."""
    return " ".join((section.__doc__ or "").split())
