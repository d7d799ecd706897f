"""Probability of loss by lines: far smaller ones than a design of runs can count.

All inputs are standard normal.  Scouts on a sphere find where runs are lost; lost scouts between
which runs are lost too are one region.  Each region has a direction, and each line along it one
crossing c of the border, found by halving, so that it contributes Φ(−c).  A border fitted to the
crossings says what each line should contribute: it narrows the search, and its own mean over the
law, corrected by the lines, is the estimate.  Theory: docs/theory/checked.md, sec. 3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import log_ndtr
from scipy.stats import norm, t

from maglev.arrays import BoolArray, FloatArray
from maglev.errors import UserError
from maglev.uncertainty.exploration import (
    empty_half_space,
    exploring_points,
    surrounding_directions,
    unit,
)

LostRuns = Callable[[FloatArray], BoolArray]
"""Runs points (run, parameter) and says which of them were lost."""

REACH = 7.0
"""Radius of the scouts [-]; assumed: four inputs are then searched for half-spaces down to 4e-7."""

BEYOND = 3.0
"""How far beyond the reach a crossing is looked for [-]; assumed: such lines contribute nothing."""

TOLERANCE = 0.03
"""Width of the bracket in which a crossing is left [-]; assumed: at five deviations Φ(−c) is known
to a twelfth at worst and 4 % as a rule, and lines are independent."""

N_FIRST = 4
"""Halvings between the mean and a lost scout; assumed: half a deviation is left."""

N_PILOT = 2
"""Lines of a first batch, beside one for each input; they only place the direction; assumed."""

N_BATCH = 6
"""Lines of each later batch; assumed."""

N_POPULATION = 2**15
"""Lines on which the fitted border is averaged, and of which those to run are drawn; assumed."""

WIDER = 1.6
"""Deviation of half of that population [-], so that bent borders are met where they count;
assumed."""

LAW_SHARE = 0.25
"""Share of the lines drawn from the law itself, which bounds their weights by four; assumed."""

BETWEEN = 0.3
"""How far beyond the middle between two border points a run asks whether they are of one region
[-]; assumed, more than the halvings leave open."""

PILOT = 0.1
"""Width of the brackets of the pilot batch [-]; assumed."""

CAUTION = 1.2
"""Factor of the standard error [-]: lines share the fitted border, and are stopped when they agree;
found by counting on sixty seeds of half-spaces, pairs of them and a bent border."""

NEARER = 0.3
"""How much nearer to the mean than any point found the border may be [-]; assumed."""

FREE = 100.0
"""Prior deviation of the border's distance [-]; assumed, as good as free."""

SAME = 0.9
"""Cosine between the directions of two regions above which they are one [-]; assumed."""

PRIOR = {"slope": 0.5, "curvature": 0.15}
"""Prior deviations of the border's slopes and curvatures, by deviations of the inputs; assumed."""

NOISE = (0.01, 0.03, 0.1, 0.3)
"""Roughness of the border that is tried [-]; assumed."""

LEAST_DEVIATION, FEW_DEVIATION = 0.01, 0.25
"""Least doubt of the fitted border, and its doubt with fewer than three crossings [-]; assumed."""

FARTHEST = 3.0
"""How far from the direction of its pilot a region may be aimed anew [-]; assumed."""

FEWEST_LINES = 6
"""Lines below which the fitted border alone speaks, and counts as not known at all; assumed."""


@dataclass(frozen=True)
class _Crossings:
    """Points (crossing, parameter) of a border and the widths (crossing,) of their brackets."""

    points: FloatArray
    width: FloatArray

    def and_of(self, other: _Crossings) -> _Crossings:
        """These and other ones."""
        return _Crossings(
            np.concatenate([self.points, other.points]), np.append(self.width, other.width)
        )


@dataclass(frozen=True, kw_only=True)
class Region:
    """One region of lost runs and its lines.

    Parameters
    ----------
    direction : (parameter,)
        Unit direction of the lines [-].
    border
        Points of the border that were found before its lines.
    foot : (line, parameter)
        Where each line meets the plane through the mean [-].
    low, high : (line,)
        Bracket of the crossing on each line [-]; both infinite where nothing is lost within reach.
    first : (line,)
        Where the region's own part of each line begins, −∞ if it is the only one [-].
    weight : (line,)
        Density of the law over that of which the line was drawn [-].
    """

    direction: FloatArray
    border: _Crossings
    foot: FloatArray
    low: FloatArray
    high: FloatArray
    first: FloatArray
    weight: FloatArray


