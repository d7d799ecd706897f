"""The command line: one command per stage and per figure; no arithmetic.

The command of a stage follows from its declaration.  A user's mistake ends with one sentence on
standard error and exit code 2 (the command line or the configuration) or 1 (anything found later).
Any other exception is a fault of the program and shows its traceback.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from maglev.errors import ConfigError, UserError
from maglev.figures import FIGURES

if TYPE_CHECKING:
    from maglev.stage import Stage

_File = click.Path(path_type=Path)


class _BadConfiguration(click.ClickException):
    """A mistake in the configuration; its exit code is that of a mistake on the command line."""

    exit_code = 2


class _Commands(click.Group):
    """All commands, those of stages made when first used; a user's mistake ends in one sentence."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        from maglev.stage import summaries

        return sorted({*self.commands, *(name.replace("_", "-") for name in summaries())})

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        from maglev.stage import named, summary

        if name in self.commands:
            return self.commands[name]
        module = name.replace("-", "_")
        return None if "_" in name or summary(module) is None else _command(named(module))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List each command on one line without importing any stage."""
        from maglev.stage import summaries

        lines = {name: one.get_short_help_str(100) for name, one in self.commands.items()}
        lines |= {name.replace("_", "-"): words for name, words in summaries().items()}
        with formatter.section("Commands"):
            formatter.write_dl(sorted(lines.items()))

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (UserError, FileNotFoundError, PermissionError) as error:
            if ctx.params["traceback"]:
                raise
            failure = _BadConfiguration if isinstance(error, ConfigError) else click.ClickException
            raise failure(_sentence(error)) from error


def _sentence(error: UserError | OSError) -> str:
    """The message on one line; for an error of the system, the file's name and the reason."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {(error.strerror or 'cannot be used').lower()}"
    return " ".join(str(error).split())


@click.group(cls=_Commands)
@click.version_option(package_name="maglev")
@click.option("--traceback", is_flag=True, help="Show where in the code a mistake was found.")
def main(traceback: bool) -> None:
    """Dynamic reliability of high-speed EMS maglev trains on guideway bridges."""
    logging.basicConfig(format="%(asctime)s %(message)s")
    logging.getLogger("maglev").setLevel(logging.INFO)


@main.command()
@click.argument("paths", type=_File, nargs=-1)
def config(paths: tuple[Path, ...]) -> None:
    """Check configuration files and print all values that result, in SI."""
    from maglev.config import config_text, load_config

    click.echo(config_text(load_config(*paths).quantities()), nl=False)


@main.command()
@click.argument("what", type=click.Choice(["config", "schema", "parameters", "datasets", "stages"]))
def describe(what: str) -> None:
    """Print the default configuration, its schema, or the tables of parameters, files or stages."""
    from maglev import catalogue

    texts = {
        "config": catalogue.default_config,
        "schema": catalogue.schema,
        "parameters": catalogue.parameter_tables,
        "datasets": catalogue.dataset_tables,
        "stages": catalogue.stage_tables,
    }
    click.echo(texts[what](), nl=False)


@main.command()
@click.argument("name", type=click.Choice(list(FIGURES)))
@click.argument("data", type=_File, nargs=-1, required=True)
@click.option("--out", type=_File, required=True, help="File name without its ending.")
def figure(name: str, data: tuple[Path, ...], out: Path) -> None:
    """Draw a figure from DATA: PNG, PDF, and the numbers in it as NetCDF."""
    from maglev.figures import draw

    draw(name, data, out)


@main.command()
@click.argument("words", nargs=-1, required=True)
def figures(words: tuple[str, ...]) -> None:
    """Draw several figures in one process: NAME OUT DATA… for each, with a + between two."""
    from itertools import groupby

    from maglev.figures import draw

    for together, group in groupby(words, key=lambda word: word != "+"):
        if not together:
            continue
        name, out, *data = [*group, "", ""]
        if name not in FIGURES:
            raise click.UsageError(f"there is no figure '{name}', known are: {', '.join(FIGURES)}")
        draw(name, [Path(one) for one in data if one], Path(out))


