"""Designs: training runs of a surrogate, in one stage or in adaptive rounds.

An adaptive design is a fold over its rounds.  Each round is written to the store as a small file of
its own before the next begins; to resume is to read them once more.  This history alone decides
when to stop, so another threshold or another largest number of runs continues or shortens the
stored design, without a run of the model.
"""

from __future__ import annotations

import hashlib
import itertools
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from maglev import datasets
from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.fingerprint import code_of
from maglev.parameters import WHY_NO_DESIGN, Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import extremes, lost, responses_of
from maglev.stages.points import case_of, marginals
from maglev.stages.randomness import generator
from maglev.stages.reads import RUNS_OF_CASE
from maglev.stages.runs import content, key_of, runs
from maglev.uncertainty.adaptive import AdaptiveState, absorb, decision, propose
from maglev.uncertainty.failure_region import border_batch, fit_failure_region
from maglev.uncertainty.kriging import Kriging, fit_kriging
from maglev.uncertainty.learning import predicted_limits, tail_batch, taylor_batch
from maglev.uncertainty.pointset import sobol_points
from maglev.uncertainty.selection import fit_selected
from maglev.uncertainty.surrogate import Fit, Surrogate
from maglev.vocabulary import ADAPTIVE, DECISIONS, DESIGNED, Response

_LOG = logging.getLogger(__name__)

N_LIMITS = 2**14
"""Sobol' points on which the limits of successive rounds are compared; assumed: 16 of them lie
beyond the limit at 1e-3, and their noise is the same in all rounds."""

_GO_ON, _, _SETTLED, _LARGEST = range(len(DECISIONS))


def dataset(
    config: Config,
    case: str,
    method: str,
    initial_points: xr.Dataset,
    candidate_points: xr.Dataset | None = None,
    baseline: xr.Dataset | None = None,
    *,
    store: str | Path,
    n_threads: int = 1,
) -> xr.Dataset:
    """Make a design, or resume an interrupted one.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    method
        ``"osm"``, ``"asm_paper"`` or ``"asm"``.
    initial_points
        Layout ``points``: the first design.
    candidate_points
        Layout ``points``: candidates of the rounds of an adaptive method.
    baseline
        Layout ``runs``: the surrogate of each round is compared with it.
    store
        Folder of the store of runs and rounds.
    n_threads
        Rows of samples computed at the same time; the numbers do not depend on it.

    Returns
    -------
    dataset
        Layout ``design``.

    Raises
    ------
    UserError
        If there is no such case or method, the points are of another case, too few runs hold
        to fit a surrogate, or as `maglev.simulate`.

    References
    ----------
    docs/theory/adaptive_sampling.md.
    """
    points = {"initial": initial_points}
    if candidate_points is not None:
        points["candidates"] = candidate_points
    with threadpool_limits(1, "blas"):  # more threads would sum in another order
        return _Design(config, case, method, points, store, baseline, n_threads).finished()


