"""Probabilities that a surrogate proposes and runs correct: unbiased whatever the surrogate.

All inputs are standard normal.  With the surrogate's event Â and the runs' event A,

    P(A) = E_law[1_Â] + E_q[w (1_A − 1_Â)],

the first mean over a large population, the second over runs drawn from it where the surrogate may
be wrong.  A batch trains the surrogate of the next one only after it has been counted, so each is
independent of what it corrects.  The same runs serve all responses, limit states and levels.
Theory: docs/theory/checked.md, sec. 1 and 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.spatial.distance import cdist
from scipy.stats import gamma, norm, t

from maglev.arrays import BoolArray, FloatArray
from maglev.errors import UserError
from maglev.uncertainty.exploration import empty_half_space, exploring_points
from maglev.uncertainty.failure_region import fit_failure_region
from maglev.uncertainty.kriging import conditioned_kriging, fit_kriging
from maglev.uncertainty.line_sampling import equivalent_runs
from maglev.uncertainty.reliability import Limits
from maglev.uncertainty.samples import effective_size
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

WIDTHS = (1.0, 1.5, 2.0)
"""Deviations of the normal laws that a population is drawn from [-]; the first is the law itself.
Assumed: twice the deviation reaches what has a probability of 1e-6 once in a hundred draws."""

LAW_SHARE, WIDE_SHARE = 0.3, 0.2
"""Shares of the law and of the wider ones in a population; the rest lies around the surrogate's
tails.  Assumed; the first bounds the weights of the population."""

N_CENTRES, KERNEL = 64, 0.8
"""Places around which a tail is drawn, and the deviation about each [-]; assumed."""

DEFENCE = 0.2
"""Share of the runs drawn from the population as a whole and from the law, half each; assumed.  It
bounds the weight of a run."""

HEAVY = 7
"""Degrees of freedom of the surrogate's error as far as runs are placed by it; assumed, so that a
surrogate that is too sure of itself is still checked some way off."""

N_OUTCOMES = 16
"""Draws of the responses by which the doubt about a limit state is found; assumed."""

MOST_FITTED, MOST_TRAINED = 160, 500
"""Runs by which the surrogate's lengths are found, and runs it is then conditioned on; assumed,
bounds of the time that a fit takes."""

APART = 0.02
"""Distance of runs below which the later one does not train [-]; assumed: closer ones make the
covariance matrix singular."""

LARGEST_SHARE = 0.3
"""Share of one run in a probability above which nothing is concluded; assumed."""

REFUTED, MOST_REFUTED = 4.0, 0.1
"""Deviations by which a run refutes the surrogate's doubt, and the share of such runs above which
nothing is concluded; assumed: the doubt says how much could have been missed."""

N_PLACES = 400
"""Places at which an exceedance is found to invert it; assumed."""

State = Callable[[FloatArray, BoolArray], BoolArray]
"""A limit state: from extremes (run, response), NaN where lost, and lost (run,), who fails."""

Run = Callable[[FloatArray], tuple[FloatArray, BoolArray]]
"""Runs points (run, parameter): extremes (run, response), NaN where lost, and lost (run,)."""


@dataclass(frozen=True, kw_only=True)
class Proxy:
    """What stands for the runs.

    Parameters
    ----------
    predict
        Values (point, response) at points (point, parameter) [unit of each response].
    deviation
        Their standard deviations (point, response) [unit].
    lost_probability
        Probability (point,) that a point is lost [-].
    """

    predict: Callable[[FloatArray], FloatArray]
    deviation: Callable[[FloatArray], FloatArray]
    lost_probability: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Runs and their outcomes.

    Parameters
    ----------
    points : (run, parameter)
        Standard normal points [-].
    values : (run, response)
        Extremes [unit of each response], NaN where lost.
    lost : (run,) of bool
        Which were lost.
    """

    points: FloatArray
    values: FloatArray
    lost: BoolArray

    def and_of(self, other: Runs) -> Runs:
        """These runs and other ones."""
        return Runs(
            points=np.concatenate([self.points, other.points]),
            values=np.concatenate([self.values, other.values]),
            lost=np.concatenate([self.lost, other.lost]),
        )


