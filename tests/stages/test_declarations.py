"""Every stage computes with what it has declared, and with nothing else."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from maglev import datasets
from maglev.config import from_mapping
from maglev.datasets import LAYOUTS
from maglev.stage import Stage, UndeclaredKeyError, flag, named, summaries
from maglev.stages import stability
from maglev.stages.points import n_samples
from maglev.vocabulary import BASELINE, GAIN_KEYS, TRACK_PARTS

NARROW = {
    f"gains.{gain}": {"law": "normal", "coefficient_of_variation": 0.02} for gain in GAIN_KEYS
}

MAPPING = {
    "train": {"n_cars": 1},
    "guideway": {"n_spans": 1},
    "irregularity": {"n_harmonics": 50, "wavelength_max": "20 m"},
    "validation": {"speed_min": "400 km/h", "speed_max": "430 km/h", "speed_step": "30 km/h"},
    "study": {
        "n_representative": 16,
        "n_population": 512,
        "n_counting": 16384,
        "failure_probability": [0.2],
        "mcm": {"n_samples": 24, "chunk_size": 16},
        "osm": {"n_runs": 16},
        "asm_paper": {"n_initial": 12, "n_candidates": 16, "n_largest": 16, "batch_size": 4},
        "asm": {"n_initial": 12, "n_candidates": 32, "n_largest": 16, "batch_size": 4},
        "tracks": {"n_tracks": 3, "n_gains": 16},
    },
    "cases": {
        "validation": {"n_spans": 1, "random": NARROW},
        "moving": {
            "n_spans": 1,
            "methods": [BASELINE],
            "track": "random",
            "n_samples": 8,
            "random": NARROW,
        },
        "fast": {
            "n_spans": 1,
            "random": {key: NARROW[key] for key in list(NARROW)[:1]},
            "sweep": {"passage.speed": ["400 km/h", "430 km/h"]},
        },
    },
}

CASE_OF = {"track_runs": "moving", "track_split": "moving", "sweep": "fast", "mean_run": "fast_1"}
"""Case of a stage that is not made for every case."""

SWEPT = ("fast_1", "fast_2")
"""Cases that the sweep of `fast` makes."""

NAMES = {
    "baseline_chunk": {"start": 0, "stop": 16},
    "track_runs": {"part": "gains_only"},
}
"""Other wildcards of a rule, as the stage is given them."""


class Chain:
    """Makes the file of any stage, with all that it is made from, each once."""

    def __init__(self, store):
        self.config, self.store, self.found = from_mapping(MAPPING), store, {}

    def made(self, name, case=None, method=None, **names):
        key = (name, case, method, *names.values())
        if key not in self.found:
            stage = named(name)
            of = {"run": {}, "case": {"case": case}, "method": {"case": case, "method": method}}
            of = of[stage.of]
            files = {
                role: self.many(role, one.by, case) if one.by else self.made(role, case, method)
                for role, one in stage.roles(of.get("method")).items()
            }
            given = {"case": case, "method": method, "store": self.store, "n_threads": 1, **names}
            taken = {key: given[key] for key in stage.takes}
            made = stage.compute(stage.view(self.config, **of), **taken, **files)
            self.found[key] = datasets.describe(made)
        return self.found[key]

    def many(self, role, by, case):
        methods = [one for one in ("mcm", "asm") if one in named(role).methods]
        n = n_samples(self.config, case or "validation")
        cases = SWEPT if case == "fast" else ("validation",)
        return {
            ("method",): lambda: {one: self.made(role, case, one) for one in methods},
            ("part",): lambda: {one: self.made(role, case, part=one) for one in TRACK_PARTS},
            ("start", "stop"): lambda: {
                (start, min(start + 16, n)): self.made(
                    role, case, start=start, stop=min(start + 16, n)
                )
                for start in range(0, n, 16)
            },
            ("case",): lambda: {one: self.made(role, one) for one in cases},
            ("case", "method"): lambda: {
                (one, "asm"): self.made(role, one, "asm") for one in cases
            },
        }[by]()


@pytest.fixture(scope="module")
def chain(tmp_path_factory, pytestconfig):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(pytestconfig.rootpath / "config")
        patch.setattr(stability, "N_PROPORTIONAL", 3)
        patch.setattr(stability, "N_DERIVATIVE", 2)
        yield Chain(tmp_path_factory.mktemp("store"))


PAIRS = [
    (name, method)
    for name in summaries()
    for method in (named(name).methods if named(name).of == "method" else (None,))
]


@pytest.mark.parametrize(("name", "method"), PAIRS)
def test_a_stage_finds_all_it_needs_in_what_it_has_declared(chain, name, method):
    case = CASE_OF.get(name, "validation")
    made = chain.made(name, case, method, **NAMES.get(name, {}))
    datasets.check(made, named(name).layout)


def test_stages_are_called_like_their_modules_and_roles_like_the_stages_that_make_them():
    for name in summaries():
        stage = named(name)
        assert stage.name == name
        assert stage.layout in LAYOUTS
        for role, one in stage.inputs.items():
            assert named(role).layout == one.layout


def trial(*reads, of="run"):
    """A stage that is not in the package."""
    return Stage(name="trial", of=of, reads=reads, layout="passage", compute=lambda config: None)


def test_a_key_that_is_not_declared_is_refused_by_its_name(chain):
    view = trial("seed", "study.confidence", "train").view(chain.config)
    assert (view.seed, view.study.confidence) == (chain.config.seed, chain.config.study.confidence)
    assert view.train is chain.config.train
    with pytest.raises(UndeclaredKeyError) as refused:
        view.study.asm.batch_size  # noqa: B018
    assert refused.value.args == (
        "the stage 'trial' reads study.asm, which it has not declared; add it to 'reads' of STAGE "
        "in maglev/stages/trial.py",
    )
    with pytest.raises(UndeclaredKeyError, match="reads passage, which it has not declared"):
        view.passage  # noqa: B018
    with pytest.raises(AttributeError, match="Config has no 'colour'"):
        view.colour  # noqa: B018


def test_methods_of_a_section_see_the_view_too(chain):
    partly = trial("gains.suspension_proportional").view(chain.config)
    with pytest.raises(UndeclaredKeyError, match=r"reads gains\.suspension_derivative"):
        partly.gains.as_row  # noqa: B018
    named_case = trial("guideway", "cases.{case}.n_spans", of="case").view(chain.config, "moving")
    assert named_case.of_case("moving").guideway.n_spans == 1
    with pytest.raises(UndeclaredKeyError, match=r"reads cases\.moving\.methods"):
        named_case.cases["moving"].methods  # noqa: B018
    assert list(named_case.cases) == ["moving"]


def test_an_unknown_case_or_method_is_refused(chain):
    with pytest.raises(ValueError, match="there is no case 'al', known are: validation"):
        named("representative_points").view(chain.config, "al")
    with pytest.raises(ValueError, match="design needs a method of osm, asm_paper, asm: mcm"):
        named("design").view(chain.config, "validation", "mcm")


def test_a_slice_keeps_the_nesting_of_the_configuration(chain):
    part = named("guideway_modes").slice(chain.config)
    assert part["validation"] == {
        "measurements": "measurements/shanghai.yaml", "measured_here": True,
    }  # fmt: skip
    assert set(part) == {"demonstration", "guideway", "validation"}
    assert named("guideway_modes").files(chain.config) == {
        "measurements": "measurements/shanghai.yaml"
    }


def test_accuracy_is_told_the_batch_size_of_the_user():
    config = from_mapping({"study": {"asm": {"batch_size": 5}}})
    part = from_mapping(named("accuracy").slice(config))
    assert part.study.asm.batch_size == 5


def test_a_profile_edited_within_a_session_is_seen(tmp_path, monkeypatch):
    x = np.linspace(-400.0, 400.0, 4001)

    def written(scale):
        rows = zip(x, scale * np.sin(x), 0 * x, strict=True)
        text = "x,vertical,lateral\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows)
        (tmp_path / "profile.csv").write_text(text)

    mapping = {key: MAPPING[key] for key in ("train", "guideway")}
    mapping["irregularity"] = {"profile_file": "profile.csv"}
    monkeypatch.chdir(tmp_path)
    (tmp_path / "measurements").mkdir()
    source = Path(__file__).parents[2] / "config" / "measurements" / "shanghai.yaml"
    shutil.copy(source, tmp_path / "measurements")
    written(0.0)
    config, stage = from_mapping(mapping), named("passage")
    extremes = []
    for scale in (1e-4, 2e-4, 1e-4):
        written(scale)
        passage = stage.compute(stage.view(config))
        extremes.append(float(passage["car_body_acceleration_z"][0]))
    assert extremes[0] == extremes[2] != extremes[1]


def test_options_are_spelt_the_same_everywhere():
    assert [flag(name) for name in named("baseline_chunk").options] == [
        "--config", "--case", "--start", "--stop", "--store", "--threads", "--out",
    ]  # fmt: skip
