"""Configurations: units in, one sentence out, and the files that are written from the classes."""

import subprocess
import sys
from pathlib import Path

import pint
import pytest
import yaml
from jsonschema import Draft202012Validator
from numpy.testing import assert_allclose

from maglev import ConfigError, catalogue, load_config, units
from maglev.config import config_text, from_mapping, overlay
from maglev.measurements import load_measurements
from maglev.parameters import Config
from maglev.stage import named
from maglev.vocabulary import PAPER_RESPONSES, RESPONSES

ROOT = Path(__file__).parents[1]

KNOWN = " or ".join(", ".join(f"'{name}'" for name in RESPONSES).rsplit(", ", 1))
"""The responses as a sentence names them."""


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "passage: {sped: 430 km/h}",
            "passage.sped is not a known key of passage; did you mean 'speed'?",
        ),
        ("trian: {}", "trian is not a known key; did you mean 'train'?"),
        (
            "passage: {speed: 3 kg}",
            "passage.speed must be given in m/s or a unit that converts to it, got '3 kg'",
        ),
        (
            "train: {car_body: {mass: -1 kg}}",
            "train.car_body.mass must be greater than 0 kg, got '-1 kg'",
        ),
        (
            "passage: {speed: 0 km/h}",
            "passage.speed must be greater than 0 m/s, got '0 km/h'",
        ),
        ("passage: {speed: 430}", "passage.speed must carry its unit, such as '430 m/s'"),
        (
            "passage: {speed: 3 parsnips}",
            "passage.speed must be a number with a unit of m/s, got '3 parsnips', "
            "whose unit is not known",
        ),
        ("passage: {speed: 1e999 m/s}", "passage.speed must be finite, got '1e999 m/s'"),
        ("train: {n_cars: 2.5}", "train.n_cars must be a whole number, got 2.5"),
        ("train: 5", "train must hold keys and values, got 5"),
        (
            "irregularity: {vertical: {law: poewr}}",
            "irregularity.vertical must have a law among 'power', 'rational', 'german', "
            "got {law: poewr}",
        ),
        (
            "irregularity: {vertical: {law: rational}}",
            "irregularity.vertical.numerator is missing",
        ),
        (
            "irregularity: {vertical: {law: german, roughnes: 1 m^2 rad/m}}",
            "irregularity.vertical.roughnes is not a known key of irregularity.vertical; "
            "did you mean 'roughness'?",
        ),
        (
            "irregularity: {fade_in: 200 m}",
            "irregularity.fade_in must not exceed passage.approach = 150 m, got 200 m",
        ),
        (
            "validation: {measurements: nowhere.yaml}",
            "validation.measurements names a file that does not exist: nowhere.yaml",
        ),
        (
            "cases: {validation: {coefficient_of_variation: 0}}",
            "cases.validation.coefficient_of_variation is no longer a key: write it into the law "
            "of each quantity, such as random: {gains.suspension_proportional: {law: normal, "
            "coefficient_of_variation: 0.1}}",
        ),
        (
            "cases: {a: {random: {passage.speed: {coefficient_of_variation: 0}}}}",
            "cases.a.random.passage.speed.coefficient_of_variation must be greater than 0, got 0",
        ),
        (
            "cases: {validation: {methods: [mcm, amc]}}",
            "cases.validation.methods.1 must be 'mcm', 'osm', 'asm_paper' or 'asm', got 'amc'",
        ),
        (
            "cases: {validation: {random_gains: [suspension]}}",
            "cases.validation.random_gains is no longer a key: write the gains with their laws "
            "under random, such as random: {gains.suspension_proportional: {law: normal, "
            "coefficient_of_variation: 0.1}}",
        ),
        (
            "cases: {a: {random: {train.car_body.weight: {coefficient_of_variation: 0.1}}}}",
            "cases.a.random.train.car_body.weight is no key of the configuration: there is no "
            "'weight'",
        ),
        (
            "cases: {a: {random: {irregularity.sides: {coefficient_of_variation: 0.1}}}}",
            "cases.a.random.irregularity.sides cannot be random: its value is no number, but "
            "'shared'",
        ),
        (
            "cases: {a: {random: {study.n_population: {coefficient_of_variation: 0.1}}}}",
            "cases.a.random.study.n_population cannot be random; the sections whose numbers can "
            "are train, guideway, irregularity, gains, control, passage, such as "
            "train.car_body.mass",
        ),
        (
            "cases: {a: {set: {passage.speed: 90 m/s}, "
            "random: {passage.speed: {coefficient_of_variation: 0.01}}}}",
            "cases.a.passage.speed is both set and random; leave one of them out",
        ),
        (
            "cases: {a: {random: {train.n_cars: {coefficient_of_variation: 0.1}}}}",
            "cases.a.random.train.n_cars: it counts, so that its law must be discrete, of integers",
        ),
        (
            "cases: {a: {random: {train.car_body.mass: {law: uniform, low: 29 t, high: 39}}}}",
            "cases.a.random.train.car_body.mass: high must carry its unit, such as '39.0 kg'",
        ),
        (
            "cases: {a: {correlation: [[gains.suspension_proportional, passage.speed, 0.5]]}}",
            "cases.a.correlation: passage.speed is not random; the random ones are "
            "gains.suspension_proportional, gains.suspension_derivative, "
            "gains.guidance_proportional, gains.guidance_derivative",
        ),
        (
            "cases: {validation: {n_span: 4}}",
            "cases.validation.n_span is not a known key of cases.validation; "
            "did you mean 'n_spans'?",
        ),
        (
            "cases: {validation: {random_track: true}}",
            "cases.validation.random_track is no longer a key: write track: random",
        ),
        (
            "cases: {validation: {track: 1}}",
            "cases.validation.track must be fixed, random or a number of tracks from 2, got 1",
        ),
        (
            "cases: {a: {random: {gains.suspension_proportional: {law: lognormal, "
            "mean: 2000 A/m, coefficient_of_variation: 0.1}}}}",
            "cases.a.random leaves only 1 % of the gains statically stable (k_p > i0/delta0, more "
            "for the group half, k_d >= 0), expected at least half; lower the variation, raise the "
            "mean gains or take the case away with null",
        ),
        (
            "only: [mine]",
            "only names 'mine', which is no case; there are: validation, "
            "only_suspension_proportional, only_suspension_derivative, only_guidance_proportional, "
            "only_guidance_derivative, all_gains, cov_004, cov_006, cov_008, cov_010, cov_012, "
            "cov_014, group_ends, group_half, group_lumped, lag_2ms",
        ),
        (
            "cases: {New: {}}",
            "cases.New cannot name a case: use small letters, digits and underscores, and none "
            "of config, track, guideway, train, figures, tables, checks, report",
        ),
        (
            "study: {asm_paper: {response: girder}}",
            f"study.asm_paper.response must be {KNOWN}, got 'girder'",
        ),
        (
            "study: {responses: [girder]}",
            f"study.responses.0 must be {KNOWN}, got 'girder'",
        ),
        (
            "study: {responses: [girder_displacement_z, girder_displacement_z]}",
            "study.responses must not name anything twice, got girder_displacement_z, "
            "girder_displacement_z",
        ),
        (
            "limit_states: {ride: {response: car_body_acceleration_z, limit: 4 mm}}",
            "limit_states.ride.limit must be given in m/s^2 or a unit that converts to it, "
            "got '4 mm'",
        ),
        (
            "limit_states: {my ride: {response: car_body_acceleration_z, limit: 0.15}}",
            "limit_states.my ride.limit must carry its unit, such as '0.15 m/s^2'",
        ),
        (
            "limit_states: {ride: {limit: 0 m/s^2}}",
            "limit_states.ride.limit must be greater than 0 and finite, got '0 m/s^2'",
        ),
        (
            "limit_states: {sag: {response: sag, limit: 4 mm}}",
            f"limit_states.sag.response must be {KNOWN}, got 'sag'",
        ),
        (
            "limit_states: {sag: {response: girder_displacement_z}}",
            "limit_states.sag.limit is missing: a response needs a limit, a limit a response",
        ),
        (
            "limit_states: {out of service: {any_of: [ride, gap]}}",
            "limit_states.out of service.any_of names no limit state: there is no 'gap', known "
            f"are: {', '.join(Config().limit_states)}, out of service, lost",
        ),
        (
            "limit_states: {a: {any_of: [b]}, b: {all_of: [lost, a]}}",
            "limit_states.a goes in a circle: a -> b -> a",
        ),
        (
            "limit_states: {a: {any_of: [lost], all_of: [ride]}}",
            "limit_states.a.any_of cannot stand beside all_of: a limit state has a response with "
            "its limit, or any_of, or all_of",
        ),
        (
            "limit_states: {a: {any_of: [lost], limit: 4 mm}}",
            "limit_states.a.limit cannot stand beside any_of: a limit state has a response with "
            "its limit, or any_of, or all_of",
        ),
        (
            "limit_states: {a: {target: 0.1}}",
            "limit_states.a.response is missing: a limit state has a response with its limit, or "
            "any_of, or all_of",
        ),
        (
            "limit_states: {a: {any_of: [ride, ride]}}",
            "limit_states.a.any_of must not name anything twice, got ride, ride",
        ),
        (
            "limit_states: {lost: {any_of: [ride]}}",
            "limit_states.lost cannot name a limit state: use a line of text that neither begins "
            "nor ends with a space; lost is always there and means lost levitation",
        ),
        (
            "limit_states: {ride: {target: 2}}",
            "limit_states.ride.target must be less than 1, got 2",
        ),
        (
            "study: {asm: {n_candidates: 50}}",
            "study.asm.n_candidates must be at least asm.n_largest = 104, got 50: rounds cannot "
            "choose more runs than there are candidates",
        ),
        (
            "{study: {asm: {n_candidates: 110}}, cases: {six: {random: {"
            "gains.suspension_proportional: {coefficient_of_variation: 0.1}, "
            "gains.suspension_derivative: {coefficient_of_variation: 0.1}, "
            "gains.guidance_proportional: {coefficient_of_variation: 0.1}, "
            "gains.guidance_derivative: {coefficient_of_variation: 0.1}, "
            "train.bogie.mass: {coefficient_of_variation: 0.1}, "
            "train.rod.mass: {coefficient_of_variation: 0.1}}, methods: [asm]}}}",
            "study.asm.n_candidates must be at least 120, the largest number of runs of the 6 "
            "random quantities of cases.six, got 110; set more, or study.asm.n_largest",
        ),
        (
            "study: {failure_probability: [0.01, 0.1]}",
            "study.failure_probability must fall from value to value, got [0.01, 0.1]",
        ),
    ],
)
def test_a_mistake_gets_one_sentence_that_names_the_key(text, sentence):
    with pytest.raises(ConfigError) as error:
        from_mapping(yaml.safe_load(text))
    assert str(error.value) == sentence


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("train: {n_cars: 2\n", r"bad\.yaml, line 2, column 1: "),
        ("- a\n- b\n", r"bad\.yaml must hold keys and values"),
        ("seed: 1\nseed: 2\n", r"bad\.yaml, line 2, column 1: the key 'seed' stands twice"),
        ("extends: bad.yaml\n", r"bad\.yaml extends itself"),
        ("extends: none.yaml\n", r"none\.yaml cannot be read: no such file or directory"),
    ],
)
def test_a_file_that_cannot_be_read_is_named(tmp_path, text, sentence):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=sentence):
        load_config(path)


