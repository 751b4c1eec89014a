"""A scene's YAML file as plain data, and one line for whatever is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

try:
    import yaml
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "PyYAML is not installed, expected it: pip install 'openecho[scene]'", name="yaml"
    ) from error

from openecho.scene.units import quoted

MOST_BYTES = 2**20
"""Of a scene's file; the longest bundled one has a few kilobytes, and a file given by mistake may have any number."""

MOST_SAID = 200
"""Characters of what PyYAML says that an error quotes."""


class SceneError(ValueError):
    """A scene that can't be used: one line with the file, the key, what was found and what was expected."""


class _Loader(yaml.SafeLoader):
    """Plain data alone, and no key twice: YAML forbids it, PyYAML silently takes the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else ""
            if key.tag == "tag:yaml.org,2002:merge":
                # Merges of merges grow without limit, and a scene needs none: an alias will do.
                raise yaml.MarkedYAMLError(problem="found a merge of mappings (<<)", problem_mark=key.start_mark)
            if name in seen:
                problem = f"found the key {quoted(name)} twice"
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(name)
        return super().construct_mapping(node, deep)


def read(path: Path) -> dict[Any, Any]:
    """Read a YAML file.

    Returns
    -------
    dict
        Its mapping, not checked any further.

    Raises
    ------
    SceneError
        If there is no such file, or it is no YAML, or none with a mapping: with the line of the file.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode()
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: byte {error.start} is not UTF-8, expected a scene's YAML file") from error
    except (OSError, ValueError) as error:  # a null character in the name is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise SceneError(f"{quoted(path, MOST_SAID)}: {reason}, expected a scene's YAML file") from error
    if len(content) > MOST_BYTES:
        raise SceneError(f"{path}: more than {MOST_BYTES} bytes, expected a scene's YAML file")
    return parse(text, path)


def parse(text: str, path: Path) -> dict[Any, Any]:
    """The mapping in YAML text; `path` is what an error names."""
    try:
        data = yaml.load(text, _Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f" line {mark.line + 1}" if mark else ""
        problem = " ".join(str(error.problem or error.context).split())
        raise SceneError(f"{path}:{where} {quoted(problem, MOST_SAID)}, expected YAML") from error
    except (
        Exception
    ) as error:  # of a damaged date, number or character, or of a thousand brackets, PyYAML raises others
        problem = " ".join(str(error).split()) or type(error).__name__
        raise SceneError(f"{path}: {quoted(problem, MOST_SAID)}, expected YAML") from error
    if not isinstance(data, dict):
        raise SceneError(f"{path}: found {quoted(data)}, expected a mapping with the keys of a scene")
    return data


def dumps(data: dict[str, Any]) -> str:
    """Plain data as YAML text."""
    return str(yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120))


def explained(data: Any, problem: Mapping[str, Any]) -> str:
    """What a problem of Pydantic's is in a few words: ``key: found this, expected that``.

    Parameters
    ----------
    data : object
        What was validated.
    problem : mapping
        An entry of ``ValidationError.errors()``; of type ``scene``, with ``key`` and ``message``, where it is ours.
    """
    kind, context, found = problem["type"], problem.get("ctx", {}), quoted(problem["input"])
    key = _key(data, problem["loc"], missing=kind == "missing")
    match kind:
        case "scene":
            return _joined(key, context["key"], context["message"])
        case "missing":
            return _joined(key, "", "found nothing, expected it")
        case "union_tag_invalid":
            tags = str(context["expected_tags"]).replace("'", "")
            return _joined(key, context["discriminator"].strip("'"), f"found {quoted(context['tag'])}, expected {tags}")
        case "union_tag_not_found":
            return _joined(key, context["discriminator"].strip("'"), "found nothing, expected it")
        case "too_long":
            return _joined(key, "", f"found {context['actual_length']} values, expected {context['max_length']}")
        case "literal_error":
            return _joined(key, "", f"found {found}, expected {str(context['expected']).replace(chr(39), '')}")
    expected = {"string": "a text", "list": "a list", "tuple": "a list", "invalid": "a text for a key"}
    return _joined(key, "", f"found {found}, expected {expected.get(kind.split('_')[0], 'a mapping')}")


def _joined(key: str, last: str, message: str) -> str:
    return f"{'.'.join(part for part in (key, last) if part)}: {message}".removeprefix(": ")


def _key(data: Any, location: Sequence[int | str], missing: bool) -> str:
    """Where it is, as ``targets[0].height``, without the names of kinds that Pydantic puts between."""
    key, here = "", data
    for i, part in enumerate(location):
        if isinstance(part, int) and isinstance(here, list) and part < len(here):
            key += f"[{part}]"
            here = here[part]
        elif isinstance(here, dict) and part in here:
            key += f".{quoted(part)}"
            here = here[part]
        elif missing and i == len(location) - 1:
            key += f"[{part}]" if isinstance(part, int) else f".{part}"
    return key.removeprefix(".")
