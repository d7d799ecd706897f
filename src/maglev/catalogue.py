"""Configuration file, schema and documents, written from the tables of parameters and variables.

Everything here is made from `maglev.parameters` and `maglev.datasets`; the files in the repository
are written by ``maglev describe`` and a test compares them.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from types import UnionType
from typing import Any, get_args, get_origin

import yaml
from pydantic import TypeAdapter
from pydantic.fields import FieldInfo

from maglev.datasets import CONVENTIONS, LAYOUTS, TEXT, VARIABLES, Variable
from maglev.parameters import CONFIDENCE, SOURCES, Config, Law, Parameters
from maglev.stage import flag, stages, summaries
from maglev.vocabulary import METHODS

LINE = 100

_BY_COMMAND = "Written by `maglev describe {what}`; edit the classes in src/maglev, not this file."


def _number(value: float) -> str:
    """The shortest decimal that reads back as the same number, such as ``1e7`` or ``39000``."""
    text = f"{value:.6g}"
    text = text if float(text) == value else repr(value)
    return re.sub(r"e\+?(-?)0*(\d)", r"e\1\2", text)


def _written(field: FieldInfo, value: Any) -> Any:
    """A value with its unit as a configuration file states it, in the unit of the default."""
    extra = _extra(field)
    if value is None or not extra.get("unit"):
        return list(value) if isinstance(value, tuple) else value
    if "written" in extra and value == field.default:
        return extra["written"]
    return f"{_number(value)} {extra['unit']}"


def _sections(field: FieldInfo) -> tuple[type[Parameters], ...]:
    """Parameter classes that a field can hold; empty for a plain value."""
    annotation = field.annotation
    members = get_args(annotation) if isinstance(annotation, UnionType) else (annotation,)
    return tuple(m for m in members if isinstance(m, type) and issubclass(m, Parameters))


def _named_section(field: FieldInfo) -> type[Parameters] | None:
    """Parameter class of a field that maps names to sections; None for any other field."""
    if get_origin(field.annotation) is not Mapping:
        return None
    section = get_args(field.annotation)[1]
    return section if isinstance(section, type) and issubclass(section, Parameters) else None


def _extra(field: FieldInfo) -> dict[str, Any]:
    return field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}


def _origins(field: FieldInfo) -> dict[str, tuple[str, str]]:
    """Source and confidence of single values, where the field of a section states them."""
    return _extra(field).get("origins", {})


def _tag(origin: tuple[str, str] | None) -> str:
    """Source and confidence, such as ``[P; high]``; empty for a setting without a source."""
    return f"[{origin[0]}; {CONFIDENCE[origin[1]]}]" if origin else ""


def _origin(name: str, field: FieldInfo, origins: dict[str, tuple[str, str]]) -> Any:
    extra = _extra(field)
    return origins.get(name, (extra["source"], extra["confidence"]) if "source" in extra else None)


def _summary(model: type[Parameters]) -> str:
    return (model.__doc__ or "").strip().splitlines()[0]


def _yaml_value(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000)
    text = text.removesuffix("\n").removesuffix("\n...")
    return text[1:-1] if re.fullmatch(r"'[-+0-9.e]+ [^':#]+'", text) else text


def _commented(line: str, comment: str, pad: str) -> list[str]:
    """A line with its comment behind it, or above it where the line would become too long."""
    if not comment:
        return [line]
    if len(line) + len(comment) + 4 <= LINE:
        return [f"{line}  # {comment}"]
    first, later = f"{pad}# ", f"{pad}#   "
    above = textwrap.wrap(comment, LINE, initial_indent=first, subsequent_indent=later)
    return [*above, line]


def _config_lines(
    parameters: Parameters, origins: dict[str, tuple[str, str]], indent: int = 0
) -> Iterator[str]:
    pad = "  " * indent
    for name, field in type(parameters).model_fields.items():
        value = getattr(parameters, name)
        if isinstance(value, Parameters):
            if indent == 0:
                yield ""
            yield from _commented(f"{pad}{name}:", _summary(type(value)), pad)
            yield from _config_lines(value, _origins(field), indent + 1)
        elif isinstance(value, Mapping) and _named_section(field) is Law:
            yield from _commented(f"{pad}{name}:", field.description or "", pad)
            for key, law in value.items():
                yield f"{pad}  {key}: {_yaml_value(law.quantities())}"
        elif isinstance(value, Mapping) and _named_section(field) is not None:
            yield ""
            yield from _commented(f"{pad}{name}:", field.description or "", pad)
            for k, (key, section) in enumerate(value.items()):
                yield from _commented(f"{pad}  {key}:", "" if k else _summary(type(section)), pad)
                for line in _config_lines(section, {}, indent + 2):
                    if not k:  # what the keys mean stands at the first
                        yield line
                    elif not line.lstrip().startswith("#"):
                        yield line.split("  # ")[0]
        else:
            words = (_tag(_origin(name, field, origins)), field.description)
            line = f"{pad}{name}: {_yaml_value(_written(field, value))}"
            yield from _commented(line, " ".join(filter(None, words)), pad)


def default_config() -> str:
    """The configuration file with every default, its unit, source, confidence and meaning."""
    letters = [
        line
        for letter, meaning in SOURCES.items()
        for line in textwrap.wrap(f"#   {letter}: {meaning}", LINE, subsequent_indent="#      ")
    ]
    head = [
        "# Everything the results are made of: replace a value by a better one and run again.",
        "# A quantity carries its unit; any unit that converts will do.  A key left out keeps its",
        "# default, which is the value written here.",
        f"# {_BY_COMMAND.format(what='config')}",
        "#",
        "# [source; confidence] of each value:",
        *letters,
        "",
    ]
    return "\n".join([*head, *_config_lines(Config(), {})]) + "\n"


def _field_schema(field: FieldInfo, value: Any, origin: Any) -> dict[str, Any]:
    described = {"description": " ".join(filter(None, (field.description, _tag(origin))))}
    if _extra(field).get("unit"):
        optional = type(None) in get_args(field.annotation)
        return {
            **described,
            "type": ["string", "null"] if optional else "string",
            "pattern": r"^\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*\S",
            "default": _written(field, value),
        }
    plain = TypeAdapter(field.rebuild_annotation()).json_schema()
    if "anyOf" in plain:
        plain = {"type": [member["type"] for member in plain["anyOf"]]}
    return {**described, **plain, "default": _written(field, value)}


def _object_schema(
    model: type[Parameters],
    parameters: Parameters | None,
    origins: dict[str, tuple[str, str]],
) -> dict[str, Any]:
    properties: dict[str, Any] = {}
    for name, field in model.model_fields.items():
        value = field.default if parameters is None else getattr(parameters, name)
        sections = _sections(field)
        named = _named_section(field)
        if named is not None:
            one = {"oneOf": [_object_schema(named, None, {}), {"type": "null"}]}
            properties[name] = {
                "type": "object",
                "description": field.description,
                "additionalProperties": False,
                "properties": {},
                "patternProperties": {str(_extra(field)["names"]): one},
            }
        elif len(sections) == 1:
            properties[name] = _object_schema(sections[0], value, _origins(field))
        elif sections:
            properties[name] = {
                "description": field.description,
                "oneOf": [
                    _object_schema(section, value if isinstance(value, section) else None, {})
                    for section in sections
                ],
                "default": value.quantities(),
            }
        else:
            properties[name] = _field_schema(field, value, _origin(name, field, origins))
            if field.is_required():
                del properties[name]["default"]
    required = [name for name, field in model.model_fields.items() if field.is_required()]
    return {
        "type": "object",
        "description": _summary(model),
        "additionalProperties": False,
        **({"required": required} if required else {}),
        "properties": properties,
    }


def schema() -> str:
    """The JSON schema of the configuration, as YAML."""
    whole = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Configuration of maglev",
        **_object_schema(Config, Config(), {}),
    }
    whole["properties"]["extends"] = {
        "type": "string",
        "description": "configuration file that this one is laid over, relative to this one",
    }
    text = yaml.safe_dump(whole, sort_keys=False, allow_unicode=True, width=LINE)
    return f"# {_BY_COMMAND.format(what='schema')}\n{text}"


def _parameter_rows(
    parameters: Parameters, origins: dict[str, tuple[str, str]], path: str
) -> Iterator[str]:
    nested = []
    rows = []
    for name, field in type(parameters).model_fields.items():
        value = getattr(parameters, name)
        if isinstance(value, Parameters):
            nested.append((f"{path}.{name}" if path else name, value, _origins(field)))
            continue
        named = _named_section(field)
        if named is not None:
            nested.append((f"{name}.<name>", named.model_construct(), {}))
            shown = ", ".join(f"`{key}`" for key in value)
            rows.append(f"| `{name}` | {shown} | {field.description} |  |  |")
            continue
        source, confidence = _origin(name, field, origins) or ("", "")
        shown = _yaml_value(_written(field, value))
        rows.append(
            f"| `{name}` | {shown} | {field.description or ''} | "
            f"{source} | {CONFIDENCE.get(confidence, '')} |"
        )
    yield f"## {f'`{path}`' if path else 'Top level'}"
    yield ""
    yield _summary(type(parameters))
    yield ""
    if rows:
        yield "| key | default | meaning | source | confidence |"
        yield "| --- | --- | --- | --- | --- |"
        yield from rows
        yield ""
    for inner, value, inner_origins in nested:
        yield from _parameter_rows(value, inner_origins, inner)


def parameter_tables() -> str:
    """The document of all parameters, one table a section."""
    lines = [
        "# Parameters",
        "",
        f"<!-- {_BY_COMMAND.format(what='parameters')} -->",
        "",
        "Every key of the configuration, with its default, its meaning, and how far it can be "
        "trusted. Sources:",
        "",
        *(f"- **{letter}**: {meaning}" for letter, meaning in SOURCES.items()),
        "",
        *_parameter_rows(Config(), {}, ""),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _variable_row(name: str, variable: Variable) -> str:
    meaning = variable.long_name
    if variable.flags is not None:
        meaning += ": " + ", ".join(f"{key} {word}" for key, word in variable.flags.items())
    dims = ", ".join(variable.dims) or "(none)"
    unit = "" if variable.flags is not None or variable.dtype == TEXT else variable.units
    return f"| `{name}` | {dims} | {unit} | {meaning} | {variable.dtype} |"


def dataset_tables() -> str:
    """The document of all files, one table a layout."""
    lines = [
        "# Files",
        "",
        f"<!-- {_BY_COMMAND.format(what='datasets')} -->",
        "",
        f"NetCDF-4 files under the {CONVENTIONS} conventions. Each carries as global attributes "
        "its title, source with version, references, the part of the configuration it depends on "
        "(`config`, JSON with units), the fingerprint of the code (`code`), the seed where "
        "something is random, and the hashes of the files it was made from (`input_…`). Axes: x "
        "along travel, y to the right, z down.",
        "",
    ]
    header = [
        "| variable | dimensions | unit | meaning | type |",
        "| --- | --- | --- | --- | --- |",
    ]
    used: set[str] = set()
    for name, layout in LAYOUTS.items():
        lines += [f"## `{name}`", "", layout.title + ".", "", *header]
        for variable in (*layout.variables, *layout.optional):
            row = _variable_row(variable, layout.variable(variable))
            if variable in layout.optional:
                row = row.replace("` |", "` (if asked) |", 1)
            lines.append(row)
            used.update((variable, *layout.variable(variable).dims))
        lines.append("")
    coordinates = [name for name in VARIABLES if VARIABLES[name].dims == (name,)]
    lines += ["## Coordinates", "", *header]
    lines += [_variable_row(name, VARIABLES[name]) for name in coordinates if name in used]
    return "\n".join(lines).rstrip() + "\n"


def stage_tables() -> str:
    """The document of all stages: inputs, keys of the configuration, output and command of each."""
    lines = [
        "# Stages",
        "",
        f"<!-- {_BY_COMMAND.format(what='stages')} -->",
        "",
        "Each stage is a command, a rule of the workflow of the same name, and one kind of file. "
        "It computes with a view of the configuration that refuses every key not named here; a "
        "change of any other key leaves its file as it is. `demonstration` is read by all.",
        "",
    ]
    words = summaries()
    for name, stage in stages().items():
        lines += [f"## `{name}`", "", words[name], ""]
        once = {"run": "run", "case": "case", "method": "case and method"}[stage.of]
        of = f" ({', '.join(stage.methods)})" if stage.methods != METHODS else ""
        lines += [f"One file a {once}{of}, layout [`{stage.layout}`](datasets.md).", ""]
        reads = ", ".join(f"`{key}`" for key in stage.reads) or "nothing"
        lines += [f"Reads {reads}.", ""]
        if stage.inputs:
            lines += ["| input | layout | one for each | methods |", "| --- | --- | --- | --- |"]
            for role, one in stage.inputs.items():
                methods = ", ".join(one.methods) if one.methods != METHODS else ""
                may = " (if there is one)" if one.optional else ""
                by = " and ".join(one.by)
                lines.append(f"| `{role}`{may} | `{one.layout}` | {by} | {methods} |")
            lines.append("")
        options = " ".join(f"{flag(option)} …" for option in stage.options)
        lines += ["```", *textwrap.wrap(f"maglev {stage.command} {options}", LINE), "```", ""]
    return "\n".join(lines).rstrip() + "\n"
