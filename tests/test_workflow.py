"""The workflow: what it would do, what it does again, and what it leaves alone."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from maglev.stage import summaries

ROOT = Path(__file__).parents[1]
PARTS = ("Snakefile", "profiles", "workflow", "config", "src")
CONFIG = """\
extends: config.yaml
run: test
train: {n_cars: 1}
guideway: {n_spans: 1}
irregularity: {n_harmonics: 50, wavelength_max: 20 m}
study: {mcm: {n_samples: 4, chunk_size: 2}, tracks: {n_tracks: 3, n_gains: 16}}
cases:
  validation: {n_spans: 1}
  only_suspension_proportional: null
  only_suspension_derivative: null
  only_guidance_proportional: null
  only_guidance_derivative: null
  all_gains: null
  cov_004: null
  cov_006: null
  cov_008: null
  cov_010: null
  cov_012: null
  cov_014: {n_spans: 1}
  group_ends: null
  group_half: null
  group_lumped: null
  lag_2ms: {n_spans: 1, n_samples: 2}
  random_track: {n_spans: 1, methods: [mcm], n_samples: 2, track: random}
  fast: {n_spans: 1, sweep: {passage.speed: [400 km/h, 430 km/h]}}
"""


class Workplace:
    """A copy of the project, with a small configuration, in which Snakemake runs."""

    def __init__(self, folder):
        self.folder = folder
        for part in PARTS:
            source, target = ROOT / part, folder / part
            if source.is_dir():
                shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, target)
        (folder / "config" / "test.yaml").write_text(CONFIG)

    def snakemake(self, *arguments, config="config/test.yaml"):
        """Exit code and everything printed."""
        command = ["snakemake", *arguments, "--configfile", config]
        environment = os.environ | {"PYTHONPATH": str(self.folder / "src")}
        done = subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False
        )
        return done.returncode, done.stdout + done.stderr

    def would_run(self, *arguments):
        """Names of the rules that a dry run lists, with their numbers of jobs."""
        code, text = self.snakemake(*arguments, "--dry-run")
        assert code == 0, text
        if "Nothing to be done" in text:
            return {}
        table = text.split("Job stats:")[1].split("total")[0].splitlines()[3:]
        return {line.split()[0]: int(line.split()[1]) for line in table if line.strip()}


@pytest.fixture(scope="module")
def fresh(tmp_path_factory):
    """A workplace in which nothing has run."""
    return Workplace(tmp_path_factory.mktemp("fresh"))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    """A workplace in which Fig. 7 was drawn."""
    workplace = Workplace(tmp_path_factory.mktemp("drawn"))
    code, text = workplace.snakemake("fig7")
    assert code == 0, text
    return workplace


def test_a_dry_run_of_all_lists_every_step_of_the_method(fresh):
    jobs = fresh.would_run("all")
    assert set(summaries()) <= set(jobs)
    assert jobs.items() >= {
        "run_config": 1,
        "irregularity": 1, "guideway_modes": 1, "passage": 1, "deflection": 1, "dynamic_factor": 1,
        "baseline_points": 3, "representative_points": 5, "initial_points": 7,
        "candidate_points": 6, "baseline_chunk": 4, "baseline": 3, "design": 7, "track_runs": 4,
        "surrogate": 7, "eev": 7, "density": 10, "limits": 10, "limit_states": 10,
        "accuracy": 2, "track_split": 1, "statistics_check": 1, "table1": 1, "paper_and_ours": 1,
        "prediction": 2, "stability": 1, "control_study": 1, "stiffness_check": 1,
        "fig7": 1, "fig8": 1, "histories": 1, "gaps": 1, "modes": 1, "all": 1,
        "fig9": 1, "fig10": 1, "fig11": 1, "fig12": 1, "fig15": 1, "fig16": 1, "fig_sobol": 1,
        "fig_stability": 1, "fig_accuracy": 1, "fig_scatter": 1, "fig_track_split": 1,
        "fig_control_density": 1, "fig_control_limits": 1, "fig_stiffness": 1,
        "limit_state_table": 1, "limits_table": 1,
        "figures_validation": 1, "figures_cov_014": 1, "figures_lag_2ms": 1,
        "figures_random_track": 1, "figures_fast": 1, "figures_fast_1": 1, "figures_fast_2": 1,
        "mean_run": 2, "sweep": 1,
        "tracks": 1, "line": 1, "fig_tracks": 1, "fig_track_limits": 1,
        "density_in_time": 1, "fig_in_time": 1,
    }.items()  # fmt: skip
    assert fresh.would_run() == jobs


def test_a_single_figure_needs_only_its_own_chain(fresh):
    assert fresh.would_run("modes") == {"stage_config": 1, "guideway_modes": 1, "modes": 1}


def test_a_single_case_and_method_needs_only_its_own_chain(fresh):
    assert fresh.would_run("results/test/cov_014/asm/limits.nc") == {
        "stage_config": 2, "method_config": 3, "initial_points": 1, "candidate_points": 1,
        "design": 1, "surrogate": 1, "limits": 1,
    }  # fmt: skip


OWN = """\
extends: test.yaml
only: [mine]
cases:
  mine: {{n_spans: 1, {more}}}
