# From the configuration to the figures: `snakemake --cores 2 all`, or one figure by its name.
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.utils import min_version, validate

from maglev.datasets import METHODS, TRACK_PARTS
from maglev.config import (
    ConfigError,
    config_text,
    from_mapping,
    overlay,
    read_overlays,
    rebase,
)
from maglev.fingerprint import code_of
from maglev.stages import SECTIONS, config_slice

min_version("9.0")

# What was given with --configfile lies over config/config.yaml, or over the file that it extends;
# names of files in it are relative to config/.
try:
    given = rebase(config, old="config", new=".")
    base = Path("config", given.pop("extends", "config.yaml"))
    parameters = from_mapping(overlay(read_overlays(base), given))
except ConfigError as error:
    raise WorkflowError(str(error)) from None
config.clear()
config.update(parameters.quantities())
validate(config, "workflow/schemas/config.schema.yaml", set_default=False)


pathvars:
    results=f"results/{config['run']}",
    logs=f"logs/{config['run']}",
    benchmarks=f"benchmarks/results/{config['run']}",


wildcard_constraints:
    case="|".join(parameters.cases) or "-",
    method="|".join(METHODS),


include: "workflow/rules/common.smk"
include: "workflow/rules/config.smk"
include: "workflow/rules/track.smk"
include: "workflow/rules/validation.smk"
include: "workflow/rules/points.smk"
include: "workflow/rules/runs.smk"
include: "workflow/rules/cases.smk"
include: "workflow/rules/statistics.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/study_figures.smk"


rule all:
    default_target: True
    input:
        rules.run_config.output,
        rules.fig7.output,
        rules.fig8.output,
        rules.histories.output,
        rules.gaps.output,
        rules.modes.output,
        rules.fig_train_modes.output,
        runs_of_all_cases(),
        statistics_of_all_cases(),
        figures_of_study(),


rule truth:
    input:
        [f"<results>/{case}/mcm.nc" for case in parameters.cases],
        [f"<results>/{case}/mcm/density.nc" for case in parameters.cases],
        [f"<results>/{case}/mcm/limits.nc" for case in parameters.cases],
        rules.statistics_truth.output,