@dataclass(frozen=True, kw_only=True)
class LineEstimate:
    """Probability of loss by lines.

    Parameters
    ----------
    probability
        Estimate [-].
    lower, upper
        Ends of its interval [-]; it does not hold regions that no scout has met.
    unvisited
        Probability of the likeliest half-space without a run [-].
    n_runs
        Runs spent.
    regions
        The regions; none if no scout was lost, and then the upper end is ``unvisited``.
    of_region : (region,)
        Part of each region [-].
    equivalent_runs
        Runs of crude Monte Carlo with as narrow an interval [-]; infinite if it has no width.
    """

    probability: float
    lower: float
    upper: float
    unvisited: float
    n_runs: int
    regions: tuple[Region, ...]
    of_region: FloatArray
    equivalent_runs: float


def lost_by_lines(
    lost: LostRuns,
    n_inputs: int,
    rng: np.random.Generator,
    *,
    n_largest: int = 200,
    asked: float = 0.02,
    reach: float = REACH,
    confidence: float = 0.95,
) -> LineEstimate:
    """Probability that a run is lost, from scouts and lines.

    It assumes that a run at the mean is held, and that from the first crossing on a line stays
    lost as far as matters.  Regions share no line: each line counts only where its own region's
    plane is the most exceeded.

    Parameters
    ----------
    lost
        Runs standard normal points (run, parameter); which were lost (run,).
    n_inputs
        Number of inputs s.
    rng
        Source of scouts and lines.
    n_largest
        Largest number of runs; whole batches only, so that a few may be left.
    asked
        Half width of the interval over the estimate at which to stop [-].
    reach
        Radius of the scouts [-].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    estimate
        Probability, interval, regions and runs.

    Raises
    ------
    UserError
        If a run at the mean is lost, a number is not positive, or the runs do not even allow
        scouts.

    References
    ----------
    Koutsourelakis, Pradlwarter, Schuëller, Probab. Eng. Mech. 19 (2004) 409-417; Papaioannou,
    Straub, Struct. Saf. 88 (2021) 102025 (several directions); Särndal, Swensson, Wretman, Model
    Assisted Survey Sampling (1992), ch. 6 (correction of a prediction).

    Examples
    --------
    >>> plane = lambda points: points @ [0.8, 0.6, 0.0] > 4.753424308822899
    >>> found = lost_by_lines(plane, 3, np.random.default_rng(0))
    >>> bool(abs(found.probability / 1e-6 - 1.0) < 0.05 and found.n_runs <= 200)
    True
    """
    _check(n_inputs, n_largest, asked, reach, confidence)
    search = _Search(lost, n_inputs, rng, n_largest, reach)
    regions = _placed(search, _scouted(search))
    unvisited = empty_half_space(np.concatenate(search.seen), rng).probability
    if not regions:
        return LineEstimate(
            probability=0.0,
            lower=0.0,
            upper=unvisited,
            unvisited=unvisited,
            n_runs=search.n_runs,
            regions=(),
            of_region=np.empty(0),
            equivalent_runs=np.inf,
        )
    planes = [_tangent(one) for one in regions]
    known = [_corrected(search, one, planes, number) for number, one in enumerate(regions)]
    part, error = np.array(known).T
    while _half_width(regions, error, confidence) > asked * part.sum():
        number = int(np.argmax(error))
        wanted = max(N_BATCH, FEWEST_LINES - regions[number].high.size)
        more = _with_lines(search, regions, number, wanted, planes)
        if more is None:
            break
        regions[number] = more
        part[number], error[number] = _corrected(search, more, planes, number)
    probability, half = float(part.sum()), _half_width(regions, error, confidence)
    return LineEstimate(
        probability=probability,
        lower=max(probability - half, 0.0),
        upper=min(probability + half, 1.0),
        unvisited=unvisited,
        n_runs=search.n_runs,
        regions=tuple(regions),
        of_region=part,
        equivalent_runs=equivalent_runs(probability, half, confidence),
    )