"""
OF_PAPER = (
    "table1", "paper_and_ours", "control_study", "tracks", "line", "fig_in_time",
    *(f"fig{number}" for number in range(9, 17)),
)  # fmt: skip
"""What compares cases that are not there."""


@pytest.mark.parametrize(
    ("more", "cases", "names"),
    [
        ("methods: [mcm]", ["mine"], ["density", "exceedance", "limits", "scatter"]),
        ("methods: [asm]", ["mine"], ["density", "exceedance", "limits", "sobol_asm"]),
        (
            "methods: [mcm, asm]",
            ["mine"],
            "density exceedance limits sobol_asm scatter accuracy prediction".split(),
        ),
        (
            "methods: [asm], sweep: {passage.speed: [400 km/h, 430 km/h]}",
            ["mine_1", "mine_2"],
            ["density", "exceedance", "limits", "sobol_asm"],
        ),
        (
            "methods: [mcm, asm], track: random",
            ["mine"],
            ["density", "exceedance", "limits", "scatter", "track_split"],
        ),
    ],
)
def test_a_case_of_any_name_has_every_figure_and_table_of_its_methods(fresh, more, cases, names):
    (fresh.folder / "config" / "own.yaml").write_text(OWN.format(more=more))
    code, text = fresh.snakemake("all", "--dry-run", config="config/own.yaml")
    assert code == 0, text
    (line,) = (one for one in text.splitlines() if one.startswith("    input: results/test/run_c"))
    wanted = line.removeprefix("    input: ").split(", ")
    drawn = [f"results/test/figures/{case}/{name}.png" for case in cases for name in names]
    if "sweep" in more:
        drawn.append("results/test/figures/mine/sweep.png")
        assert "results/test/mine/sweep.nc" in wanted
    assert sorted(drawn) == sorted(
        one for one in wanted if one.count("/") == 4 and "figures" in one
    )
    assert {"results/test/tables/limits.nc", "results/test/tables/limit_states.nc"} <= set(wanted)
    rules = {one.split()[0] for one in text.split("Job stats:")[1].splitlines() if one.split()}
    assert not rules & set(OF_PAPER)
    assert not any("validation/" in one and "/validation/" not in one for one in wanted)
    single = f"results/test/figures/{cases[-1]}/{names[-1]}.pdf"
    code, text = fresh.snakemake(single, "--dry-run", config="config/own.yaml")
    assert code == 0, text
    assert f"figures_{cases[-1]}  " in text


def test_the_truth_of_all_cases_is_a_target_of_its_own(fresh):
    jobs = fresh.would_run("truth")
    assert (jobs["baseline"], jobs["density"], jobs["statistics_check"]) == (4, 4, 1)


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("passage: {speed: 0 km/h}", "passage.speed must be greater than 0 m/s, got '0 km/h'"),
        ("pasage: {}", "pasage is not a known key; did you mean 'passage'?"),
        (
            "validation: {measurements: measurements/none.yaml}",
            "validation.measurements names a file that does not exist: "
            "config/measurements/none.yaml",
        ),
    ],
)
def test_a_mistake_in_the_configuration_is_one_sentence_without_a_traceback(fresh, line, sentence):
    (fresh.folder / "config" / "bad.yaml").write_text(line)
    code, text = fresh.snakemake("all", "--dry-run", config="config/bad.yaml")
    assert code == 1
    assert sentence in text
    assert "Traceback" not in text


def test_after_a_run_there_is_nothing_to_be_done(drawn):
    figures = drawn.folder / "results" / "test" / "figures"
    assert sorted(path.name for path in figures.iterdir()) == ["fig7.nc", "fig7.pdf", "fig7.png"]
    assert drawn.would_run("fig7") == {}


def test_a_comment_or_a_docstring_reruns_nothing(drawn):
    path = drawn.folder / "src" / "maglev" / "mechanics" / "irregularity.py"
    text = path.read_text()
    path.write_text(text.replace('"""', '"""Once more: ', 1) + "\n# a comment\n")
    assert drawn.would_run("fig7") == {}
    path.write_text(text)


def test_an_edit_reruns_what_stands_on_it(drawn):
    path = drawn.folder / "src" / "maglev" / "mechanics" / "irregularity.py"
    text = path.read_text()
    path.write_text(text + "\nEXTRA = 1\n")
    assert drawn.would_run("fig7") == {"irregularity": 1, "fig7": 1}
    path.write_text(text)


def test_a_value_reruns_only_the_stages_that_read_it(drawn):
    path = drawn.folder / "config" / "test.yaml"
    path.write_text(CONFIG + "gains: {suspension_proportional: 3400 A/m}\n")
    assert drawn.would_run("fig7") == {}
    path.write_text(CONFIG + "seed: 5\n")
    assert drawn.would_run("fig7") == {"stage_config": 1, "irregularity": 1, "fig7": 1}
    path.write_text(CONFIG)


MCM = "results/test/validation/mcm.nc"


@pytest.fixture(scope="module")
def counted(tmp_path_factory):
    """A workplace in which the baseline was run, four samples in two chunks."""
    workplace = Workplace(tmp_path_factory.mktemp("counted"))
    code, text = workplace.snakemake(MCM, "--cores", "1")
    assert code == 0, text
    return workplace


def test_a_larger_baseline_leaves_finished_chunks_alone(counted):
    assert counted.would_run(MCM) == {}
    path = counted.folder / "config" / "test.yaml"
    path.write_text(CONFIG.replace("n_samples: 4", "n_samples: 6"))
    assert counted.would_run(MCM) == {
        "case_config": 1, "baseline_points": 1, "baseline_chunk": 1, "baseline": 1,
    }  # fmt: skip
    path.write_text(CONFIG)


def test_a_baseline_follows_what_decides_it_and_nothing_else(counted):
    path = counted.folder / "config" / "test.yaml"
    path.write_text(CONFIG.replace("study: {", "study: {asm: {n_largest: 80}, "))
    assert counted.would_run(MCM) == {}
    path.write_text(CONFIG + "passage: {speed: 400 km/h}\n")
    assert counted.would_run(MCM) == {"case_config": 2, "baseline_chunk": 2, "baseline": 1}
    path.write_text(CONFIG)


def test_other_code_reruns_all_that_stands_on_it_at_once(counted):
    path = counted.folder / "src" / "maglev" / "parameters.py"
    text = path.read_text()
    path.write_text(text + "\nEXTRA = 1\n")
    assert counted.would_run(MCM) == {"baseline_points": 1, "baseline_chunk": 2, "baseline": 1}
    path.write_text(text)


def test_the_store_outlives_its_results_until_it_is_purged(counted):
    store = counted.folder / "results" / ".store" / "test"
    stored = sorted(path.name for path in store.rglob("*.nc"))
    assert len(stored) == 2
    (counted.folder / MCM).unlink()
    code, text = counted.snakemake(MCM, "--cores", "1", "--forcerun", "baseline_chunk")
    assert code == 0, text
    assert sorted(path.name for path in store.rglob("*.nc")) == stored
    log = counted.folder / "logs" / "test" / "validation" / "mcm" / "samples_0_2.log"
    assert "2 runs found, none to do" in log.read_text()
    code, text = counted.snakemake("purge", "--cores", "1")
    assert code == 0, text
    assert not store.exists()
