# Which files the cases of the configuration and their methods have, for figures and targets.


GAIN_CASES = named_cases(parameters.figures.by_gain)
VARIATION_CASES = named_cases(parameters.figures.by_variation)
TRACK_CASES = [case for case in CASES if parameters.cases[case].track == "random"]


def judged(case: str) -> bool:
    """Whether a case has a baseline and something to judge by it."""
    return bool(methods_of(case, (BASELINE,)) and methods_of(case, DESIGNED))


def of_methods(stage: str, case: str) -> list[str]:
    """Files of a stage of each method of a case that it is made for."""
    methods = methods_of(case, STAGES[stage].methods)
    return [file_of(stage, case=case, method=method) for method in methods]


def of_baseline(stage: str) -> list[str]:
    """The file of the baseline of the case of the tables, if it has one."""
    has_one = methods_of(TABLE_CASE, (BASELINE,))
    return [file_of(stage, case=TABLE_CASE, method=BASELINE)] if has_one else []


def of_judged(stage: str) -> list[str]:
    """The file of the case of the tables, if its methods can be judged by a baseline."""
    return [file_of(stage, case=TABLE_CASE)] if judged(TABLE_CASE) else []


def of_last_method(cases: list[str], *stages: str) -> list[str]:
    """A file of each stage and case by the last of its methods with a surrogate, or none at all."""
    designed = [methods_of(case, DESIGNED) for case in cases]
    return [
        file_of(stage, case=case, method=methods[-1])
        for stage in stages
        for case, methods in zip(cases, designed, strict=True)
        if all(designed)
    ]


def on_tracks(case: str) -> bool:
    """Whether the case exists and its track is drawn, so that there can be others."""
    track = parameters.irregularity
    drawn = track.enabled and track.profile_file is None
    return case in CASES and case not in TRACK_CASES and drawn


def of_line() -> list[str]:
    """The file of the line, if there are tracks of the case of the tables."""
    return [file_of("line")] if on_tracks(TABLE_CASE) else []


def possible(stage, case: str) -> bool:
    """Whether a case has what a stage of it needs: methods, and a random track for its parts."""
    if stage.name == "paper_and_ours" and RESPONSE not in parameters.responses_of_study:
        return False
    of_track = "track_runs" in (stage.name, *stage.inputs)
    if stage.name == "density_in_time" and case not in parameters.study.in_time.cases:
        return False
    if "tracks" in (stage.name, *stage.inputs) and not on_tracks(case):
        return False
    needed = [STAGES[role] for role, one in stage.inputs.items() if not one.optional]
    return (case in TRACK_CASES or not of_track) and all(
        methods_of(case, one.methods) for one in (stage, *needed)
    )


def of_split(case: str) -> list[str]:
    """The file of a case on what its track contributes, if it has one."""
    stage = STAGES["track_split"]
    return [file_of("track_split", case=case)] if possible(stage, case) else []


def of_first_split() -> list[str]:
    """The first such file of any case."""
    return [file for case in CASES for file in of_split(case)][:1]


def followed_cases() -> list[str]:
    """Cases whose responses are followed over the time of a passage."""
    stage = STAGES["density_in_time"]
    return [case for case in CASES if possible(stage, case)]


def cases_of(stage) -> list[str]:
    """Cases that a stage of each case is made for."""
    swept = [case for case in SWEEPS if all(map(methods_of, swept_cases(case)))]
    if stage.name == "sweep":
        return swept
    if stage.name == "mean_run":
        return [one for case in swept for one in swept_cases(case)]
    return [case for case in CASES if possible(stage, case)]


def results() -> list[str]:
    """The file of every stage for all cases and methods that are named."""
    files = (
        [file_of("statistics_check", scope="statistics")]
        if checked_cases(False)
        else []
    )
    for name, stage in STAGES.items():
        wildcards = set(re.findall(r"{(\w+)}", FILES[name]))
        if name == "control_study" and not CONTROL_CASES:
            continue
        if name in ("limits_table", "limit_state_table") and not any(
            map(methods_of, CASES)
        ):
            continue
        if not wildcards and (stage.of == "run" or possible(stage, TABLE_CASE)):
            files.append(file_of(name))
        if wildcards == {"case"}:
            files += [file_of(name, case=case) for case in cases_of(stage)]
        if wildcards == {"case", "method"}:
            files += [file for case in CASES for file in of_methods(name, case)]
    return files


def figures_of_case(case: str) -> dict[str, tuple[str, list[str]]]:
    """Figures that a case has by its methods: name of the file, module and files it is drawn from.

    A sweep has one figure, and the cases that it makes have theirs; a case whose methods cannot be
    carried out has none.
    """
    if case in cases_of(STAGES["sweep"]):
        return {"sweep": ("sweep", [file_of("sweep", case=case)])}
    if not methods_of(case):
        return {}

    def of(*names: str) -> list[str]:
        return [file for one in names for file in of_methods(one, case)]

    figures = {
        "density": ("density", of("density")),
        "exceedance": ("exceedance", of("density", "limit_states")),
        "limits": ("limits", of("limits")),
    }
    for method in methods_of(case, DESIGNED):
        file = file_of("surrogate", case=case, method=method)
        figures[f"sobol_{method}"] = ("sobol", [file])
    if methods_of(case, (BASELINE,)):
        file = file_of("baseline", case=case, method=BASELINE)
        figures["scatter"] = ("scatter", [file])
    if case in followed_cases():
        figures["in_time"] = ("in_time", [file_of("density_in_time", case=case)])
    if of_split(case):
        figures["track_split"] = ("track_split", of_split(case))
    if judged(case):
        for name in ("accuracy", "prediction"):
            figures[name] = (name, [file_of(name, case=case)])
    return figures


def figures_of_study() -> list[str]:
    """Figures that the cases and methods named in the configuration allow."""
    of_paper = [name for name, (_, _, files) in DRAWN.items() if files]
    of_cases = [
        f"{case}/{name}" for case in parameters.cases for name in figures_of_case(case)
    ]
    return [f"<results>/figures/{name}.png" for name in (*of_paper, *of_cases)]


def drawn_from(case: str):
    """Function that finds the files of every figure of a case, by its name."""

    def found(wildcards) -> dict[str, list[str]]:
        return {name: files for name, (_, files) in figures_of_case(case).items()}

    return found


def words_of(case: str):
    """Function that writes what `maglev figures` is given for all figures of a case."""

    def written(wildcards, input, output) -> str:
        folder = Path(output[0]).parent
        return " + ".join(
            " ".join([module, str(folder / name), *input[name]])
            for name, (module, _) in figures_of_case(case).items()
        )

    return written