def test_a_speed_may_be_given_in_any_unit_of_speed():
    assert_allclose(from_mapping({"passage": {"speed": "120 m/s"}}).passage.speed, 120)
    assert_allclose(from_mapping({"passage": {"speed": "432 km/h"}}).passage.speed, 120)


@pytest.mark.parametrize(("unit", "si"), units._FACTORS)
def test_the_short_cut_for_common_units_agrees_with_the_library(unit, si):
    times, over = units._FACTORS[unit, si]
    exact = pint.UnitRegistry().Quantity(430.0, unit).to(si).magnitude
    assert_allclose(430.0 * times / over, exact, rtol=1e-15)


def test_a_configuration_in_si_units_needs_no_library_of_units():
    code = "import sys, maglev.parameters as p; p.Config(); sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_key_left_out_keeps_the_default_of_its_own_place():
    lighter = from_mapping({"train": {"guidance_magnet": {"mass": "380 kg"}}})
    expected = Config().train.guidance_magnet.model_copy(update={"mass": 380.0})
    assert lighter.train.guidance_magnet == expected


def test_later_files_overlay_earlier_ones_and_extends_names_the_lowest(tmp_path):
    (tmp_path / "base.yaml").write_text("seed: 1\ntrain: {n_cars: 2, car_body: {mass: 30 t}}\n")
    (tmp_path / "over.yaml").write_text("extends: base.yaml\ntrain: {n_cars: 3}\n")
    (tmp_path / "last.yaml").write_text("seed: 7\n")
    config = load_config(tmp_path / "over.yaml", tmp_path / "last.yaml")
    assert (config.seed, config.train.n_cars) == (7, 3)
    assert_allclose(config.train.car_body.mass, 30_000)


