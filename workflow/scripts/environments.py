"""Write the environments of conda from the dependencies in pyproject.toml, which alone are kept."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

CONDA_NAMES = {"snakemake": "snakemake-minimal"}
"""Where conda's name is not that of the Python package index."""

OF_USERS = """\
# Written by `make docs` from pyproject.toml.
# For users of conda: `conda env create -f environment.yml`, then `conda activate maglev`.
# The versions that the results were made with are those in requirements.lock.
name: maglev
"""
OF_RULES = """\
# Written by `make docs` from pyproject.toml: the environment of every rule.
"""


def environment(head: str, install: str) -> str:
    """Text of an environment: a head, all dependencies, and how pip installs this package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    packages = [f"python {project['requires-python']}"]
    for requirement in project["dependencies"]:
        name, bound = requirement.split(">=")
        packages.append(f"{CONDA_NAMES.get(name, name)} >={bound}")
    lines = [*packages, "pip", "pip:"]
    channels = "channels:\n  - conda-forge\n  - bioconda\n"
    return f"{head}{channels}dependencies:\n" + "".join(
        [*(f"  - {line}\n" for line in lines), f"      - {install}\n"]
    )


def environments() -> dict[Path, str]:
    """Text of every environment by its file."""
    return {
        ROOT / "environment.yml": environment(OF_USERS, "-e ."),
        ROOT / "workflow/envs/maglev.yaml": environment(OF_RULES, "--no-deps -e ../.."),
    }


if __name__ == "__main__":
    for path, text in environments().items():
        path.write_text(text, encoding="utf-8")
