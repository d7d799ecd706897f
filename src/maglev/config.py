"""From configuration files to parameters: read, overlay, check, with one sentence for a mistake.

A configuration file says only what differs from the defaults, or from the file that its key
``extends`` names.  Later files overlay earlier ones, key by key.
"""

from __future__ import annotations

import csv
import difflib
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin

import yaml
from pydantic import ValidationError
from pydantic_core import ErrorDetails

from maglev.errors import ConfigError
from maglev.parameters import Config, Parameters


class _UniqueKeys(yaml.SafeLoader):
    """A safe loader that refuses a duplicate key; plain YAML keeps the last one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key '{key}' stands twice", problem_mark=key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML file whose top level is a mapping.

    Raises
    ------
    ConfigError
        If there is no such file, it is not YAML, a key stands twice, or the top level is no
        mapping.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "fast.yaml"
    ...     _ = path.write_text("passage: {speed: 500 km/h}")
    ...     read_yaml(path)
    {'passage': {'speed': '500 km/h'}}
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {(error.strerror or '').lower()}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path} is not a text file in UTF-8") from error
    try:
        mapping = yaml.load(text, Loader=_UniqueKeys)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigError(f"{path}{where}: {error.problem}") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path} is not YAML: {' '.join(str(error).split())}") from error
    if mapping is None:
        return {}
    if not isinstance(mapping, dict):
        raise ConfigError(f"{path} must hold keys and values, got {_shown(mapping)}")
    return mapping


def overlay(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Lay one nested mapping over another, key by key; neither is changed.

    A spectrum of another law replaces the one below it as a whole, and so does a limit state that
    says all of itself: a response with its limit, or what it joins.

    Examples
    --------
    >>> overlay({"passage": {"speed": "430 km/h"}}, {"passage": {"approach": "50 m"}})
    {'passage': {'speed': '430 km/h', 'approach': '50 m'}}
    """
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        if isinstance(below, Mapping) and isinstance(value, Mapping):
            same_law = value.get("law", below.get("law")) == below.get("law")
            whole = not same_law or _is_limit_state(value)
            merged[key] = dict(value) if whole else overlay(below, value)
        else:
            merged[key] = value
    return merged


def _is_limit_state(value: Mapping[str, Any]) -> bool:
    """Whether keys and values say all of a limit state."""
    return {"response", "limit"} <= set(value) or bool({"any_of", "all_of"} & set(value))