Fit = Callable[[Runs, np.random.Generator], Proxy]
"""Makes what stands for the runs from those so far."""


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is wanted, and how well.

    Parameters
    ----------
    levels
        Failure probabilities whose limits are wanted for every response [-].
    limit_half_width
        Half width of each limit's interval, in deviations of the response, at which it is known
        well enough [-].
    states
        Limit states by name; their probabilities are wanted.  Loss is always among them.
    state_half_width
        Half width of the interval of each of them over its estimate [-].
    confidence
        Two-sided confidence of all intervals [-].
    """

    levels: tuple[float, ...] = (1e-2, 1e-3)
    limit_half_width: float = 0.1
    states: Mapping[str, State] = field(default_factory=dict)
    state_half_width: float = np.inf
    confidence: float = 0.95

    def __post_init__(self) -> None:
        if not self.levels or not all(0.0 < level < 1.0 for level in self.levels):
            raise UserError(f"levels must lie in (0, 1) and be one or more, got {self.levels}")
        if not (self.limit_half_width > 0.0 and self.state_half_width > 0.0):
            raise UserError(
                f"half widths must be positive, got {self.limit_half_width} and "
                f"{self.state_half_width}"
            )
        if not 0.0 < self.confidence < 1.0:
            raise UserError(f"confidence must lie in (0, 1), got {self.confidence}")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much may be spent.

    Parameters
    ----------
    n_batch
        Runs of a batch.
    n_exploring
        How many of them go where no run has been, as long as a half-space as likely as the
        smallest level is empty.  They train and do not correct.
    n_largest
        Largest number of runs, those of the first design among them.
    n_population
        Points of the population of each batch.
    """

    n_batch: int = 64
    n_exploring: int = 8
    n_largest: int = 500
    n_population: int = 2**16

    def __post_init__(self) -> None:
        if not (0 <= self.n_exploring <= self.n_batch - 2 and self.n_population >= 100):
            raise UserError(
                "a batch must have two runs or more beside those that explore, and a population "
                f"100 points or more, got {self.n_batch}, {self.n_exploring} and "
                f"{self.n_population}"
            )


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A probability with its interval.

    Parameters
    ----------
    probability, lower, upper
        Estimate and ends of its interval [-].
    largest_share
        Largest share of one run's correction in the estimate [-].
    equivalent_runs
        Runs of crude Monte Carlo with as narrow an interval [-].
    status
        ``"given"``, or ``"too_few_exceedances"`` where one run carries too much, or the runs
        refute the surrogate's own doubt.
    """

    probability: float
    lower: float
    upper: float
    largest_share: float
    equivalent_runs: float
    status: str


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What the runs say.

    Parameters
    ----------
    limits, held_limits : (response,)
        Limits of each response at the levels asked, of all passages and of those that hold.
    lost
        Probability of loss.
    states
        Probabilities of the limit states asked, by name.
    n_runs
        Runs spent, those of the first design among them.
    n_checked
        Runs that correct.
    effective_runs
        Kish's effective number of the correcting runs under the law [-].
    largest_weight
        Largest weight of one of them [-].
    equivalent_runs : (response, level)
        Runs of crude Monte Carlo that know the probability of each limit as well [-].
    unvisited
        Probability of the likeliest half-space without a run [-].
    stopped
        ``"known_as_asked"`` or ``"largest_number_of_runs"``.
    """

    limits: tuple[Limits, ...]
    held_limits: tuple[Limits, ...]
    lost: Estimate
    states: Mapping[str, Estimate]
    n_runs: int
    n_checked: int
    effective_runs: float
    largest_weight: float
    equivalent_runs: FloatArray
    unvisited: float
    stopped: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Points of a batch and all that is needed to count them.

    Parameters
    ----------
    points : (run, parameter)
        Points that were drawn, all different [-].
    exploring : (exploring run, parameter)
        Points to run beside them, which count nothing [-].
    repeats : (run,)
        How often each was drawn.
    weight : (run,)
        Density of the law over that of the draw [-].
    predicted, deviation : (run, response)
        The surrogate's values there, and their deviations [unit].
    predicted_lost : (run,) of bool
        Whether the surrogate takes them for lost.
    population : (point, response)
        The surrogate's values over the population [unit].
    population_lost : (point,) of bool
        Whether the surrogate takes its points for lost.
    population_weight : (point,)
        Weights of the population under the law [-].
    missed : (target,)
        Mean weight of a run that would show the surrogate wrong, by its own doubt [-]: for each
        response and level, then each state, then loss.
    trust
        What the batch counts for among the batches, over its runs [-].
    """

    points: FloatArray
    exploring: FloatArray
    repeats: FloatArray
    weight: FloatArray
    predicted: FloatArray
    deviation: FloatArray
    predicted_lost: BoolArray
    population: FloatArray
    population_lost: BoolArray
    population_weight: FloatArray
    missed: FloatArray
    trust: float

    @property
    def to_run(self) -> FloatArray:
        """All points (run + exploring run, parameter) of the batch, in this order."""
        return np.concatenate([self.points, self.exploring])

    @property
    def n_draws(self) -> float:
        """Draws, repeated ones counted as often as they came."""
        return float(self.repeats.sum())


def checked(
    run: Run,
    fit: Fit,
    first: Runs,
    asked: Asked,
    settings: Settings,
    seed: int,
    batches: Sequence[Runs] = (),
) -> Answer:
    """Limits and probabilities by a surrogate and the runs that correct it.

    A fold over batches: given those of an interrupted one, it goes on with the same numbers.

    Parameters
    ----------
    run
        Runs points.
    fit
        Makes the surrogate from the runs so far, such as `kriging_proxy`.
    first
        Runs of the first design, which train and do not correct.
    asked
        What is wanted.
    settings
        Sizes.
    seed
        Of all that is drawn; batch b has its own stream.
    batches
        Outcomes of the batches that were run before, in order.

    Returns
    -------
    answer
        Limits, probabilities and what they cost.

    Raises
    ------
    UserError
        If no batch fits into the runs allowed, or a stored batch is not the one that is due.

    References
    ----------
    Dubourg, Deheeger, Sudret (2011), arXiv 1105.0562 (meta-model importance sampling); Särndal,
    Swensson, Wretman, Model Assisted Survey Sampling (1992), ch. 6 (difference estimator);
    docs/theory/checked.md, eqs. (1) to (5).

    Examples
    --------
    >>> def run(points):
    ...     return np.exp(0.3 * points[:, :1]) + points[:, 1:], np.zeros(len(points), dtype=bool)
    >>> points = np.random.default_rng(0).standard_normal((30, 2))
    >>> design = Runs(points=points, values=run(points)[0], lost=run(points)[1])
    >>> asked = Asked(levels=(1e-3,))
    >>> answer = checked(run, kriging_proxy, design, asked, Settings(n_largest=100), 1)
    >>> answer.stopped
    'known_as_asked'
    >>> lower, upper = answer.limits[0].interval
    """
    plans: list[Plan] = []
    outcomes: list[Runs] = []
    sofar, answer = first, None
    unvisited = _unvisited(first, seed)
    for number in range(settings.n_largest):
        rng = np.random.default_rng([seed, number])
        n_new = min(settings.n_batch, settings.n_largest - sofar.lost.size)
        if n_new < settings.n_exploring + 2:
            break
        n_exploring = settings.n_exploring if unvisited > min(asked.levels) else 0
        need = None if answer is None else _needs(answer, asked, sofar)
        plan = planned(
            fit(sofar, rng), sofar, asked, n_new - n_exploring, settings, rng, need, n_exploring
        )
        outcome = _stored(batches[number], plan) if number < len(batches) else _run(run, plan)
        plans.append(plan)
        outcomes.append(outcome)
        sofar = sofar.and_of(outcome)
        unvisited = _unvisited(sofar, seed)
        answer = replace(_counted(plans, outcomes, asked, sofar.lost.size), unvisited=unvisited)
        if unvisited <= min(asked.levels) and _known(answer, asked, sofar):
            return replace(answer, stopped="known_as_asked")
    if answer is None:
        raise UserError(
            f"correcting takes runs beside the {first.lost.size} of the first design, but only "
            f"{settings.n_largest} are allowed in all; allow more"
        )
    return answer


def _run(run: Run, plan: Plan) -> Runs:
    """Outcomes of a batch."""
    values, lost = run(plan.to_run)
    return Runs(points=plan.to_run, values=values, lost=lost)


def _stored(outcome: Runs, plan: Plan) -> Runs:
    """A stored batch, if it is the one that is due."""
    if not np.array_equal(outcome.points, plan.to_run):
        raise UserError(
            "a stored batch was drawn at other points than are due; use the seed, the first "
            "design and the settings it was made with"
        )
    return outcome


def _unvisited(runs: Runs, seed: int) -> float:
    """Probability of the likeliest half-space without a run."""
    return empty_half_space(runs.points, np.random.default_rng(seed)).probability


def kriging_proxy(runs: Runs, rng: np.random.Generator) -> Proxy:
    """Kriging of each response and the learnt region of loss.

    The posterior deviation is enlarged where leave-one-out residuals are larger than theirs.

    Parameters
    ----------
    runs
        Runs so far.
    rng
        Source of the borders of the region of loss.

    Returns
    -------
    proxy
        What stands for the runs.

    Raises
    ------
    UserError
        As `maglev.uncertainty.kriging.fit_kriging`.

    Examples
    --------
    >>> points = np.random.default_rng(0).standard_normal((20, 1))
    >>> runs = Runs(points=points, values=np.sin(points), lost=np.zeros(20, dtype=bool))
    >>> proxy = kriging_proxy(runs, np.random.default_rng(1))
    >>> bool(abs(proxy.predict(np.array([[0.3]]))[0, 0] - np.sin(0.3)) < 0.01)
    True
    """
    held = ~runs.lost
    points, values = thinned(runs.points[held], runs.values[held])
    fitted = fit_kriging(points[:MOST_FITTED], values[:MOST_FITTED])
    if len(points) > MOST_FITTED:
        amplitude = fitted.amplitude * (fitted.deviation / values.std(axis=0)) ** 2
        fitted = conditioned_kriging(points, values, length=fitted.length, amplitude=amplitude)
    scaled = np.abs(fitted.leave_one_out() / fitted.leave_one_out_deviation())
    factor = np.sqrt(np.maximum(np.mean(scaled**2, axis=0), 1.0))
    lost_probability: Callable[[FloatArray], FloatArray] = lambda points: np.zeros(len(points))  # noqa: E731
    if runs.lost.any():
        lost_probability = fit_failure_region(runs.points, runs.lost, rng).lost_probability
    return Proxy(
        predict=fitted.predict,
        deviation=lambda points: factor * fitted.standard_deviation(points),
        lost_probability=lost_probability,
    )


def thinned(points: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Runs none of which lies close to an earlier one, the first `MOST_TRAINED` of them.

    Parameters
    ----------
    points : (run, parameter)
        Standard normal points [-].
    values : (run, response)
        Their extremes.

    Returns
    -------
    points, values
        The runs that are left.

    Examples
    --------
    >>> points, _ = thinned(np.array([[0.0], [0.001], [1.0]]), np.zeros((3, 1)))
    >>> points[:, 0]
    array([0., 1.])
    """
    near = np.tril(cdist(points, points) < APART, -1)
    kept = ~near.any(axis=1)
    return points[kept][:MOST_TRAINED], values[kept][:MOST_TRAINED]