class _Design:
    """One design and the common data of its rounds."""

    def __init__(
        self,
        config: Config,
        case: str,
        method: str,
        points: Mapping[str, xr.Dataset],
        store: str | Path,
        baseline: xr.Dataset | None,
        n_threads: int,
    ) -> None:
        if method not in ("osm", *ADAPTIVE):
            raise UserError(f"method must be osm, asm_paper or asm, got '{method}'")
        missing = {"initial", *(["candidates"] if method in ADAPTIVE else [])} - set(points)
        if missing:
            raise UserError(f"the method '{method}' needs the points {', '.join(sorted(missing))}")
        if case_of(config, case).track != "fixed":
            raise UserError(f"cases.{case}: {method} needs track: fixed: {WHY_NO_DESIGN}")
        self.config, self.case, self.method = config, case, method
        self.points, self.store, self.n_threads = points, Path(store), n_threads
        self.settings = getattr(config.study, method)
        self.levels = config.study.failure_probability
        driving = [self.settings.response] if method == "asm_paper" else []
        self.responses = tuple(dict.fromkeys([*config.responses_of_designs, *driving]))
        self.inputs = marginals(config, case)
        for name, one in points.items():
            if one.sizes["parameter"] != self.inputs.n:
                raise UserError(
                    f"the points '{name}' have {one.sizes['parameter']} random gains, expected "
                    f"{self.inputs.n} as in the case '{case}'"
                )
        population = sobol_points(self.inputs, N_LIMITS, generator(config.seed, "limits"))
        self.population = population.standard
        self.truth = _held(baseline, self.responses) if baseline is not None else None
        self.truth_hash = "none" if self.truth is None else _hash(*self.truth)
        self.fit: Fit = (
            fit_kriging  # the tail criterion needs a covariance
            if method == "asm"
            else partial(fit_selected, choice=self.settings.surrogate)
        )
        self.content = self._content()
        self.code = code_of("stages.design", without=["stage"])
        key = key_of(self.content, self.code)
        self.folder = self.store / "rounds" / case / method / key

    def _content(self) -> dict[str, object]:
        """All settings that decide the rounds, without stopping rule and final surrogate."""
        chosen = case_of(self.config, self.case).quantities()
        quantities = self.settings.quantities()
        later = {"threshold", "n_rounds", "n_largest", "n_runs", "responses"}
        if self.method == "asm":
            later |= {"surrogate"}
        return {
            **content(self.config.of_case(self.case)),
            "gains": self.config.gains.quantities(),
            "random": list(chosen["random"].items()),
            "correlation": chosen["correlation"],
            "track": chosen["track"],
            "failure_probability": list(self.levels),
            "responses": list(self.responses),
            self.method: {k: v for k, v in quantities.items() if k not in later},
            "points": {name: _hash(one["standard"].values) for name, one in self.points.items()},
        }

    def finished(self) -> xr.Dataset:
        """All rounds, from the store or computed, until the stopping rule holds."""
        state = AdaptiveState.empty(self.inputs.n, len(self.responses))
        surrogate: Surrogate | None = None
        rounds: list[xr.Dataset] = []
        changes: list[float] = []
        for number in itertools.count():
            path = self.folder / f"round_{number:03d}.nc"
            after: Surrogate | None = None
            if not path.is_file():
                if rounds and surrogate is None:
                    surrogate = self.fit(*state.training)
                before = rounds[-1]["round_limit"].values[0] if rounds else None
                after = self._make(number, path, state, surrogate, before, changes)
            one = datasets.read(path, "round")
            state, surrogate = _absorbed(state, one), after
            changes.append(float(one["limit_change"].item()))
            decision = self._decision(state, changes)
            if one.attrs["baseline"] != self.truth_hash:
                surrogate = self.fit(*state.training)
                one["rmse"] = (("round", "response"), self._rmse(surrogate))
            one["decision"] = (("round",), [np.int8(decision)])
            rounds.append(one)
            _LOG.info(
                "%s, %s, round %d: %d runs, %d lost; error %.2g, limits moved %.2g deviations; %s",
                self.case,
                self.method,
                number,
                state.lost.size,
                state.lost.sum(),
                np.nanmax(one["error"].values, initial=0.0),
                changes[-1],
                DECISIONS[decision].replace("_", " "),
            )
            if decision != _GO_ON:
                break
        return self._joined(rounds, state, DECISIONS[decision])

    def _make(
        self,
        number: int,
        path: Path,
        state: AdaptiveState,
        surrogate: Surrogate | None,
        limits_before: FloatArray | None,
        changes: list[float],
    ) -> Surrogate:
        """Choose, run and assess the points of a round and write it; return the new surrogate."""
        predicted: FloatArray | None = None
        if surrogate is None:
            initial = self.points["initial"]
            standard, probability = initial["standard"].values, initial["probability"].values
            scores = np.full(standard.shape[0], np.nan)
        else:
            scores = np.empty(self.settings.batch_size)
            proposal = propose(
                state,
                lambda *_: surrogate,
                partial(self._chosen, number, state, scores),
                self.points["candidates"]["standard"].values,
                self.settings.batch_size,
            )
            standard, predicted = proposal.points, proposal.predicted
            probability = np.full(standard.shape[0], np.nan)
        result = runs(
            self.config, self.case, standard, probability, self.store, n_threads=self.n_threads
        )
        n, start = standard.shape[0], state.lost.size
        unknown = np.full((n, len(self.responses)), np.nan)
        result["predicted"] = (
            ("sample", "response"),
            unknown if predicted is None else predicted,
        )
        result = result.assign_coords(response=list(self.responses))
        state = _absorbed(state, result)
        after = self.fit(*state.training)
        limits = self._limits(number, state, after)
        first = (state.round_index == 0) & ~state.lost
        change = np.nan
        if limits_before is not None:
            scale = state.values[first].std(axis=0)
            change = _largest_change(limits_before, limits, scale)
        one = result.assign(
            score=(("sample",), scores),
            round_n_runs=(("round",), [start + n]),
            error=(("round", "response"), state.error[-1:]),
            rmse=(("round", "response"), self._rmse(after)),
            round_limit=(("round", "response", "failure_probability"), limits[None]),
            limit_change=(("round",), [change]),
            decision=(("round",), [np.int8(self._decision(state, [*changes, change]))]),
        ).assign_coords(
            sample=np.arange(start, start + n),
            failure_probability=np.array(self.levels),
            round=np.array([number], dtype=np.int32),
        )
        one.attrs["baseline"] = self.truth_hash
        datasets.write(one, path, "round", config=self.content, code=self.code)
        return after

    def _chosen(
        self,
        number: int,
        state: AdaptiveState,
        scores: FloatArray,
        surrogate: Surrogate,
        occupied: FloatArray,
        candidates: FloatArray,
        n_new: int,
    ) -> IntArray:
        """Candidates of the next round; ``scores`` receives their scores."""
        region = None
        if state.lost.any():
            rng = generator(self.config.seed, "border", number)
            region = fit_failure_region(state.points, state.lost, rng)
        held = None if region is None else 1.0 - region.lost_probability(candidates)
        if self.method == "asm_paper":
            points, values = state.training
            driving = self.fit(points, values[:, [self._driving]])
            return taylor_batch(
                driving, occupied, candidates, n_new, held_probability=held, scores=scores
            )
        assert isinstance(surrogate, Kriging)  # `fit` of the method asm
        tail = partial(
            tail_batch,
            surrogate,
            candidates=candidates,
            aggregate=self.settings.aggregate,
            exceedances=self.levels,
            held_probability=held,
        )
        if region is None or n_new == 1:
            return tail(occupied=occupied, n_new=n_new, scores=scores)
        # once a sample is lost, one run of each round goes to the border
        border = border_batch(region, occupied, candidates, 1, scores=scores[:1])
        occupied = np.concatenate([occupied, candidates[border]])
        rest = tail(occupied=occupied, n_new=n_new - 1, scores=scores[1:])
        return np.concatenate([border, rest])

    @property
    def _driving(self) -> int:
        """Number of the response that drives the published method."""
        return self.responses.index(self.settings.response)

    def _limits(self, number: int, state: AdaptiveState, surrogate: Surrogate) -> FloatArray:
        """Limits (response, level) by a surrogate, on the same points in all rounds."""
        held = None
        if state.lost.any():
            rng = generator(self.config.seed, "limits border", number)
            region = fit_failure_region(state.points, state.lost, rng)
            held = 1.0 - region.lost_probability(self.population)
        return predicted_limits(surrogate.predict(self.population), self.levels, held).T

    def _rmse(self, surrogate: Surrogate) -> FloatArray:
        """Root mean square error (1, response) against the baseline; NaN without one."""
        if self.truth is None:
            return np.full((1, len(self.responses)), np.nan)
        standard, values = self.truth
        return np.sqrt(np.mean((surrogate.predict(standard) - values) ** 2, axis=0))[None]

    def _decision(self, state: AdaptiveState, changes: list[float]) -> int:
        """Decision after a round: the number of a word in `maglev.vocabulary.DECISIONS`."""
        if self.method == "osm":
            return _LARGEST
        settings = self.settings
        n_largest = settings.largest(self.inputs.n) if self.method == "asm" else settings.n_largest
        largest = max(n_largest - settings.batch_size + 1, 1)  # whole rounds only
        if self.method == "asm_paper":
            driving = replace(state, error=state.error[:, [self._driving]])
            decided = decision(
                driving,
                threshold=settings.threshold,
                n_rounds=settings.n_rounds,
                n_largest=largest,
            )
            return DECISIONS.index(decided)
        # the change of the first design is NaN, which is not small
        if (np.array(changes[-settings.n_rounds :]) <= settings.threshold).all():
            return _SETTLED
        return _LARGEST if state.lost.size >= largest else _GO_ON

    def _joined(self, rounds: list[xr.Dataset], state: AdaptiveState, reason: str) -> xr.Dataset:
        """The design, joined from its rounds."""
        of_sample = [str(name) for name in rounds[0].data_vars if "sample" in rounds[0][name].dims]
        of_round = [str(name) for name in rounds[0].data_vars if "round" in rounds[0][name].dims]
        parts = [
            xr.concat(
                [one[names] for one in rounds],
                dim,
                data_vars="minimal",
                coords="minimal",
                compat="override",
                combine_attrs="override",
            ).drop_vars("round" if dim == "sample" else "sample", errors="ignore")
            for names, dim in ((of_sample, "sample"), (of_round, "round"))
        ]
        whole = xr.merge(parts, compat="override", join="outer", combine_attrs="override")
        whole["round_index"] = (("sample",), state.round_index.astype(np.int32))
        whole.attrs = datasets.carried(rounds[0])
        whole.attrs["stopped"] = reason.replace("_", " ")
        return whole


