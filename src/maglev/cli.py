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


@main.command("train-modes")
@_config
@_out
def train_modes(configs: tuple[Path, ...], out: Path) -> None:
    """Compute the modes of one levitated car at the mean gains."""
    from maglev.config import load_config
    from maglev.stages import save, train_modes

    parameters = load_config(*configs)
    save(train_modes.dataset(parameters), out, "train_modes", parameters)


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


_case = click.option("--case", required=True, help="Name of the case.")
_store = click.option("--store", type=_File, required=True, help="Folder that keeps the runs.")
_threads = click.option("--threads", type=click.IntRange(1), default=1, help="Rows run at once.")


def _profile(parameters: Any) -> dict[str, str]:
    """The measured irregularity as an input, if there is one."""
    profile = parameters.irregularity.profile_file
    return {"profile": profile} if profile else {}


@main.command()
@_config
@_case
@click.option(
    "--set",
    "sets",
    type=(str, _File),
    multiple=True,
    required=True,
    help="Name of a point set and NetCDF file to write; may be given again.",
)
def points(configs: tuple[Path, ...], case: str, sets: tuple[tuple[str, Path], ...]) -> None:
    """Draw point sets of a case."""
    from maglev.config import load_config
    from maglev.stages import points, save

    parameters = load_config(*configs)
    for name, out in sets:
        result = points.dataset(parameters, case, name)
        save(result, out, f"points.{name}", parameters, case=case)


@main.command()
@_config
@_case
@click.option("--start", type=click.IntRange(0), required=True, help="First sample.")
@click.option("--stop", type=click.IntRange(1), required=True, help="Sample after the last.")
@_store
@_threads
@_out
def runs(
    configs: tuple[Path, ...],
    case: str,
    start: int,
    stop: int,
    store: Path,
    threads: int,
    out: Path,
) -> None:
    """Run some samples of the baseline of a case, but for those that the store holds."""
    from maglev.config import load_config
    from maglev.stages import runs, save

    parameters = load_config(*configs)
    result = runs.chunk(parameters, case, range(start, stop), store, threads)
    save(result, out, "runs", parameters, _profile(parameters), case=case)


@main.command()
@_config
@_case
@click.option("--points", "baseline", type=_File, required=True, help="Points of the baseline.")
@click.argument("chunks", type=_File, nargs=-1, required=True)
@_out
def gather(
    configs: tuple[Path, ...], case: str, baseline: Path, chunks: tuple[Path, ...], out: Path
) -> None:
    """Put the CHUNKS of a baseline together."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import runs, save

    parameters = load_config(*configs)
    points = datasets.read(baseline, "points")
    result = runs.gather(points, [datasets.read(path, "runs") for path in chunks])
    inputs = {"points": baseline, **_profile(parameters)}
    save(result, out, "runs", parameters, inputs, case=case)


@main.command("track-runs")
@_config
@_case
@click.option("--part", required=True, help="Which of the further runs.")
@_store
@_threads
@_out
def track_runs(
    configs: tuple[Path, ...], case: str, part: str, store: Path, threads: int, out: Path
) -> None:
    """Run what tells the gains' contribution from that of a random track."""
    from maglev.config import load_config
    from maglev.stages import runs, save

    parameters = load_config(*configs)
    result = runs.track_part(parameters, case, part, store, threads)
    save(result, out, "runs.track", parameters, _profile(parameters), case=case)