def equivalent_runs(probability: float, half_width: float, confidence: float = 0.95) -> float:
    """Runs of crude Monte Carlo whose interval of a probability is as narrow.

    Parameters
    ----------
    probability
        Estimate [-].
    half_width
        Half width of its interval [-].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    runs
        P (1 − P) (z / half width)²; infinite without width.

    Examples
    --------
    >>> print(f"{equivalent_runs(1e-6, 1e-7):.2g}")
    3.8e+08
    """
    if half_width == 0.0:
        return np.inf
    z = norm.ppf(0.5 + 0.5 * confidence)
    return float(probability * (1.0 - probability) * (z / half_width) ** 2)


class _Search:
    """Runs asked for so far, counted and kept."""

    def __init__(
        self, lost: LostRuns, n_inputs: int, rng: np.random.Generator, n_largest: int, reach: float
    ) -> None:
        self.lost, self.n_inputs, self.rng = lost, n_inputs, rng
        self.n_largest, self.reach = n_largest, reach
        self.seen: list[FloatArray] = []
        self.places, self.weight = _population(n_inputs - 1, rng)
        self.runs_per_line = 8.0  # until lines have told

    @property
    def n_runs(self) -> int:
        """Runs spent."""
        return sum(len(one) for one in self.seen)

    def run(self, points: FloatArray) -> BoolArray:
        """Which of the points (run, parameter) are lost."""
        if not len(points):
            return np.zeros(0, dtype=bool)
        self.seen.append(points)
        return np.asarray(self.lost(points), dtype=bool)


