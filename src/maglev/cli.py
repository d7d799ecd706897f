"""The command line: one command per stage and per figure; no arithmetic.

A user's mistake ends with one sentence on standard error and exit code 2 (the command line or the
configuration) or 1 (anything found later).
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import click

from maglev.figures import FIGURES

_File = click.Path(path_type=Path)
_config = click.option(
    "--config",
    "configs",
    type=_File,
    multiple=True,
    required=True,
    help="Configuration file; given again, later files overlay earlier ones.",
)
_out = click.option("--out", type=_File, required=True, help="NetCDF file to write.")


class _Commands(click.Group):
    """A group whose commands end a user's mistake with one sentence rather than a traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (ValueError, FileNotFoundError) as error:
            if ctx.params["traceback"]:
                raise
            from maglev.config import ConfigError

            failure = click.ClickException(" ".join(str(error).split()))
            failure.exit_code = 2 if isinstance(error, ConfigError) else 1
            raise failure from error


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
@click.argument("what", type=click.Choice(["config", "schema", "parameters", "datasets"]))
def describe(what: str) -> None:
    """Print the default configuration, its schema, or the tables of parameters or of files."""
    from maglev import catalogue

    texts = {
        "config": catalogue.default_config,
        "schema": catalogue.schema,
        "parameters": catalogue.parameter_tables,
        "datasets": catalogue.dataset_tables,
    }
    click.echo(texts[what](), nl=False)


@main.command()
@_config
@_out
def irregularity(configs: tuple[Path, ...], out: Path) -> None:
    """Draw or read the track irregularity and estimate its spectra."""
    from maglev.config import load_config
    from maglev.stages import irregularity, save

    parameters = load_config(*configs)
    profile = parameters.irregularity.profile_file
    inputs = {"profile": profile} if profile else {}
    save(irregularity.dataset(parameters), out, "irregularity", parameters, inputs)


@main.command()
@_config
@_out
def modes(configs: tuple[Path, ...], out: Path) -> None:
    """Compute the natural modes of the guideway."""
    from maglev.config import load_config
    from maglev.stages import modes, save

    parameters = load_config(*configs)
    inputs = {"measurements": parameters.validation.measurements}
    save(modes.dataset(parameters), out, "modes", parameters, inputs)


@main.command()
@_config
@_out
def passage(configs: tuple[Path, ...], out: Path) -> None:
    """Compute one passage at the mean gains, with its histories."""
    from maglev.config import load_config
    from maglev.stages import passage, save

    parameters = load_config(*configs)
    profile = parameters.irregularity.profile_file
    inputs = {"profile": profile} if profile else {}
    save(passage.dataset(parameters), out, "passage", parameters, inputs)


@main.command()
@_config
@click.option("--passage", type=_File, required=True, help="File of the passage stage.")
@_out
def deflection(configs: tuple[Path, ...], passage: Path, out: Path) -> None:
    """Take the midspan deflection from a passage and add that under a moving uniform load."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import deflection, save

    parameters = load_config(*configs)
    result = deflection.dataset(parameters, datasets.read(passage, "passage"))
    save(result, out, "deflection", parameters, {"passage": passage})


@main.command("dynamic-factor")
@_config
@click.option("--store", type=_File, required=True, help="Folder that keeps the passages.")
@click.option("--threads", type=click.IntRange(1), default=1, help="Passages at the same time.")
@_out
def dynamic_factor(configs: tuple[Path, ...], store: Path, threads: int, out: Path) -> None:
    """Compute passages over a range of speeds, or go on with a sweep that was stopped."""
    from maglev.config import load_config
    from maglev.stages import dynamic_factor, save

    parameters = load_config(*configs)
    inputs = {"measurements": parameters.validation.measurements}
    profile = parameters.irregularity.profile_file
    if profile:
        inputs["profile"] = profile
    result = dynamic_factor.dataset(parameters, store, threads)
    save(result, out, "dynamic_factor", parameters, inputs)


@main.command()
@click.argument("name", type=click.Choice(list(FIGURES)))
@click.argument("data", type=_File, nargs=-1, required=True)
@click.option("--out", type=_File, required=True, help="File name without its ending.")
def figure(name: str, data: tuple[Path, ...], out: Path) -> None:
    """Draw a figure from DATA: PNG, PDF, and the numbers in it as NetCDF."""
    from maglev.figures import draw

    draw(name, data, out)