def planned(
    proxy: Proxy,
    sofar: Runs,
    asked: Asked,
    n_draws: int,
    settings: Settings,
    rng: np.random.Generator,
    need: FloatArray | None = None,
    n_exploring: int = 0,
) -> Plan:
    """Draw the points of a batch where the surrogate may be wrong.

    Parameters
    ----------
    proxy
        The surrogate.
    sofar
        Runs that trained it.
    asked
        What is wanted.
    n_draws
        Draws of the batch; one that comes twice is run once.
    settings
        Size of the population.
    rng
        Source of population and draws.
    need : (target,), optional
        Shares of the targets [-]; equal if not given.
    n_exploring
        Points beside the draws, where no run has been.

    Returns
    -------
    plan
        Points with weights, and the population they were drawn from.

    References
    ----------
    docs/theory/checked.md, eqs. (2) and (3).

    Examples
    --------
    >>> runs = Runs(points=np.zeros((1, 2)), values=np.zeros((1, 1)), lost=np.zeros(1, dtype=bool))
    >>> proxy = Proxy(
    ...     predict=lambda points: points[:, :1],
    ...     deviation=lambda points: np.full((len(points), 1), 0.1),
    ...     lost_probability=lambda points: np.zeros(len(points)),
    ... )
    >>> rng = np.random.default_rng(0)
    >>> plan = planned(proxy, runs, Asked(levels=(1e-3,)), 32, Settings(), rng)
    >>> bool(1.0 / plan.weight.min() > 20.0)  # near the limit, 20 times as often as under the law
    True
    """
    n = settings.n_population
    points, weight = tail_population(proxy, n, sofar.points.shape[1], asked, rng)
    seen = _Seen.at(proxy, points, weight, asked, rng)
    doubts = seen.doubts()
    shares = np.sqrt(doubts) * weight
    vague = shares.sum(axis=1) == 0.0  # no doubt to go by: the population as it is
    shares[vague], doubts[vague] = 1.0, 1.0
    need = np.ones(len(shares)) if need is None else need
    chance = need / need.sum() @ (shares / shares.sum(axis=1, keepdims=True))
    defence = 0.5 * (1.0 / n + weight / weight.sum())
    chance = (1.0 - DEFENCE) * chance + DEFENCE * defence[: len(chance)]
    of_draw = weight / (len(weight) * chance)
    drawn, repeats = np.unique(
        rng.choice(len(chance), n_draws, p=chance / chance.sum()), return_counts=True
    )
    return Plan(
        points=points[drawn],
        exploring=_exploring(sofar, points[drawn], n_exploring, min(asked.levels), rng),
        repeats=repeats.astype(float),
        weight=of_draw[drawn],
        predicted=seen.values[drawn],
        deviation=seen.deviation[drawn],
        predicted_lost=seen.lost[drawn],
        population=seen.values,
        population_lost=seen.lost,
        population_weight=weight,
        missed=(doubts @ (weight * of_draw)) / (doubts @ weight),
        trust=float(sofar.lost.size),
    )