def test_another_law_replaces_the_spectrum_below_it_as_a_whole():
    base = {"irregularity": {"vertical": {"law": "power", "exponent": 2.0}}}
    over = {"irregularity": {"vertical": {"law": "german"}}}
    assert overlay(base, over) == over


def test_a_users_limit_state_drives_and_a_shipped_one_does_not():
    shipped = Config()
    assert shipped.responses_of_designs == PAPER_RESPONSES
    assert not any(state.drives for state in shipped.limit_states.values())
    own = {"response": "girder_acceleration_y", "limit": "0.2 m/s^2"}
    study = {"responses": ["girder_displacement_z"]}
    found = from_mapping({"study": study, "limit_states": {"P(a > 0.2)": own}})
    assert found.responses_of_designs == ("girder_displacement_z", "girder_acceleration_y")
    assert {"girder_acceleration_y", "car_body_acceleration_z"} < set(found.responses_of_study)
    joined = from_mapping({"study": study, "limit_states": {"both": {"all_of": ["ride", "lost"]}}})
    assert joined.responses_of_designs == ("girder_displacement_z", "car_body_acceleration_z")
    chosen = {"asm": {"responses": ["girder_displacement_y"]}}
    assert from_mapping({"study": chosen}).responses_of_designs == ("girder_displacement_y",)