@main.command()
@_config
@_case
@click.option("--method", required=True, help="Name of the method.")
@click.option("--initial", type=_File, required=True, help="Points of the first design.")
@click.option("--candidates", type=_File, help="Points that rounds choose from.")
@click.option("--baseline", type=_File, help="Runs that each round is compared with.")
@_store
@_threads
@_out
def design(
    configs: tuple[Path, ...],
    case: str,
    method: str,
    initial: Path,
    candidates: Path | None,
    baseline: Path | None,
    store: Path,
    threads: int,
    out: Path,
) -> None:
    """Make a design in one stage or in rounds, or go on with one that was stopped."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import design, save

    parameters = load_config(*configs)
    inputs: dict[str, Any] = {"initial": initial, "candidates": candidates}
    points = {role: datasets.read(p, "points") for role, p in inputs.items() if p is not None}
    truth = None if baseline is None else datasets.read(baseline, "runs")
    result = design.dataset(
        parameters, case, method, points, store, baseline=truth, n_threads=threads
    )
    inputs = {**inputs, "baseline": baseline, **_profile(parameters)}
    inputs = {role: path for role, path in inputs.items() if path is not None}
    save(result, out, "design", parameters, inputs, case=case, method=method)


_method_name = click.Choice(["mcm", "osm", "asm_paper", "asm"])
_method = click.option("--method", type=_method_name, required=True, help="Name of the method.")
_design = click.option("--design", type=_File, required=True, help="File of the design stage.")
_surrogate = click.option("--surrogate", type=_File, help="File of the surrogate stage.")


@main.command()
@_config
@_case
@_method
@_design
@_out
def surrogate(configs: tuple[Path, ...], case: str, method: str, design: Path, out: Path) -> None:
    """Fit the surrogate of a design and learn where its samples are lost."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import save, surrogate

    parameters = load_config(*configs)
    result = surrogate.dataset(parameters, method, datasets.read(design, "design"))
    named = result.assign_attrs(case=case, method=method)
    save(named, out, "surrogate", parameters, {"design": design})


@main.command()
@_config
@_case
@_method
@_design
@click.option("--surrogate", type=_File, required=True, help="File of the surrogate stage.")
@click.option("--points", type=_File, required=True, help="Representative points.")
@_out
def eev(
    configs: tuple[Path, ...],
    case: str,
    method: str,
    design: Path,
    surrogate: Path,
    points: Path,
    out: Path,
) -> None:
    """Predict the extremes at the representative points."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import eev, save

    parameters = load_config(*configs)
    inputs = {"design": design, "surrogate": surrogate, "points": points}
    result = eev.dataset(parameters, *(datasets.read(p, role) for role, p in inputs.items()))
    save(result.assign_attrs(case=case, method=method), out, "eev", parameters, inputs)


@main.command()
@_config
@_case
@_method
@click.option("--runs", type=_File, help="Baseline, for the method mcm.")
@click.option("--design", type=_File, help="File of the design stage, for the others.")
@_surrogate
@click.option("--eev", type=_File, help="File of the eev stage.")
@_out
def density(
    configs: tuple[Path, ...],
    case: str,
    method: str,
    runs: Path | None,
    design: Path | None,
    surrogate: Path | None,
    eev: Path | None,
    out: Path,
) -> None:
    """Find densities and exceedance, of a baseline or of predicted extremes."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import density, save

    parameters = load_config(*configs)
    inputs = _inputs(method, {"runs": runs}, {"design": design, "surrogate": surrogate, "eev": eev})
    files = [datasets.read(path, role) for role, path in inputs.items()]
    compute = density.of_baseline if method == "mcm" else density.of_surrogate
    result = compute(parameters, *files)
    save(result.assign_attrs(case=case, method=method), out, "density", parameters, inputs)


