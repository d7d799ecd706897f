"""Many jobs at once: compiled code shared from a cold start, no more threads than were given."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from maglev.fingerprint import standing_on

ROOT = Path(__file__).parents[1]

JOB = """
import json, time
import numpy as np
from maglev import simulate
from maglev.mechanics import _kernels
from maglev.parameters import Config

config = Config.model_validate(
    {"train": {"n_cars": 1}, "guideway": {"n_spans": 1}, "passage": {"approach": "60 m"}}
)
gains = np.array(config.gains.as_row) * np.linspace(0.95, 1.05, 40)[:, None]
first = simulate(config, gains[:1])
wall, process = time.perf_counter(), time.process_time()
passages = simulate(config, gains)
print(json.dumps({
    "extremes": [passages[name].values.tobytes().hex() for name in sorted(passages.data_vars)],
    "loaded": sum(_kernels.cross.stats.cache_hits.values()),
    "cores": (time.process_time() - process) / (time.perf_counter() - wall),
}))
"""


def start(cache: Path, n_threads: int = 1) -> subprocess.Popen[str]:
    """A job as the workflow starts it with so many threads, its compiled code in ``cache``."""
    given = {"NUMBA_CACHE_DIR": str(cache)}
    given |= {name: str(n_threads) for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS")}
    given |= {"OPENBLAS_NUM_THREADS": str(n_threads)}
    return subprocess.Popen(
        [sys.executable, "-c", JOB],
        env={**os.environ, **given},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def outcome(job: subprocess.Popen[str]) -> dict:
    """What a job has printed; its error if it failed."""
    out, error = job.communicate(timeout=300)
    assert job.returncode == 0, error
    return json.loads(out)


@pytest.mark.slow
def test_jobs_that_start_together_on_a_cold_cache_agree_and_leave_it_whole(tmp_path):
    together = [outcome(job) for job in [start(tmp_path) for _ in range(2)]]
    later = outcome(start(tmp_path))
    assert together[0]["extremes"] == together[1]["extremes"] == later["extremes"]
    # however many cores linear algebra may take
    assert outcome(start(tmp_path, n_threads=2))["extremes"] == later["extremes"]
    assert later["loaded"] == 1  # nothing was compiled again
    assert not list(tmp_path.rglob("*.tmp*"))
    for job in (*together, later):  # of three rows of samples with one thread
        assert job["cores"] < 1.1


def test_rules_pass_their_threads_on():
    """Snakemake itself tells linear algebra; compiled loops and our own threads it does not."""
    for path in sorted((ROOT / "workflow" / "rules").glob("*.smk")):
        for rule in re.split(r"^rule ", path.read_text(encoding="utf-8"), flags=re.M)[1:]:
            name, command = rule.split(":", 1)[0], rule.split("shell:")[-1]
            if re.search(r"^ +threads:", rule, flags=re.M):
                assert "{threads}" in command, name
            stages = re.findall(r'code_of\("(stages\.\w+)"\)', rule)
            modules = standing_on(*stages) if stages else ()
            files = [ROOT.joinpath("src", *one.split(".")).with_suffix(".py") for one in modules]
            if any("parallel=True" in file.read_text() for file in files if file.is_file()):
                assert "NUMBA_NUM_THREADS={threads}" in command, name