def test_a_limit_state_written_in_full_replaces_the_shipped_one():
    softer = from_mapping({"limit_states": {"ride": {"limit": "0.5 m/s^2"}}}).limit_states["ride"]
    assert softer.threshold == 0.5
    assert (softer.drives, softer.target) == (False, 2.74e-5)
    own = {"response": "car_body_acceleration_z", "limit": "50 cm/s^2"}
    mine = from_mapping({"limit_states": {"ride": own}}).limit_states["ride"]
    assert_allclose(mine.threshold, 0.5)
    assert (mine.drives, mine.target, mine.source) == (True, None, "")
    assert "ride" not in from_mapping({"limit_states": {"ride": None}}).limit_states
    state = {"response": "car_body_acceleration_z", "limit": "25e-2"}  # a number to no YAML
    with pytest.raises(ConfigError, match=r"limit must carry its unit, such as '0.25 m/s\^2'"):
        from_mapping({"limit_states": {"mine": state}})


def test_a_threshold_moves_no_part_but_that_of_the_limit_states():
    def parts(limit, name="ride"):
        own = {"response": "girder_displacement_y", "limit": "1 m"}
        config = from_mapping(
            {
                "study": {"responses": ["girder_displacement_z"]},
                "limit_states": {"ride": {"limit": limit}, "sway": own},
            }
        )
        part = named(name).slice(config, "validation", "asm")
        again = from_mapping(part)  # as the stage reads it
        assert named(name).slice(again, "validation", "asm") == part
        return part

    for name in ("design", "surrogate", "density", "limits", "eev"):
        assert parts("0.5 m/s^2", name) == parts("0.6 m/s^2", name)
    assert parts("0.5 m/s^2", "limit_states") != parts("0.6 m/s^2", "limit_states")
    assert "girder_displacement_y" in parts("0.5 m/s^2", "surrogate")["study"]["responses"]