@main.command()
@_config
@_case
@_method
@click.option("--runs", type=_File, help="Baseline, for the method mcm.")
@click.option("--design", type=_File, help="File of the design stage, for the others.")
@_surrogate
@_out
def limits(
    configs: tuple[Path, ...],
    case: str,
    method: str,
    runs: Path | None,
    design: Path | None,
    surrogate: Path | None,
    out: Path,
) -> None:
    """Read limits off a baseline or off a surrogate, with intervals."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import limits, save

    parameters = load_config(*configs)
    inputs = _inputs(method, {"runs": runs}, {"design": design, "surrogate": surrogate})
    files = [datasets.read(path, role) for role, path in inputs.items()]
    compute = limits.of_baseline if method == "mcm" else limits.of_surrogate
    result = compute(parameters, *files)
    save(result.assign_attrs(case=case, method=method), out, "limits", parameters, inputs)


def _inputs(
    method: str, of_baseline: dict[str, Path | None], of_surrogate: dict[str, Path | None]
) -> dict[str, Path]:
    """The files that the method needs, all of them and no others."""
    needed, others = (of_baseline, of_surrogate) if method == "mcm" else (of_surrogate, of_baseline)
    missing = [role for role, path in needed.items() if path is None]
    if missing:
        raise click.UsageError(f"the method {method} needs --{missing[0]}")
    unused = [role for role, path in others.items() if path is not None]
    if unused:
        raise click.UsageError(f"the method {method} has no use for --{unused[0]}")
    return {role: path for role, path in needed.items() if path is not None}


_of_method = (_method_name, _File)
_designs = click.option(
    "--design", "designs", type=_of_method, multiple=True, help="Method and file of its design."
)


@main.command()
@_config
@_case
@click.option("--baseline", type=_File, required=True, help="Baseline of the case.")
@_designs
@_out
def accuracy(
    configs: tuple[Path, ...],
    case: str,
    baseline: Path,
    designs: tuple[tuple[str, Path], ...],
    out: Path,
) -> None:
    """Judge the methods of a case by its baseline, for growing numbers of runs."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import accuracy, save

    parameters = load_config(*configs)
    read = {method: datasets.read(path, "design") for method, path in designs}
    result = accuracy.dataset(parameters, datasets.read(baseline, "runs"), read)
    inputs = {"baseline": baseline, **{f"design_{method}": path for method, path in designs}}
    save(result.assign_attrs(case=case), out, "accuracy", parameters, inputs)


@main.command("track-split")
@_config
@_case
@click.option("--baseline", type=_File, required=True, help="Runs with gains and track random.")
@click.option(
    "--part", "parts", type=(str, _File), multiple=True, help="Name and file of further runs."
)
@_out
def track_split(
    configs: tuple[Path, ...],
    case: str,
    baseline: Path,
    parts: tuple[tuple[str, Path], ...],
    out: Path,
) -> None:
    """Split what random gains and a random track contribute to the extremes."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import save, track_split

    parameters = load_config(*configs)
    read = {name: datasets.read(path, "runs") for name, path in parts}
    result = track_split.dataset(parameters, datasets.read(baseline, "runs"), read)
    inputs = {"baseline": baseline, **dict(parts)}
    save(result.assign_attrs(case=case), out, "track_split", parameters, inputs)


@main.command()
@_config
@_case
@click.option(
    "--limits", "files", type=_of_method, multiple=True, help="Method and file of its limits."
)
@click.option("--out", type=_File, required=True, help="File name without its ending.")
def table1(
    configs: tuple[Path, ...], case: str, files: tuple[tuple[str, Path], ...], out: Path
) -> None:
    """Put the limits of all methods of a case into a table: NetCDF, CSV and Markdown."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import save, table1, tables

    parameters = load_config(*configs)
    result = table1.dataset({method: datasets.read(path, "limits") for method, path in files})
    named = datasets.describe(result.assign_attrs(case=case))
    heading = f"Limits of the extremes, case '{case}'"
    tables.write(
        out, table1.rows(named), table1.text(named, heading), demonstration=parameters.demonstration
    )
    save(named, out.with_name(f"{out.name}.nc"), "table1", parameters, dict(files))