def _absorbed(state: AdaptiveState, one: xr.Dataset) -> AdaptiveState:
    """The state after one more round."""
    away = lost(one)
    predicted = one["predicted"].values if state.tested.size else None
    values = np.where(away[:, None], np.nan, extremes(one, responses_of(one)))
    return absorb(state, one["standard"].values, values, away, predicted)


def _held(baseline: xr.Dataset, responses: Sequence[Response]) -> tuple[FloatArray, FloatArray]:
    """Points (sample, parameter) and extremes (sample, response) of a baseline that held."""
    held = ~lost(baseline)
    return baseline["standard"].values[held], extremes(baseline, responses)[held]


def _hash(*arrays: FloatArray) -> str:
    """First 16 hexadecimal digits of a hash over the bytes of arrays."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array, dtype="<f8").tobytes())
    return digest.hexdigest()[:16]


def _largest_change(before: FloatArray, after: FloatArray, scale: FloatArray) -> float:
    """Largest change of a limit (response, level) over the deviations (response,) [-]."""
    both = np.isinf(before) & np.isinf(after)
    change = np.abs(np.where(both, 0.0, after) - np.where(both, 0.0, before))
    return float(np.max(change / scale[:, None]))


STAGE = Stage(
    name="design",
    of="method",
    reads=(
        *RUNS_OF_CASE,
        "study.failure_probability",
        "study.asm.responses",
        "study.{method}",
    ),
    inputs={
        "initial_points": Input("points"),
        "candidate_points": Input("points", methods=ADAPTIVE),
        "baseline": Input("runs", optional=True),
    },
    takes={"case": str, "method": str, "store": Path, "n_threads": int},
    methods=DESIGNED,
    layout="design",
    compute=dataset,
)