def _command(stage: Stage) -> click.Command:
    """Make the command of a stage from its declaration."""
    from maglev.stage import flag, summary

    def option(name: str, kind: Any, words: str, **more: Any) -> click.Option:
        settings = {"type": kind, "help": words, "required": True} | more
        return click.Option([flag(name), name], **settings)

    overlays = "Configuration file; given again, later files overlay earlier ones."
    options: list[click.Parameter] = [option("config", _File, overlays, multiple=True)]
    if stage.of != "run":
        options.append(option("case", str, "Name of the case."))
    if stage.of == "method":
        options.append(option("method", click.Choice(stage.methods), "Name of the method."))
    for role, one in stage.inputs.items():
        words = f"File of the layout '{one.layout}'."
        if one.by:
            types = (*[str] * len(one.by), _File)
            words = f"{' and '.join(one.by).capitalize()}, and file of the layout '{one.layout}'."
            options.append(option(role, types, words, multiple=True))
        else:
            always = not one.optional and set(stage.methods) <= set(one.methods)
            options.append(option(role, _File, words, required=always))
    for name, kind in stage.takes.items():
        if name == "store":
            options.append(option(name, _File, "Folder that keeps the runs."))
        elif name == "n_threads":
            positive = click.IntRange(1)
            words = "Rows run at once; MAGLEV_THREADS if not given, or 1."
            settings = {"default": 1, "envvar": "MAGLEV_THREADS", "required": False}
            options.append(option(name, positive, words, **settings))
        elif name not in ("case", "method"):
            options.append(option(name, kind, f"Which {name}."))
    options.append(option("out", _File, "NetCDF file to write."))
    return click.Command(
        stage.command, params=options, help=summary(stage.name), callback=_run(stage)
    )


def _run(stage: Stage) -> Callable[..., None]:
    """Make the function behind the command of a stage: it reads, computes and writes."""

    def run(config: tuple[Path, ...], out: Path, **given: Any) -> None:
        from maglev import datasets
        from maglev.config import load_config

        parameters = load_config(*config)
        of = {name: given[name] for name in ("case", "method") if name in given}
        view = stage.view(parameters, **of)
        files: dict[str, Any] = {}
        inputs: dict[str, Path] = {}
        for role, paths in _files(stage, given).items():
            layout = stage.inputs[role].layout
            if isinstance(paths, Path):
                files[role], inputs[role] = datasets.read(paths, layout), paths
                continue
            files[role] = {names: datasets.read(path, layout) for names, path in paths.items()}
            for names, path in paths.items():
                words = names if isinstance(names, str) else "_".join(names)
                inputs[f"{role}_{words}"] = path
        taken = {name: given[name] for name in stage.takes}
        result = stage.compute(view, **taken, **files)
        result.attrs = {**_of_track(files), **result.attrs}
        stage.write(result, out, parameters, inputs, **of)
        if stage.table is not None:
            from maglev.stages import tables

            rows, text = stage.table(datasets.read(out, stage.layout))
            tables.write(out.with_suffix(""), rows, text, demonstration=parameters.demonstration)

    return run


def _of_track(files: dict[str, Any]) -> dict[str, str]:
    """Attributes on the track of a file that is made of others, where they have them."""
    every = [
        one
        for found in files.values()
        for one in (found.values() if isinstance(found, dict) else [found])
    ]
    words = dict.fromkeys(one.attrs["track"] for one in every if "track" in one.attrs)
    return {"track": "; ".join(words)} if words else {}


def _files(stage: Stage, given: dict[str, Any]) -> dict[str, Any]:
    """Files by role; where a role has several, a mapping from their names.

    Raises
    ------
    click.UsageError
        If a file is missing, or the method does not use one that is given.
    """
    from maglev.stage import flag

    method = given.get("method")
    roles = stage.roles(method)
    found: dict[str, Any] = {}
    for role, one in stage.inputs.items():
        value = given[role]
        if role not in roles and value:
            raise click.UsageError(f"the method {method} has no use for {flag(role)}")
        if one.by:
            found[role] = {
                names[0] if len(names) == 1 else tuple(names): path for *names, path in value
            }
        elif value is not None:
            found[role] = value
        elif role in roles and not one.optional:
            raise click.UsageError(f"the method {method} needs {flag(role)}")
    return found