@main.command("paper-and-ours")
@_config
@_case
@click.option(
    "--density", "densities", type=_of_method, multiple=True, help="Method and file of its density."
)
@_designs
@click.option("--accuracy", type=_File, required=True, help="File of the accuracy stage.")
@click.option("--out", type=_File, required=True, help="File name without its ending.")
def paper_and_ours(
    configs: tuple[Path, ...],
    case: str,
    densities: tuple[tuple[str, Path], ...],
    designs: tuple[tuple[str, Path], ...],
    accuracy: Path,
    out: Path,
) -> None:
    """Set our numbers beside those that survive of the paper: NetCDF, CSV and Markdown."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import paper_and_ours, save, tables

    parameters = load_config(*configs)
    result = paper_and_ours.dataset(
        {method: datasets.read(path, "density") for method, path in densities},
        {method: datasets.read(path, "design") for method, path in designs},
        datasets.read(accuracy, "accuracy"),
    )
    named = datasets.describe(result.assign_attrs(case=case))
    heading = f"What survives of the paper, and ours, case '{case}'"
    rows, text = paper_and_ours.rows(named), paper_and_ours.text(named, heading)
    tables.write(out, rows, text, demonstration=parameters.demonstration)
    inputs = {f"density_{method}": path for method, path in densities}
    inputs |= {f"design_{method}": path for method, path in designs} | {"accuracy": accuracy}
    save(named, out.with_name(f"{out.name}.nc"), "paper_and_ours", parameters, inputs)


@main.command("statistics-check")
@_config
@click.option(
    "--baseline", "baselines", type=(str, _File), multiple=True, help="Case and its baseline."
)
@click.option(
    "--limits",
    "files",
    type=(str, _method_name, _File),
    multiple=True,
    help="Case, method and file of its limits.",
)
@_out
def statistics_check(
    configs: tuple[Path, ...],
    baselines: tuple[tuple[str, Path], ...],
    files: tuple[tuple[str, str, Path], ...],
    out: Path,
) -> None:
    """Check halves of the baselines against each other and every method against its baseline."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import save, statistics_check

    parameters = load_config(*configs)
    result = statistics_check.dataset(
        parameters,
        {case: datasets.read(path, "runs") for case, path in baselines},
        {(case, method): datasets.read(path, "limits") for case, method, path in files},
    )
    inputs = {f"baseline_{case}": path for case, path in baselines}
    inputs |= {f"limits_{case}_{method}": path for case, method, path in files}
    save(result, out, "statistics_check", parameters, inputs)


@main.command()
@_config
@_case
@click.option("--baseline", type=_File, required=True, help="Baseline of the case.")
@_designs
@click.option(
    "--surrogate",
    "surrogates",
    type=_of_method,
    multiple=True,
    help="Method and file of its surrogate.",
)
@_out
def prediction(
    configs: tuple[Path, ...],
    case: str,
    baseline: Path,
    designs: tuple[tuple[str, Path], ...],
    surrogates: tuple[tuple[str, Path], ...],
    out: Path,
) -> None:
    """Predict the runs of the baseline of a case by each method."""
    from maglev import datasets
    from maglev.config import load_config
    from maglev.stages import prediction, save

    parameters = load_config(*configs)
    result = prediction.dataset(
        parameters,
        datasets.read(baseline, "runs"),
        {method: datasets.read(path, "design") for method, path in designs},
        {method: datasets.read(path, "surrogate") for method, path in surrogates},
    )
    inputs = {"baseline": baseline, **{f"design_{method}": path for method, path in designs}}
    inputs |= {f"surrogate_{method}": path for method, path in surrogates}
    save(result.assign_attrs(case=case), out, "prediction", parameters, inputs)


@main.command()
@_config
@_out
def stability(configs: tuple[Path, ...], out: Path) -> None:
    """Map where gains of the suspension hold the train."""
    from maglev.config import load_config
    from maglev.stages import save, stability

    parameters = load_config(*configs)
    save(stability.dataset(parameters), out, "stability", parameters)


@main.command()
@click.argument("name", type=click.Choice(list(FIGURES)))
@click.argument("data", type=_File, nargs=-1, required=True)
@click.option("--out", type=_File, required=True, help="File name without its ending.")
def figure(name: str, data: tuple[Path, ...], out: Path) -> None:
    """Draw a figure from DATA: PNG, PDF, and the numbers in it as NetCDF."""
    from maglev.figures import draw

    draw(name, data, out)
