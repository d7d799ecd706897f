# From the configuration to the figures: `snakemake --cores 2 all`, or one figure by its name.
import re
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger
from snakemake.utils import min_version, validate

from maglev.config import (
    ConfigError,
    config_text,
    from_mapping,
    layered,
)
from maglev.fingerprint import code_of
from maglev.parameters import WHY_NO_DESIGN
from maglev.stage import flag, stages, summaries
from maglev.stages.paper_and_ours import RESPONSE
from maglev.stages.points import cost_words, n_samples
from maglev.vocabulary import BASELINE, DESIGNED, METHODS, TRACK_PARTS

min_version("9.0")

# Files given with --configfile lie over config/config.yaml, or over what they extend; names of files
# count from the file that names them.  Snakemake's own reading keeps neither.
try:
    given = layered(
        workflow.overwrite_configfiles,
        dict(workflow.config_settings.config),
        "config/config.yaml",
    )
    parameters = from_mapping(given)
except ConfigError as error:
    raise WorkflowError(str(error)) from None
STAGES, SUMMARIES = stages(), summaries()
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
include: "workflow/rules/stages.smk"
include: "workflow/rules/targets.smk"
include: "workflow/rules/figures.smk"


rule all:
    default_target: True
    input:
        rules.run_config.output,
        results(),
        figures_of_study(),


rule truth:
    input:
        [
            file_of(stage, case=case, method=BASELINE)
            for stage in ("baseline", "density", "limits")
            for case in CASES
        ],
        file_of("statistics_check", scope="statistics_truth"),
