"""Laws of random quantities: the moments that are asked for, by OpenTURNS, and what is refused."""

import numpy as np
import openturns as ot
import pytest
from numpy.testing import assert_allclose

from maglev.config import from_mapping, load_config
from maglev.errors import ConfigError
from maglev.laws import distribution
from maglev.parameters import Config, Law


def made(**law):
    """A distribution of a mass that is configured as 39 t."""
    return distribution(Law(**law), 39e3, "kg", "mass")


OTHERS = {
    "normal": ({"coefficient_of_variation": 0.1}, ot.Normal(39e3, 3.9e3)),
    "lognormal": (
        {"mean": "30 t", "coefficient_of_variation": 0.3},
        ot.ParametrizedDistribution(ot.LogNormalMuSigma(30e3, 9e3, 0.0)),
    ),
    "uniform": ({"low": "29 t", "high": "39 t"}, ot.Uniform(29e3, 39e3)),
    "triangular": (
        {"low": "29 t", "high": "39 t", "mode": "31 t"},
        ot.Triangular(29e3, 31e3, 39e3),
    ),
    "truncated_normal": (
        {"mean": "35 t", "deviation": "3 t", "low": "29 t"},
        ot.TruncatedDistribution(ot.Normal(35e3, 3e3), 29e3, ot.TruncatedDistribution.LOWER),
    ),
    "gumbel": (
        {"mean": "35 t", "deviation": "3 t"},
        ot.ParametrizedDistribution(ot.GumbelMuSigma(35e3, 3e3)),
    ),
    "weibull": (
        {"mean": "35 t", "deviation": "3 t", "low": "20 t"},
        ot.ParametrizedDistribution(ot.WeibullMinMuSigma(35e3, 3e3, 20e3)),
    ),
    "beta": (
        {"mean": "33 t", "deviation": "2 t", "low": "29 t", "high": "39 t"},
        ot.ParametrizedDistribution(ot.BetaMuSigma(33e3, 2e3, 29e3, 39e3)),
    ),
}


@pytest.mark.parametrize("law", OTHERS)
def test_every_law_is_that_of_another_library(law):
    given, other = OTHERS[law]
    found = made(law=law, **given)
    shares = np.array([1e-4, 0.01, 0.3, 0.5, 0.9, 0.999])
    expected = [other.computeQuantile(float(share))[0] for share in shares]
    assert_allclose(found.ppf(shares), expected, rtol=1e-7)
    assert_allclose(found.isf(1.0 - shares), expected, rtol=1e-7)
    assert_allclose(found.mean(), other.getMean()[0], rtol=1e-7)
    assert_allclose(found.std(), other.getStandardDeviation()[0], rtol=1e-6)
    assert_allclose([found.cdf(float(x)) for x in expected], shares, rtol=1e-6)


def test_a_table_of_quantiles_is_linear_between_its_rows():
    found = made(law="quantiles", quantiles=[[0, "29 t"], [0.25, "30 t"], [1, "39 t"]])
    assert_allclose(found.ppf([0.125, 0.25, 0.625]), [29.5e3, 30e3, 34.5e3])


def test_a_sample_keeps_its_quantiles():
    drawn = np.random.default_rng(1).gumbel(35.0, 2.0, 400)
    found = made(law="sample", values=[f"{one!r} t" for one in drawn.tolist()])
    shares = np.linspace(0.02, 0.98, 25)
    assert_allclose(found.ppf(shares), 1e3 * np.quantile(drawn, shares), rtol=2e-3)
    assert_allclose(found.mean(), 1e3 * drawn.mean(), rtol=2e-3)


def test_discrete_values_have_their_probabilities():
    found = made(law="discrete", values=["39 t", "29 t"], probabilities=[0.3, 0.7])
    assert_allclose(found.ppf([0.1, 0.69, 0.71, 1.0]), [29e3, 29e3, 39e3, 39e3])
    assert_allclose(found.isf([0.1, 0.29, 0.31]), [39e3, 39e3, 29e3])
    assert_allclose(found.cdf([28e3, 29e3, 38e3, 39e3]), [0.0, 0.7, 0.7, 1.0])
    assert_allclose(found.mean(), 32e3)
    assert_allclose(found.std(), 10e3 * np.sqrt(0.21))


