# What the rules need to know of the configuration: names of stages, files of runs and of points.

import re


def stages(needs: str, lacks: str) -> str:
    """Pattern of the stages that read something of a case or a method, and nothing of another."""
    found = (
        re.escape(stage)
        for stage, sections in SECTIONS.items()
        if any(needs in one for one in sections)
        and not any(lacks in one for one in sections)
    )
    return "|".join(found)


STORE = f"results/.store/{config['run']}"
CHUNK = parameters.study.mcm.chunk_size
PROFILE = config["irregularity"]["profile_file"] or []


def n_samples(case: str) -> int:
    """Number of runs of the baseline of a case."""
    return parameters.cases[case].n_samples or parameters.study.mcm.n_samples


def chunks(wildcards) -> list[str]:
    """Files of the baseline of a case."""
    n = -(-n_samples(wildcards.case) // CHUNK)
    return [f"<results>/{wildcards.case}/mcm/chunk_{k:03d}.nc" for k in range(n)]


def runs_of_all_cases() -> list[str]:
    """Baselines and designs of all cases by the methods that they name."""
    files = []
    for name, case in parameters.cases.items():
        for method in case.methods:
            file = "mcm.nc" if method == "mcm" else f"{method}/design.nc"
            files.append(f"<results>/{name}/{file}")
        if case.random_track:
            files += [f"<results>/{name}/track/{part}.nc" for part in TRACK_PARTS]
    return files


def initial(wildcards) -> str:
    """Points of the first design of a method."""
    name = "osm" if wildcards.method == "osm" else f"initial_{wildcards.method}"
    return f"<results>/{wildcards.case}/points/{name}.nc"


def candidates(wildcards) -> list[str]:
    """Points that the rounds of a method choose from, none for a method without rounds."""
    if wildcards.method == "osm":
        return []
    return [f"<results>/{wildcards.case}/points/candidates_{wildcards.method}.nc"]


def baseline(wildcards) -> list[str]:
    """Runs that the rounds are compared with, if the case has them."""
    has_one = "mcm" in parameters.cases[wildcards.case].methods
    return [f"<results>/{wildcards.case}/mcm.nc"] if has_one else []