def _file_keys(model: type[Parameters], path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the path of every key that names a file."""
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Parameters):
            yield from _file_keys(field.annotation, (*path, name))
        elif isinstance(field.json_schema_extra, dict) and field.json_schema_extra.get("file"):
            yield (*path, name)


def _files_of_laws(mapping: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """Yield the path of every key of a random quantity that can name a file."""
    cases = mapping.get("cases")
    for name, case in cases.items() if isinstance(cases, Mapping) else ():
        random = case.get("random") if isinstance(case, Mapping) else None
        for key in random if isinstance(random, Mapping) else ():
            yield ("cases", name, "random", key, "file")


def named_files(mapping: Mapping[str, Any]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the path of every key of the mapping that names a file, and the name.

    Examples
    --------
    >>> list(named_files({"irregularity": {"profile_file": "track.csv"}}))
    [(('irregularity', 'profile_file'), 'track.csv')]
    """
    for path in (*_file_keys(Config), *_files_of_laws(mapping)):
        value: Any = mapping
        for part in path:
            value = value.get(part) if isinstance(value, Mapping) else None
        if isinstance(value, str):
            yield path, value


def rebase(mapping: Mapping[str, Any], *, old: str | Path, new: str | Path) -> dict[str, Any]:
    """Rewrite file names that are relative to the directory ``old`` as relative to ``new``.

    Examples
    --------
    >>> rebase({"irregularity": {"profile_file": "track.csv"}}, old="data", new=".")
    {'irregularity': {'profile_file': 'data/track.csv'}}
    """
    rebased = dict(mapping)
    for path, name in named_files(mapping):
        nested: Any = name if os.path.isabs(name) else os.path.relpath(os.path.join(old, name), new)
        for part in reversed(path):
            nested = {part: nested}
        rebased = overlay(rebased, nested)
    return rebased


def read_overlays(path: str | Path, above: tuple[Path, ...] = ()) -> dict[str, Any]:
    """Read a configuration file laid over the files it extends.

    File names in it become relative to the current directory.

    Raises
    ------
    ConfigError
        As `read_yaml`, or if files extend each other in a circle.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = (Path(folder) / "base.yaml").write_text("{seed: 1, run: base}")
    ...     path = Path(folder) / "other.yaml"
    ...     _ = path.write_text("{extends: base.yaml, seed: 2}")
    ...     read_overlays(path)
    {'seed': 2, 'run': 'base'}
    """
    path = Path(path)
    if path.resolve() in above:
        raise ConfigError(f"{path} extends itself")
    mapping = rebase(read_yaml(path), old=path.parent, new=".")
    base = mapping.pop("extends", None)
    if base is None:
        return mapping
    if not isinstance(base, str):
        raise ConfigError(f"extends must be the name of a file, got {_shown(base)}")
    return overlay(read_overlays(path.parent / base, (*above, path.resolve())), mapping)


def from_mapping(mapping: Mapping[str, Any]) -> Config:
    """Build the parameters from nested keys and values, laid over the defaults.

    Parameters
    ----------
    mapping
        As a configuration file holds it; names of files are relative to the current directory.

    Raises
    ------
    ConfigError
        If a key is unknown, a value is of the wrong kind, unit or range, values do not fit each
        other, or a file that is named does not exist.

    Examples
    --------
    >>> from_mapping({"passage": {"speed": "360 km/h"}}).passage.speed
    100.0
    """
    whole = overlay(Config().quantities(), mapping)
    for path, name in named_files(mapping):
        if not Path(name).is_file():
            raise ConfigError(f"{'.'.join(path)} names a file that does not exist: {name}")
        if path[-1] == "file":  # the values of a sample stand in place of its file
            nested: Any = {"file": None, "values": sample_values(name)}
            for part in reversed(path[:-1]):
                nested = {part: nested}
            whole = overlay(whole, nested)
    config: Config = validated(Config, whole)
    return config


def sample_values(path: str | Path) -> list[str | float]:
    """Values of a sample from the first column of a CSV file, with the unit of its heading.

    Parameters
    ----------
    path
        A heading such as ``mass [t]``, or ``ratio`` for a pure number, then a number a line.

    Returns
    -------
    values
        As a configuration file writes them.

    Raises
    ------
    ConfigError
        If there is no heading, or a line begins with something else than a finite number.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "masses.csv"
    ...     _ = path.write_text("mass [t]\\n29.5\\n31\\n")
    ...     sample_values(path)
    ['29.5 t', '31.0 t']
    """
    with Path(path).open(encoding="utf-8-sig", newline="") as stream:
        rows = [row for row in csv.reader(stream) if row and any(cell.strip() for cell in row)]
    heading = rows[0][0].strip() if rows else ""
    found = re.fullmatch(r"[^\[\]]*[^\W\d][^\[\]]*(\[(?P<unit>[^\[\]]+)\])?", heading)
    if found is None:
        raise ConfigError(f"{path}, line 1: expected a heading such as 'mass [t]', got '{heading}'")
    unit = (found["unit"] or "").strip()
    values: list[str | float] = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            value = float(row[0])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise ConfigError(f"{path}, line {number}: expected a number, got '{row[0]}'")
        values.append(f"{value!r} {unit}" if unit and unit != "-" else value)
    return values


def validated(model: type[Any], mapping: Mapping[str, Any]) -> Any:
    """Build a parameter class; the first mistake becomes a `ConfigError` of one sentence.

    Examples
    --------
    >>> from maglev.parameters import Pier
    >>> validated(Pier, {"height": "12 m"}).height
    12.0
    """
    try:
        return model.model_validate(mapping)
    except ValidationError as error:
        raise ConfigError(_sentence(model, mapping, error.errors()[0])) from error


def load_config(*paths: str | Path) -> Config:
    """Read a configuration: the defaults, and each file in turn laid over them.

    Parameters
    ----------
    paths
        YAML files; later ones overlay earlier ones.  A file may itself name one that it
        ``extends``.  None at all gives the defaults.

    Returns
    -------
    config
        All parameters, in SI.  Names of files are relative to the current directory.

    Raises
    ------
    ConfigError
        If a file cannot be read, a key is unknown, a value is of the wrong kind, unit or range,
        values do not fit each other, or a file that is named does not exist.

    Examples
    --------
    >>> load_config().guideway.n_spans  # the defaults
    5
    """
    mapping: dict[str, Any] = {}
    for path in paths:
        mapping = overlay(mapping, read_overlays(path))
    return from_mapping(mapping)


def layered(
    paths: Sequence[str | Path], over: Mapping[str, Any], lowest: str | Path
) -> dict[str, Any]:
    """Values of configuration files laid over each other, as the workflow is given them.

    Parameters
    ----------
    paths
        Files in rising order; names of files in each are relative to it.
    over
        Values that lie over all files.
    lowest
        File below all others, unless one of them says what it extends.

    Returns
    -------
    mapping
        For `from_mapping`.

    Raises
    ------
    ConfigError
        As `read_overlays`.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     low, path = Path(folder) / "low.yaml", Path(folder) / "over.yaml"
    ...     _ = low.write_text("{seed: 1, run: low}"), path.write_text("seed: 2")
    ...     layered([path], {"run": "mine"}, low)
    {'seed': 2, 'run': 'mine'}
    """
    near = [os.path.relpath(path) for path in paths]
    below = {} if any("extends" in read_yaml(path) for path in near) else read_overlays(lowest)
    for path in near:
        below = overlay(below, read_overlays(path))
    return overlay(below, over)


def config_text(mapping: Mapping[str, Any], directory: str | Path = ".") -> str:
    """Text of a configuration file in a given directory.

    Parameters
    ----------
    mapping
        All or some of the values, as `Config.quantities` gives them; names of files in it are
        relative to the current directory.
    directory
        Where the file will lie.

    Returns
    -------
    text
        YAML, from which `load_config` reads the same values again.

    Examples
    --------
    >>> print(config_text({"passage": {"speed": "360 km/h"}}), end="")
    passage:
      speed: 360 km/h
    """
    moved = rebase(mapping, old=".", new=directory)
    return yaml.safe_dump(moved, sort_keys=False, allow_unicode=True)


def _shown(value: Any) -> str:
    """A value as YAML, shortened to 60 characters."""
    text = value if isinstance(value, str) else yaml.safe_dump(value, default_flow_style=True)
    text = " ".join(text.removesuffix("...\n").split())
    text = text if len(text) <= 60 else f"{text[:57]}..."
    return f"'{text}'" if isinstance(value, str) else text


def _keys_of(model: type[Parameters], loc: Sequence[str | int]) -> tuple[str, list[str]]:
    """Return the dotted key, without the tags of unions, and the known keys beside it."""
    dotted: list[str] = []
    candidates: tuple[Any, ...] = (model,)
    named: Any = None
    for part in loc:
        tagged = [
            c
            for c in candidates
            if "law" in c.model_fields and part in get_args(c.model_fields["law"].annotation)
        ]
        if tagged:
            candidates = tuple(tagged)
            continue
        dotted.append(str(part))
        fields = [c.model_fields[part] for c in candidates if part in c.model_fields]
        annotation = fields[0].annotation if fields else named
        named = None
        if get_origin(annotation) is Mapping:  # the next part is a name, behind it a section
            named, candidates = get_args(annotation)[1], ()
            continue
        members = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
        candidates = tuple(m for m in members if isinstance(m, type) and issubclass(m, Parameters))
    return ".".join(dotted), [name for c in candidates for name in c.model_fields]


def _unit_of(model: type[Parameters], dotted: str) -> str:
    """Unit of the quantity at a dotted key, with a space before it; empty if it has none."""
    *outer, last = dotted.split(".")
    for name in outer:
        annotation = model.model_fields[name].annotation if name in model.model_fields else None
        if not (isinstance(annotation, type) and issubclass(annotation, Parameters)):
            return ""
        model = annotation
    extra = model.model_fields[last].json_schema_extra if last in model.model_fields else None
    unit = extra.get("unit") if isinstance(extra, dict) else None
    return f" {unit}" if unit else ""


_PHRASES = {
    "greater_than": "must be greater than {gt:g}{unit}",
    "greater_than_equal": "must be at least {ge:g}{unit}",
    "less_than": "must be less than {lt:g}{unit}",
    "less_than_equal": "must be at most {le:g}{unit}",
    "finite_number": "must be finite",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "string_type": "must be text",
    "string_pattern_mismatch": "must match {pattern}",
    "literal_error": "must be {expected}",
    "union_tag_invalid": "must have a law among {expected_tags}",
    "tuple_type": "must be a list",
    "model_type": "must hold keys and values",
    "model_attributes_type": "must hold keys and values",
    "dict_type": "must hold keys and values",
    "too_short": "must have at least {min_length} values",
}
"""What each kind of finding of pydantic says here, with the names of its own context."""


def _sentence(model: type[Parameters], mapping: Mapping[str, Any], error: ErrorDetails) -> str:
    """Turn one finding of pydantic into a sentence with the dotted key and the value as written."""
    kind, loc, context = error["type"], error["loc"], error.get("ctx", {})
    dotted, known = _keys_of(model, loc)
    if kind == "value_error":  # our own words, which begin with the key inside its section
        return f"{dotted}.{context['error']}" if dotted else str(context["error"])
    if kind == "missing":
        return f"{dotted} is missing"
    if kind == "extra_forbidden":
        section, _, key = dotted.rpartition(".")
        _, known = _keys_of(model, loc[:-1])
        near = difflib.get_close_matches(key, known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(known)}"
        return f"{dotted} is not a known key{f' of {section}' if section else ''}; {hint}"
    value: Any = mapping
    for part in dotted.split("."):
        value = value.get(part) if isinstance(value, Mapping) else error["input"]
    phrase = _PHRASES.get(kind)
    if phrase is None:
        return f"{dotted}: {error['msg']}, got {_shown(value)}"
    return f"{dotted} {phrase.format(unit=_unit_of(model, dotted), **context)}, got {_shown(value)}"