REFUSED = {
    "neither": ({}, "a law 'normal' needs coefficient_of_variation or deviation, got neither"),
    "both": (
        {"coefficient_of_variation": 0.1, "deviation": "1 t"},
        "a law 'normal' needs coefficient_of_variation or deviation, got both",
    ),
    "bounds": (
        {"deviation": "1 t", "low": "3 t"},
        "a law 'normal' goes by mean, coefficient_of_variation, deviation, got low besides",
    ),
    "one bound": ({"law": "uniform", "low": "1 t"}, "a law 'uniform' needs high"),
    "unit": ({"deviation": "1 m"}, "deviation must be given in kg or a unit that converts to it"),
    "no unit": ({"deviation": 3.0}, "deviation must carry its unit, such as '3.0 kg'"),
    "turned": (
        {"law": "uniform", "low": "4 t", "high": "3 t"},
        "low must be less than high, got 4000 and 3000 kg",
    ),
    "moments": (
        {"law": "beta", "low": "29 t", "high": "39 t", "deviation": "6 t", "mean": "33 t"},
        "no beta law between 29000 and 39000 kg has the mean 33000 and the deviation 6000",
    ),
    "weibull": (
        {"law": "weibull", "mean": "3 t", "low": "4 t", "deviation": "1 t"},
        "the mean of a Weibull law must exceed its low = 4000 kg",
    ),
    "lognormal": (
        {"law": "lognormal", "mean": "-3 t", "deviation": "1 t"},
        "a lognormal quantity has a mean above zero, got -3000 kg",
    ),
    "table": (
        {"law": "quantiles", "quantiles": [[0, "3 t"], [0.5, "2 t"], [1, "4 t"]]},
        "quantiles must rise in probability, from 0 to 1, and in value, got [0, 3000], "
        "[0.5, 2000], [1, 4000]",
    ),
    "shares": (
        {"law": "discrete", "values": ["3 t", "4 t"], "probabilities": [0.3, 0.3]},
        "probabilities must be 2 numbers above zero whose sum is 1, got 0.3, 0.3",
    ),
    "few": ({"law": "sample", "values": ["3 t"]}, "a sample needs at least 10 values, got 1"),
}


@pytest.mark.parametrize("mistake", REFUSED)
def test_what_cannot_be_met_is_refused(mistake):
    law, sentence = REFUSED[mistake]
    with pytest.raises(ValueError) as caught:
        made(**law)
    assert sentence in str(caught.value)
    assert str(caught.value).startswith("mass: ")


def test_mass_where_the_model_makes_no_sense_is_refused_with_its_probability():
    law = {"train.car_body.mass": {"law": "normal", "coefficient_of_variation": 0.4}}
    with pytest.raises(ConfigError, match=r"0\.62 % of the law lies where the model makes no sen"):
        from_mapping({"cases": {"a": {"random": law}}})
    law = {"train.suspension_magnet.gap_reference": {"law": "uniform", "low": "0.1 mm",
                                                     "high": "10 mm"}}  # fmt: skip
    with pytest.raises(ConfigError, match=r"4 % of the law lies where .* must lie between passage"):
        from_mapping({"cases": {"a": {"random": law}}})


def test_a_sample_is_read_from_the_file_that_the_configuration_names(tmp_path):
    (tmp_path / "masses.csv").write_text(
        "mass [t],car\n" + "\n".join(f"{m},1" for m in range(29, 40))
    )
    random = "{train.car_body.mass: {law: sample, file: masses.csv}}"
    (tmp_path / "a.yaml").write_text(f"cases: {{a: {{random: {random}}}}}")
    config = load_config(tmp_path / "a.yaml")
    assert_allclose(config.distribution("a", "train.car_body.mass").ppf([0.0, 0.5]), [29e3, 34e3])
    for text, sentence in (
        ("29\n30\n", r"masses\.csv, line 1: expected a heading such as 'mass \[t\]'"),
        ("mass [t]\n29\nheavy\n", r"masses\.csv, line 3: expected a number, got 'heavy'"),
    ):
        (tmp_path / "masses.csv").write_text(text)
        with pytest.raises(ConfigError, match=sentence):
            load_config(tmp_path / "a.yaml")


def test_a_sweep_makes_cases_of_one_and_reads_back_the_same():
    over = {"passage.speed": ["300 km/h", "400 km/h"], "guideway.n_spans": [3, 5, 7]}
    config = from_mapping({"only": ["a"], "cases": {"a": {"sweep": over, "methods": ["asm"]}}})
    assert list(config.cases) == ["a", *(f"a_{j}_{k}" for j in (1, 2) for k in (1, 2, 3))]
    made = config.of_case("a_2_3")
    assert_allclose(made.passage.speed, 400 / 3.6)
    assert made.guideway.n_spans == 7
    again = Config.model_validate(config.quantities())
    assert again.cases == config.cases
    for wrong, sentence in (
        ({"passage.speed": ["300 km/h"]}, "needs at least two values, got 1"),
        ({"gains.suspension_derivative": ["10 A s/m", "20 A s/m"]}, "is both swept and random"),
        ({"passage.speed": ["300 km/h", "400 kg"]}, "must be given in m/s"),
    ):
        with pytest.raises(ConfigError, match=sentence):
            from_mapping({"cases": {"a": {"sweep": wrong}}})


def test_a_case_whose_tracks_differ_is_counted_only():
    case = from_mapping({"cases": {"a": {"track": "random", "methods": ["mcm", "asm"]}}}).cases["a"]
    assert case.possible_methods == ("mcm",)