def _population(n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Places (place, n) of lines, some farther out than the law has them, and their weights."""
    quarter = rng.standard_normal((N_POPULATION // 4, n))
    wide = WIDER * rng.standard_normal((N_POPULATION // 4, n))
    places = np.concatenate([quarter, -quarter, wide, -wide])
    square = np.einsum("ij,ij->i", places, places)
    ratio = np.exp(0.5 * square * (1.0 - WIDER**-2) - n * np.log(WIDER))  # wide over law
    return places, 1.0 / (0.5 + 0.5 * ratio)


def _scouted(search: _Search) -> list[_Crossings]:
    """Crossings of the border, apart for each region met."""
    scouts = surrounding_directions(search.n_inputs, search.rng)
    if len(scouts) + 1 > search.n_largest:
        raise UserError(
            f"searching {search.n_inputs} inputs takes {len(scouts) + 1} scouts, but only "
            f"{search.n_largest} runs are allowed; allow more"
        )
    away = search.run(np.concatenate([np.zeros((1, search.n_inputs)), search.reach * scouts]))
    if away[0]:
        raise UserError(
            "a run at the mean of the inputs must be held to search from, got a lost one"
        )
    met = scouts[away[1:]]
    while not len(met) and search.n_runs < search.n_largest // 2:
        more = exploring_points(np.concatenate(search.seen), N_BATCH, 1.0, search.rng)
        met = unit(more)[search.run(search.reach * unit(more))]
    return _parted(search, _halved(search, met)) if len(met) else []


def _parted(search: _Search, found: _Crossings) -> list[_Crossings]:
    """Crossings, parted where the way between two of them is held; nearest regions first.

    From the nearest on, each joins one region: a point where two borders meet would join them.
    """
    order = np.argsort(np.linalg.norm(found.points, axis=1), kind="stable")
    border, width = found.points[order], found.width[order]
    region = np.arange(len(border))
    for i in range(1, len(border)):
        cosine = unit(border[:i]) @ unit(border[i])
        for other in sorted(set(region[:i]), key=lambda k: -cosine[region[:i] == k].max()):
            nearest = int(np.argmax(np.where(region[:i] == other, cosine, -1.0)))
            if cosine[nearest] <= 0.0:
                break
            between = 0.5 * (border[nearest] + border[i])
            if search.run((between + BETWEEN * unit(between))[None])[0]:
                region[i] = other
                break
    return [_Crossings(border[region == one], width[region == one]) for one in np.unique(region)]


def _halved(search: _Search, directions: FloatArray) -> _Crossings:
    """Crossings on rays from the mean, but for far ones."""
    low, high = np.zeros(len(directions)), np.full(len(directions), search.reach)
    for halving in range(N_FIRST):
        if halving == 2:
            near = low <= high.min()  # farther ones count for less than a thousandth
            directions, low, high = directions[near], low[near], high[near]
        middle = 0.5 * (low + high)
        away = search.run(middle[:, None] * directions)
        low, high = np.where(away, low, middle), np.where(away, middle, high)
    return _Crossings(0.5 * (low + high)[:, None] * directions, high - low)


def _plane(border: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (parameter,) and distance of the plane through points near the mean."""
    square = np.einsum("ij,ij->i", border, border)
    weight = np.exp(-0.25 * (square - square.min()))
    rows = border * weight[:, None]
    gram = rows @ rows.T + 1e-2 * square.min() * np.eye(len(rows))
    normal = rows.T @ np.linalg.solve(gram, weight)
    size = float(np.linalg.norm(normal))
    return normal / size, 1.0 / size


def _placed(search: _Search, borders: list[_Crossings]) -> list[Region]:
    """Regions with a direction from a pilot batch of lines, none of them with lines yet."""
    placed: list[Region] = []
    for border in borders:
        region = _empty(_plane(border.points)[0], border)
        pilot = _with_lines(
            search, [region], 0, search.n_inputs + N_PILOT, [_tangent(region)], PILOT
        )
        region = region if pilot is None else _aimed(pilot)
        same = [k for k, one in enumerate(placed) if one.direction @ region.direction > SAME]
        if same:
            both = placed[same[0]].border.and_of(region.border)
            placed[same[0]] = _aimed(_empty(placed[same[0]].direction, both))
        else:
            placed.append(region)
    return placed


def _tangent(region: Region) -> tuple[FloatArray, float]:
    """Unit normal (parameter,) and distance of the plane that stands for a region."""
    nowhere = np.zeros((1, region.direction.size - 1))
    return region.direction, float(_fitted_border(region).at(nowhere)[0])


def _aimed(region: Region) -> Region:
    """The region without lines, its direction towards the nearest point of the border found."""
    border = _fitted_border(region)
    across = _basis(region.direction)
    nearest = minimize(
        lambda x: 0.5 * (x @ x + border.at(x[None])[0] ** 2), np.zeros(len(across)), method="BFGS"
    ).x
    nearest = nearest * min(1.0, FARTHEST / max(float(np.linalg.norm(nearest)), 1e-9))
    point = nearest @ across + border.at(nearest[None])[0] * region.direction
    direction = point if point @ region.direction > 0.0 else region.direction
    return _empty(unit(direction), _all_crossings(region))


def _empty(direction: FloatArray, border: _Crossings) -> Region:
    """A region without lines."""
    none = np.empty(0)
    return Region(
        direction=direction,
        border=border,
        foot=np.empty((0, direction.size)),
        low=none,
        high=none,
        first=none,
        weight=none,
    )


def _known_crossings(region: Region) -> BoolArray:
    """Lines (line,) whose crossing was found, not cut off by another region."""
    return np.isfinite(region.high) & (region.high > region.low)


def _all_crossings(region: Region) -> _Crossings:
    """Crossings known before and those of the lines."""
    known = _known_crossings(region)
    low, high = region.low[known], region.high[known]
    points = region.foot[known] + 0.5 * (low + high)[:, None] * region.direction
    return region.border.and_of(_Crossings(points, high - low))


def _basis(direction: FloatArray) -> FloatArray:
    """Orthonormal rows (parameter - 1, parameter) across a direction."""
    square = np.linalg.qr(np.column_stack([direction, np.eye(direction.size)]))[0]
    return square[:, 1:].T


def _first(
    planes: list[tuple[FloatArray, float]], number: int, foot: FloatArray, direction: FloatArray
) -> FloatArray:
    """Where on each line (line,) this region's plane becomes the most exceeded one."""
    first = np.full(len(foot), -np.inf)
    own = foot @ planes[number][0] - planes[number][1]
    rise = direction @ planes[number][0]
    for other, (normal, distance) in enumerate(planes):
        slower = rise - direction @ normal
        if other != number and slower > 1e-9:
            first = np.maximum(first, (foot @ normal - distance - own) / slower)
    return first


def _with_lines(
    search: _Search,
    regions: list[Region],
    number: int,
    n_lines: int,
    planes: list[tuple[FloatArray, float]],
    tolerance: float = TOLERANCE,
) -> Region | None:
    """A region with some more lines; None if the runs left do not allow one."""
    n_lines = min(n_lines, int((search.n_largest - search.n_runs) / search.runs_per_line))
    if n_lines < 1:
        return None
    region = regions[number]
    across = _basis(region.direction)
    border = _fitted_border(region)
    expected = _expected(search, border, planes, number, region.direction)
    chance = LAW_SHARE * search.weight / search.weight.sum()
    chance += (1.0 - LAW_SHARE) * expected / expected.sum()
    drawn = search.rng.choice(len(chance), n_lines, p=chance / chance.sum())
    foot = search.places[drawn] @ across
    first = _first(planes, number, foot, region.direction)
    guess = border.at(search.places[drawn])
    weight = search.weight[drawn] / (chance[drawn] * len(chance))
    before = search.n_runs
    low, high = _bracketed(
        search,
        region.direction,
        foot,
        first,
        guess,
        max(border.deviation, 0.5 * tolerance),
        tolerance,
    )
    search.runs_per_line = max((search.n_runs - before) / n_lines, 2.0)
    return Region(
        direction=region.direction,
        border=region.border,
        foot=np.concatenate([region.foot, foot]),
        low=np.concatenate([region.low, low]),
        high=np.concatenate([region.high, high]),
        first=np.concatenate([region.first, first]),
        weight=np.concatenate([region.weight, weight]),
    )


def _expected(
    search: _Search,
    border: _Border,
    planes: list[tuple[FloatArray, float]],
    number: int,
    direction: FloatArray,
) -> FloatArray:
    """What the fitted border expects of each line of the population, times its weight."""
    foot = search.places @ _basis(direction)
    first = _first(planes, number, foot, direction)
    return search.weight * norm.sf(np.maximum(border.at(search.places), first))


def _bracketed(
    search: _Search,
    direction: FloatArray,
    foot: FloatArray,
    first: FloatArray,
    guess: FloatArray,
    step: float,
    tolerance: float,
) -> tuple[FloatArray, FloatArray]:
    """Brackets (line,) of the crossings: held at the low end, lost at the high one.

    Both ends are ``first`` where the line is lost there already, infinite where it is not lost
    within reach.  Guesses are shifted at random by up to half the last bracket, so that a crossing
    lies anywhere within its bracket: lines that share a wrong guess would agree on it.
    """
    last = 2.0 * step / 2.0 ** np.ceil(np.log2(max(2.0 * step / tolerance, 1.0)))
    guess = guess + last * (search.rng.random(guess.size) - 0.5)
    farthest = search.reach + BEYOND
    floor = np.maximum(first, -farthest)
    low, high = np.full(guess.size, -np.inf), np.full(guess.size, np.inf)
    reached = np.full(guess.size, step)
    done = floor >= farthest
    low[done] = np.inf
    while not done.all():
        both = np.isfinite(low) & np.isfinite(high)
        with np.errstate(invalid="ignore"):
            middle = 0.5 * (low + high)
        wanted = np.where(
            both,
            middle,
            np.where(
                np.isfinite(high),
                high - 2.0 * reached,
                np.where(np.isfinite(low), low + 2.0 * reached, guess + reached),
            ),
        )
        wanted = np.clip(wanted, floor, farthest)
        lines = np.flatnonzero(~done)
        away = search.run(foot[lines] + wanted[lines, None] * direction)
        reached[lines[~both[lines]]] *= 2.0
        at_floor = wanted[lines] <= floor[lines]
        at_end = wanted[lines] >= farthest
        high[lines[away]] = wanted[lines[away]]
        low[lines[~away]] = wanted[lines[~away]]
        low[lines[away & at_floor]] = floor[lines[away & at_floor]]
        none = lines[~away & at_end]
        low[none] = high[none] = np.inf
        done[none] = True
        found = np.isfinite(low) & np.isfinite(high)
        done[found] |= high[found] - low[found] <= tolerance * (1.0 + 1e-9)
    return low, high


@dataclass(frozen=True)
class _Border:
    """The crossing as a quadratic of the place of the line."""

    coefficients: FloatArray
    without: FloatArray
    deviation: float
    nearest: float

    def at(self, place: FloatArray) -> FloatArray:
        """Crossings (line,) expected at places (line, parameter - 1)."""
        return self.not_nearer(place, _quadratic(place) @ self.coefficients)

    def not_nearer(self, place: FloatArray, crossing: FloatArray) -> FloatArray:
        """The same, nowhere nearer to the mean than the border was found, `NEARER` apart."""
        square = self.nearest**2 - np.einsum("ij,ij->i", place, place)
        return np.maximum(crossing, np.sqrt(np.maximum(square, 0.0)))


def _quadratic(place: FloatArray) -> FloatArray:
    """Constant, places and their products (line, feature)."""
    d = place.shape[1]
    products = [place[:, i] * place[:, j] for i in range(d) for j in range(i, d)]
    return np.column_stack([np.ones(len(place)), place, *products])


def _fitted_border(region: Region) -> _Border:
    """The border through all crossings of a region, as smooth as leaving one out asks for."""
    known = _all_crossings(region)
    place = known.points @ _basis(region.direction).T
    crossing = known.points @ region.direction
    d = place.shape[1]
    prior = np.repeat([PRIOR["slope"], PRIOR["curvature"]], [d, d * (d + 1) // 2])
    features = _quadratic(place)[:, 1:] * prior
    found = [_ridge(features, crossing, noise**2 + known.width**2 / 12.0) for noise in NOISE]
    coefficients, without, deviation = min(found, key=lambda one: one[2])
    scaled = np.concatenate([coefficients[:1], coefficients[1:] * prior])
    nearest = float(np.linalg.norm(known.points, axis=1).min()) - NEARER
    return _Border(scaled, without, max(deviation, LEAST_DEVIATION), max(nearest, 0.0))


def _ridge(
    features: FloatArray, values: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Ridge regression with a free constant: coefficients, each value without itself, deviation."""
    n = values.size
    if n < 3:
        constant = np.zeros(features.shape[1] + 1)
        constant[0] = values.mean()
        return constant, np.full(n, values.mean()), FEW_DEVIATION
    whole = np.column_stack([np.full(n, FREE), features])
    inverse = np.linalg.inv(whole @ whole.T + np.diag(noise))
    solved = inverse @ values
    residual = solved / np.diag(inverse)
    coefficients = whole.T @ solved
    coefficients[0] *= FREE
    deviation = float(np.sqrt(np.average(residual**2, weights=1.0 / noise)))
    return coefficients, values - residual, deviation


def _corrected(
    search: _Search, region: Region, planes: list[tuple[FloatArray, float]], number: int
) -> tuple[float, float]:
    """Probability of a region and its standard error: the border's mean, corrected by the lines."""
    border, n = _fitted_border(region), region.high.size
    expected = _expected(search, border, planes, number, region.direction)
    place, crossed = region.foot @ _basis(region.direction).T, _known_crossings(region)
    predicted = border.at(place)
    without = border.without[region.border.width.size :]
    predicted[crossed] = border.not_nearer(place[crossed], without)
    predicted = norm.sf(np.maximum(predicted, region.first))
    found, blur = _mean_within(region.low, region.high)
    difference = region.weight * (found - predicted)
    if n < FEWEST_LINES:  # the fitted border alone, not known at all
        return float(expected.mean()), float(expected.mean())
    variance = (difference.var(ddof=1) + np.mean(region.weight**2 * blur)) / n
    total = expected.mean() + difference.mean()
    return max(float(total), 0.0), float(np.sqrt(variance + expected.var() / expected.size))


def _mean_within(low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and variance (line,) of Φ(−c) for c anywhere in a bracket; zero if infinite."""
    finite = np.isfinite(high)
    a, b = np.where(finite, low, 0.0), np.where(finite, high, 0.0)
    mean = np.exp((log_ndtr(-a) + 4.0 * log_ndtr(-0.5 * (a + b)) + log_ndtr(-b)) / 6.0)
    spread = norm.sf(a) - norm.sf(b)
    return np.where(finite, mean, 0.0), np.where(finite, spread**2 / 12.0, 0.0)


def _half_width(regions: list[Region], error: FloatArray, confidence: float) -> float:
    """Half width of the interval of the sum over regions."""
    lines = np.array([max(one.high.size, FEWEST_LINES) for one in regions])
    return float(np.linalg.norm(t.ppf(0.5 + 0.5 * confidence, lines - 1) * CAUTION * error))


def _check(n_inputs: int, n_largest: int, asked: float, reach: float, confidence: float) -> None:
    if n_inputs < 2 or n_largest < 1 or not asked > 0.0 or not reach > 0.0:
        raise UserError(
            "lines need at least two inputs, one run, and a positive half width and reach, got "
            f"{n_inputs}, {n_largest}, {asked} and {reach}"
        )
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