def test_null_removes_a_case_and_the_written_configuration_says_so(tmp_path):
    config = from_mapping({"cases": {"all_gains": None, "mine": {"methods": ["mcm"]}}})
    assert "all_gains" not in config.cases
    assert config.cases["mine"].methods == ("mcm",)
    written = {"cases": config.quantities()["cases"]}
    (tmp_path / "c.yaml").write_text(config_text(written, tmp_path))
    assert load_config(tmp_path / "c.yaml").cases == config.cases


def test_a_configuration_can_be_hashed_and_a_case_brings_its_spans():
    config = Config()
    assert hash(config) == hash(from_mapping({}))
    assert config.of_case("all_gains").guideway.n_spans == 20
    with pytest.raises(ValueError, match="there is no case 'al_gains', known are: validation"):
        config.of_case("al_gains")


def test_names_of_files_are_relative_to_the_file_they_stand_in(tmp_path, monkeypatch):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "profile.csv").write_text("x,vertical,lateral\n")
    there = tmp_path / "there" / "c.yaml"
    there.write_text("irregularity: {profile_file: profile.csv}\n")
    monkeypatch.chdir(tmp_path)
    config = load_config("there/c.yaml")
    assert config.irregularity.profile_file == "there/profile.csv"
    (tmp_path / "copy").mkdir()
    part = {"irregularity": config.quantities()["irregularity"]}
    (tmp_path / "copy" / "c.yaml").write_text(config_text(part, "copy"))
    assert load_config("copy/c.yaml").irregularity == config.irregularity


def test_what_is_written_reads_back_the_same(tmp_path):
    config = load_config(ROOT / "config" / "quick.yaml")
    (tmp_path / "c.yaml").write_text(config_text(config.quantities(), tmp_path))
    again = load_config(tmp_path / "c.yaml")
    assert again.model_copy(update={"validation": config.validation}) == config


def test_the_shipped_configuration_states_every_default():
    text = (ROOT / "config" / "config.yaml").read_text(encoding="utf-8")
    assert text == catalogue.default_config(), "run `make docs`"
    shipped = load_config(ROOT / "config" / "config.yaml")
    measurements = Config().validation.measurements
    assert Path(shipped.validation.measurements).name == Path(measurements).name
    assert shipped.model_copy(update={"validation": Config().validation}) == Config()


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("workflow/schemas/config.schema.yaml", catalogue.schema),
        ("docs/parameters.md", catalogue.parameter_tables),
        ("docs/datasets.md", catalogue.dataset_tables),
        ("docs/stages.md", catalogue.stage_tables),
    ],
)
def test_files_written_from_the_classes_are_current(name, made):
    assert (ROOT / name).read_text(encoding="utf-8") == made(), "run `make docs`"


def test_the_schema_accepts_the_defaults_and_refuses_what_it_does_not_know():
    schema = yaml.safe_load(catalogue.schema())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    assert validator.is_valid(Config().quantities())
    assert not validator.is_valid({"passage": {"sped": "430 km/h"}})
    assert not validator.is_valid({"passage": {"speed": 430}})


def test_every_key_of_the_schema_has_a_description_and_no_object_is_open():
    def check(node, path):
        if node.get("type") == "object":
            assert node["additionalProperties"] is False, path
            for name, inner in node["properties"].items():
                assert inner.get("description"), f"{path}.{name}"
                check(inner, f"{path}.{name}")
        for inner in node.get("oneOf", ()):
            check(inner, path)

    check(yaml.safe_load(catalogue.schema()), "config")


def test_the_measurements_are_read_with_unit_source_and_confidence():
    measured = load_measurements(ROOT / "config" / "measurements" / "shanghai.yaml")
    assert_allclose(measured.first_vertical_frequency.value, 10.35)
    (peak,) = measured.peak_deflection
    assert_allclose([peak.value, peak.speed], [1.712e-3, 300 / 3.6])
    assert peak.confidence == "low"


def test_a_measurement_without_its_unit_is_refused(tmp_path):
    text = (ROOT / "config" / "measurements" / "shanghai.yaml").read_text()
    (tmp_path / "m.yaml").write_text(text.replace("1.712 mm", "1.712"))
    with pytest.raises(ConfigError, match=r"peak_deflection\.0\.value must carry its unit"):
        load_measurements(tmp_path / "m.yaml")
