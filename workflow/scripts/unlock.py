"""Remove the lock that a killed run of Snakemake has left, if no run is alive in this folder."""

import subprocess
import sys
from pathlib import Path

import psutil


def alive(folder: Path) -> list[int]:
    """Process numbers of the runs of Snakemake in a folder."""
    found = []
    for process in psutil.process_iter():
        try:
            names = {Path(word).name for word in process.cmdline()[:3]}
            if "snakemake" in names and Path(process.cwd()) == folder:
                found.append(process.pid)
        except (psutil.AccessDenied, psutil.NoSuchProcess, psutil.ZombieProcess):
            continue
    return found


def main() -> int:
    locks = Path(".snakemake/locks")
    if not locks.is_dir() or not any(locks.iterdir()):
        return 0
    runs = alive(Path.cwd())
    if runs:
        print(f"a run is alive here (process {runs[0]}); wait for it or stop it", file=sys.stderr)
        return 1
    print("removing the lock that a killed run has left")
    return subprocess.run(["snakemake", "--unlock", "--quiet"], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