def _exploring(
    sofar: Runs, drawn: FloatArray, n_new: int, level: float, rng: np.random.Generator
) -> FloatArray:
    """Points (exploring run, parameter) where neither a run nor a draw has been."""
    if n_new == 0:
        return np.empty((0, drawn.shape[1]))
    known = np.concatenate([sofar.points, drawn])
    return exploring_points(known, n_new, float(norm.isf(level)), rng)


def tail_population(
    proxy: Proxy, n: int, n_inputs: int, asked: Asked, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Weighted points of which many lie in the tails that are asked for.

    Parameters
    ----------
    proxy
        The surrogate that says where the tails are.
    n
        Number of points.
    n_inputs
        Number of inputs.
    asked
        Levels and limit states.
    rng
        Source of the points.

    Returns
    -------
    points : (n, n_inputs)
        Standard normal points [-].
    weight : (n,)
        Density of the law over theirs [-], at most 1/0.3.

    Examples
    --------
    >>> proxy = Proxy(
    ...     predict=lambda points: points[:, :1],
    ...     deviation=lambda points: np.full((len(points), 1), 0.1),
    ...     lost_probability=lambda points: np.zeros(len(points)),
    ... )
    >>> rng = np.random.default_rng(0)
    >>> points, weight = tail_population(proxy, 10000, 2, Asked(levels=(1e-5,)), rng)
    >>> bool(abs(1e5 * np.mean(weight * (points[:, 0] > 4.265)) - 1.0) < 0.2)
    True
    """
    pilot = np.concatenate(
        [width * rng.standard_normal((n // len(WIDTHS), n_inputs)) for width in WIDTHS]
    )
    equal = np.full(len(WIDTHS), 1.0 / len(WIDTHS))
    seen = _Seen.at(proxy, pilot, np.exp(-_log_widths(pilot, equal)), asked, rng)
    centres = np.concatenate(
        [
            pilot[rng.choice(len(pilot), N_CENTRES, p=chance / chance.sum())]
            for chance in np.sqrt(seen.weight) * seen.tails()
            if chance.sum() > 0.0
        ]
    )
    return _population(n, centres, rng)


def _counted(plans: Sequence[Plan], outcomes: Sequence[Runs], asked: Asked, n_runs: int) -> Answer:
    """What batches and their outcomes say.

    Parameters
    ----------
    plans, outcomes
        The batches, in order.
    asked
        What is wanted.
    n_runs
        Runs spent in all.

    Returns
    -------
    answer
        Limits and probabilities, as if the largest number of runs had been reached and nothing
        were known of the unvisited.

    References
    ----------
    Fay, Feuer, Stat. Med. 16 (1997) 791-801 (interval of a weighted count); Zou, Donner, Stat. Med.
    27 (2008) 1693-1702 (interval of a sum); docs/theory/checked.md, eqs. (4) to (8).
    """
    tally = _Tally(plans, outcomes, asked.confidence)
    lost = tally.estimate(lambda values, lost: lost, -1, False)
    n_levels, n_responses = len(asked.levels), plans[0].predicted.shape[1]
    states = {
        name: tally.estimate(state, n_responses * n_levels + k, bool(tally.refuted.any()))
        for k, (name, state) in enumerate(asked.states.items())
    }
    found = [
        [tally.limits(response, asked.levels, lost, held) for response in range(n_responses)]
        for held in (False, True)
    ]
    law = tally.weight * tally.repeats
    return Answer(
        limits=tuple(limits for limits, _ in found[0]),
        held_limits=tuple(limits for limits, _ in found[1]),
        lost=lost,
        states=states,
        n_runs=n_runs,
        n_checked=tally.weight.size,
        effective_runs=effective_size(law / law.sum()),
        largest_weight=float(tally.weight.max()),
        equivalent_runs=np.array([equal for _, equal in found[0]]),
        unvisited=1.0,
        stopped="largest_number_of_runs",
    )


def weighted_count_interval(
    total: FloatArray, squares: FloatArray, missed: FloatArray | float, confidence: float
) -> tuple[FloatArray, FloatArray]:
    """Interval of the expected sum of weights of events that come as a Poisson process.

    Parameters
    ----------
    total, squares : (...)
        Sum of the weights of the events seen, and of their squares [-].
    missed : (...)
        Weight of an event that was not seen, not below the largest seen [-]; it keeps the upper
        end from zero.
    confidence
        Two-sided confidence [-].

    Returns
    -------
    lower, upper : (...)
        Ends [-]; without an event from zero to 3.7 missed weights at 95 %.

    References
    ----------
    Fay, Feuer, Stat. Med. 16 (1997) 791-801.

    Examples
    --------
    >>> lower, upper = weighted_count_interval(np.array(3.0), np.array(3.0), 1.0, 0.95)
    >>> print(f"{lower:.2f} {upper:.2f}")  # the exact interval of a Poisson count of three
    0.62 8.77
    """
    outside = 0.5 * (1.0 - confidence)
    seen = total > 0.0
    sum_of, square = np.where(seen, total, 1.0), np.where(seen, squares, 1.0)
    lower = gamma.ppf(outside, sum_of**2 / square, scale=square / sum_of)
    more, more_square = total + missed, squares + np.square(missed)
    upper = gamma.ppf(1.0 - outside, more**2 / more_square, scale=more_square / more)
    return np.where(seen, lower, 0.0), upper


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """A population as the surrogate sees it, and the targets it is asked for."""

    values: FloatArray
    deviation: FloatArray
    lost_probability: FloatArray
    weight: FloatArray
    limits: FloatArray
    failing: FloatArray
    fails: BoolArray

    @classmethod
    def at(
        cls,
        proxy: Proxy,
        points: FloatArray,
        weight: FloatArray,
        asked: Asked,
        rng: np.random.Generator,
    ) -> _Seen:
        """Predictions at points, the limits they imply, and who fails each limit state."""
        values, deviation = proxy.predict(points), proxy.deviation(points)
        probability = proxy.lost_probability(points)
        lost = probability > 0.5
        limits = np.array(
            [_limits_of(np.where(lost, np.inf, one), weight, asked.levels) for one in values.T]
        )
        held = _unless(values, lost)
        fails = np.zeros((len(asked.states), len(points)), dtype=bool)
        for row, state in zip(fails, asked.states.values(), strict=True):
            row[:] = state(held, lost)
        failing = np.zeros(fails.shape)
        for _ in range(N_OUTCOMES if len(fails) else 0):
            away = rng.random(len(points)) < probability
            drawn = values + deviation * rng.standard_t(HEAVY, values.shape)
            outcome = [state(_unless(drawn, away), away) for state in asked.states.values()]
            failing += np.array(outcome) / N_OUTCOMES
        return cls(
            values=values,
            deviation=np.maximum(deviation, 1e-12 * values.std(axis=0)),
            lost_probability=probability,
            weight=weight,
            limits=limits,
            failing=failing,
            fails=fails,
        )

    @property
    def lost(self) -> BoolArray:
        """Who is taken for lost."""
        return self.lost_probability > 0.5

    def tails(self) -> FloatArray:
        """Probability (target, point) of being in each target's event."""
        held = 1.0 - self.lost_probability
        beyond = [
            held * t.sf((limit - values) / deviation, HEAVY)
            for values, deviation, limits in zip(
                self.values.T, self.deviation.T, self.limits, strict=True
            )
            for limit in limits
        ]
        return np.array([*beyond, *self.failing, self.lost_probability])

    def doubts(self) -> FloatArray:
        """Probability (target, point) that the surrogate is wrong on each target's event."""
        of_loss = np.minimum(self.lost_probability, 1.0 - self.lost_probability)
        held = 1.0 - self.lost_probability
        near = [
            held * t.sf(np.abs(limit - values) / deviation, HEAVY) + of_loss
            for values, deviation, limits in zip(
                self.values.T, self.deviation.T, self.limits, strict=True
            )
            for limit in limits
        ]
        states = np.abs(self.failing - self.fails)
        return np.array([*near, *states, of_loss])


class _Tally:
    """All batches together, ready to be counted."""

    def __init__(self, plans: Sequence[Plan], outcomes: Sequence[Runs], confidence: float) -> None:
        self.plans, self.confidence = plans, confidence
        trust = np.array([plan.n_draws * plan.trust for plan in plans])
        self.share = trust / trust.sum()
        self.repeats = np.concatenate([plan.repeats for plan in plans])
        self.weight = np.concatenate([plan.weight for plan in plans])
        self.part = self.weight * np.concatenate(
            [
                share * plan.repeats / plan.n_draws
                for share, plan in zip(self.share, plans, strict=True)
            ]
        )
        self.predicted = np.concatenate([plan.predicted for plan in plans])
        self.predicted_lost = np.concatenate([plan.predicted_lost for plan in plans])
        drawn = [
            (one.values[: len(plan.points)], one.lost[: len(plan.points)])
            for one, plan in zip(outcomes, plans, strict=True)
        ]
        self.values, self.lost = (np.concatenate(column) for column in zip(*drawn, strict=True))
        deviation = np.concatenate([plan.deviation for plan in plans])
        off = np.abs(self.values - self.predicted) > REFUTED * deviation
        counts = self.part / np.where(self.weight > 0.0, self.weight, 1.0) * ~self.lost
        self.refuted = counts @ off / max(counts.sum(), 1e-300) > MOST_REFUTED

    def missed(self, target: int) -> float:
        """Mean part of a run that would show the surrogate wrong on a target."""
        of_batch = [
            share**2 * plan.missed[target] / plan.n_draws
            for share, plan in zip(self.share, self.plans, strict=True)
        ]
        return float(np.sum(of_batch))

    def estimate(self, state: State, target: int, refuted: bool) -> Estimate:
        """Probability of a limit state; nothing is concluded if its surrogate is refuted."""
        base, variance = 0.0, 0.0
        for share, plan in zip(self.share, self.plans, strict=True):
            lost = plan.population_lost
            counts = plan.population_weight * state(_unless(plan.population, lost), lost)
            base += share * counts.mean()
            variance += share**2 * counts.var() / counts.size
        truly = state(_unless(self.values, self.lost), self.lost)
        thought = state(_unless(self.predicted, self.predicted_lost), self.predicted_lost)
        interval = self._interval(
            np.array([base]),
            np.array([variance]),
            truly[:, None],
            thought[:, None],
            self.missed(target),
        )
        probability, lower, upper, largest = (float(one[0]) for one in interval)
        return Estimate(
            probability=probability,
            lower=lower,
            upper=upper,
            largest_share=largest,
            equivalent_runs=equivalent_runs(probability, 0.5 * (upper - lower), self.confidence),
            status=TOO_FEW if largest > LARGEST_SHARE or refuted else GIVEN,
        )

    def limits(
        self, response: int, levels: tuple[float, ...], lost: Estimate, held: bool
    ) -> tuple[Limits, FloatArray]:
        """Limits of one response and the crude runs (level,) they equal."""
        away = -np.inf if held else np.inf
        values = np.where(self.lost, away, self.values[:, response])
        predicted = np.where(self.predicted_lost, away, self.predicted[:, response])
        sorted_base = [
            _sorted(np.where(plan.population_lost, away, plan.population[:, response]), plan)
            for plan in self.plans
        ]
        wanted = np.array(levels) * (1.0 - lost.probability if held else 1.0)
        places = _places(sorted_base[-1], values, predicted, wanted)
        base, variance = np.zeros((2, places.size))
        for share, (ordered, mass, square, n) in zip(self.share, sorted_base, strict=True):
            at = np.searchsorted(ordered, places, side="right")
            base += share * mass[at]
            variance += share**2 * np.maximum(square[at] - mass[at] ** 2, 0.0) / n
        curves = []
        for k in range(len(levels)):
            missed = self.missed(response * len(levels) + k)
            truly, thought = values[:, None] > places, predicted[:, None] > places
            curves.append(self._interval(base, variance, truly, thought, missed))
        limit, lower, upper, share, equal = np.full((5, len(levels)), np.nan)
        for k, (probability, low, high, largest) in enumerate(curves):
            limit[k], lower[k], upper[k] = (
                _inverted(places, one, wanted[k]) for one in (probability, low, high)
            )
            near = int(np.clip(np.searchsorted(places, limit[k]), 0, places.size - 1))
            share[k] = largest[near] * probability[near] / wanted[k]
            equal[k] = equivalent_runs(wanted[k], 0.5 * (high[near] - low[near]), self.confidence)
        status = tuple(
            INFINITE
            if np.isinf(y)
            else TOO_FEW
            if one > LARGEST_SHARE or self.refuted[response]
            else GIVEN
            for y, one in zip(limit, share, strict=True)
        )
        given = np.array(status) == GIVEN
        found = Limits(
            failure_probability=np.array(levels),
            limit=np.where(given, limit, np.nan),
            lower=np.where(given, lower, np.nan),
            upper=np.where(given, upper, np.nan),
            expected_exceedances=np.where(given, equal * wanted, 0.0),
            status=status,
            confidence=self.confidence,
        )
        return found, equal

    def _interval(
        self,
        base: FloatArray,
        variance: FloatArray,
        truly: BoolArray,
        thought: BoolArray,
        missed: float,
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Estimate, ends and largest share (event,) of events (run, event)."""
        more, less = truly & ~thought, thought & ~truly
        plus, low_plus, high_plus = self._counted(more, missed)
        minus, low_minus, high_minus = self._counted(less, missed)
        z = norm.ppf(0.5 + 0.5 * self.confidence)
        high_minus = np.minimum(high_minus, np.maximum(base, minus))
        estimate = np.maximum(base + plus - minus, 0.0)
        down = np.sqrt(z**2 * variance + (plus - low_plus) ** 2 + (high_minus - minus) ** 2)
        up = np.sqrt(z**2 * variance + (high_plus - plus) ** 2 + (minus - low_minus) ** 2)
        lower = np.maximum(estimate - down, low_plus)
        largest = np.max(self.part[:, None] * (more | less), axis=0, initial=0.0)
        share = largest / np.where(estimate > 0.0, estimate, np.where(largest > 0.0, largest, 1.0))
        return estimate, lower, np.minimum(estimate + up, 1.0), share

    def _counted(
        self, events: BoolArray, missed: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Sum of the parts of events (run, event), and ends of its interval."""
        total, squares = self.part @ events, self.part**2 @ events
        largest = np.max(self.part[:, None] * events, axis=0, initial=missed)
        return total, *weighted_count_interval(total, squares, largest, self.confidence)


def _log_widths(points: FloatArray, shares: FloatArray) -> FloatArray:
    """Logarithm (point,) of a mixture of wider normal densities over that of the law."""
    square, s = np.einsum("ij,ij->i", points, points), points.shape[1]
    parts = [
        np.log(share) + 0.5 * square * (1.0 - width**-2) - s * np.log(width)
        for share, width in zip(shares, WIDTHS, strict=True)
    ]
    return np.logaddexp.reduce(parts)


def _population(
    n: int, centres: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Points (point, parameter) from the law, wider ones and about centres, and their weights."""
    s, tails = centres.shape[1], 1.0 - LAW_SHARE - WIDE_SHARE
    wide = np.array([LAW_SHARE, 0.5 * WIDE_SHARE, 0.5 * WIDE_SHARE])
    sizes = (n * wide).astype(int)
    parts = [width * rng.standard_normal((k, s)) for k, width in zip(sizes, WIDTHS, strict=True)]
    centre = centres[np.arange(n - sizes.sum()) % len(centres)]
    points = np.concatenate([*parts, centre + KERNEL * rng.standard_normal(centre.shape)])
    about = np.zeros(n)
    for start in range(0, n, 4096):
        block = cdist(points[start : start + 4096], centres, "sqeuclidean")
        about[start : start + 4096] = np.exp(-0.5 * block / KERNEL**2).mean(axis=1) / KERNEL**s
    square = np.einsum("ij,ij->i", points, points)
    ratio = np.exp(_log_widths(points, wide)) + tails * about * np.exp(0.5 * square)
    return points, 1.0 / ratio


def _limits_of(values: FloatArray, weight: FloatArray, levels: tuple[float, ...]) -> FloatArray:
    """Limits (level,) of weighted values, the largest finite one where there is none."""
    order = np.argsort(-values)
    beyond = np.cumsum(weight[order]) / weight.sum()
    place = np.minimum(np.searchsorted(beyond, levels), values.size - 1)
    found = values[order][place]
    finite = values[np.isfinite(values)]
    return np.where(np.isfinite(found), found, finite.max() if finite.size else 0.0)


def _unless(values: FloatArray, lost: BoolArray) -> FloatArray:
    """Values (point, response), NaN where lost."""
    return np.where(lost[:, None], np.nan, values)


def _sorted(values: FloatArray, plan: Plan) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Values of a population in order, and mean weight and its square beyond each of them."""
    order = np.argsort(values)
    weight, n = plan.population_weight[order], values.size
    mass, square = (np.append(np.cumsum(one[::-1])[::-1], 0.0) / n for one in (weight, weight**2))
    return values[order], mass, square, n


def _places(
    base: tuple[FloatArray, FloatArray, FloatArray, int],
    values: FloatArray,
    predicted: FloatArray,
    wanted: FloatArray,
) -> FloatArray:
    """Places (place,) at which an exceedance is found, in order."""
    ordered, mass, _, _ = base
    finite = np.isfinite(ordered)
    ordered, mass = ordered[finite], mass[1:][finite] - mass[1:][finite].min()
    shares = np.geomspace(min(20.0 * wanted.max(), 0.9), wanted.min() / 100.0, N_PLACES)
    at = np.minimum(np.searchsorted(-mass, -shares), ordered.size - 1)
    runs = np.sort(np.concatenate([values, predicted]))
    runs = runs[np.isfinite(runs) & (runs >= ordered[at[0]])]
    runs = runs[:: max(runs.size // N_PLACES, 1)]
    end = max(ordered[-1], runs[-1] if runs.size else -np.inf)
    return np.unique(np.concatenate([ordered[at], runs, [end]]))


def _inverted(places: FloatArray, exceedance: FloatArray, level: float) -> float:
    """Smallest place (between places) whose exceedance, made to descend, is at most a level."""
    descending = isotonic_regression(exceedance, increasing=False).x
    within = descending <= level
    if not within.any():
        return np.inf
    k = int(np.argmax(within))
    if k == 0:
        return float(places[0])
    above, below = descending[k - 1], max(descending[k], 1e-3 * level)
    part = np.log(above / level) / np.log(above / below)
    return float(places[k - 1] + part * (places[k] - places[k - 1]))


def _widths(answer: Answer, asked: Asked, scale: FloatArray) -> FloatArray:
    """Half widths (target,) over what is asked; infinite where nothing is given."""
    of_limits = []
    for limits, deviation in zip(answer.limits, scale, strict=True):
        half = limits.half_width / (deviation * asked.limit_half_width)
        infinite = np.array(limits.status) == INFINITE
        of_limits.append(np.where(infinite, 0.0, np.where(np.isnan(half), np.inf, half)))
    of_states = [
        0.5 * (one.upper - one.lower) / max(one.probability, 1e-300) / asked.state_half_width
        for one in answer.states.values()
    ]
    return np.concatenate([*of_limits, of_states])


def _needs(answer: Answer, asked: Asked, sofar: Runs) -> FloatArray:
    """Shares (target,) of the next batch: what is worst known most; loss as the mean of them."""
    widths = np.clip(_widths(answer, asked, _scale(sofar)), 0.1, 10.0)
    return np.append(widths, widths.mean())


def _known(answer: Answer, asked: Asked, sofar: Runs) -> bool:
    """Whether all is known as well as asked."""
    return bool((_widths(answer, asked, _scale(sofar)) <= 1.0).all())


def _scale(runs: Runs) -> FloatArray:
    """Deviations (response,) of the runs that held, from their middle half."""
    held = runs.values[~runs.lost]
    low, high = np.quantile(held, [0.25, 0.75], axis=0)
    return np.maximum((high - low) / 1.349, 1e-12)
