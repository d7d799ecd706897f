# Which files the cases of the configuration and their methods have, for figures and targets.


GAIN_CASES = [
    case for case in parameters.cases if case.startswith("only_") or case == "all_gains"
]
VARIATION_CASES = [case for case in parameters.cases if case.startswith("cov_")]
TRACK_CASES = [case for case in parameters.cases if parameters.cases[case].random_track]


def judged(case: str) -> bool:
    """Whether a case has a baseline and something to judge by it."""
    return bool(methods_of(case, (BASELINE,)) and methods_of(case, DESIGNED))


def of_methods(stage: str, case: str) -> list[str]:
    """Files of a stage of each method of a case that it is made for."""
    methods = methods_of(case, STAGES[stage].methods)
    return [place(stage, case=case, method=method) for method in methods]


def of_baseline(stage: str) -> list[str]:
    """The file of the baseline of the case of the tables, if it has one."""
    has_one = methods_of(TABLE_CASE, (BASELINE,))
    return [place(stage, case=TABLE_CASE, method=BASELINE)] if has_one else []


def of_judged(stage: str) -> list[str]:
    """The file of the case of the tables, if its methods can be judged by a baseline."""
    return [place(stage, case=TABLE_CASE)] if judged(TABLE_CASE) else []


def of_last_method(cases: list[str], *stages: str) -> list[str]:
    """A file of each stage and case by the last of its methods with a surrogate, or none at all."""
    designed = [methods_of(case, DESIGNED) for case in cases]
    return [
        place(stage, case=case, method=methods[-1])
        for stage in stages
        for case, methods in zip(cases, designed, strict=True)
        if all(designed)
    ]


def results_of_all_cases() -> list[str]:
    """Every file of the study for all cases and methods that are named."""
    files = (
        [place("statistics_check", scope="statistics")] if checked_cases(False) else []
    )
    for case in parameters.cases:
        if methods_of(case, (BASELINE,)):
            files.append(place("baseline", case=case))
        for stage in ("design", "density", "limits"):
            files += of_methods(stage, case)
        if case in checked_cases(False) and judged(case):
            files.append(place("accuracy", case=case))
        if case in TRACK_CASES:
            files.append(place("track_split", case=case))
    if judged(TABLE_CASE):
        files += [place("table1"), place("paper_and_ours")]
    return files


def figures_of_study() -> list[str]:
    """Figures that the cases and methods named in the configuration allow."""
    return [
        f"<results>/figures/{name}.png"
        for name, (_, _, files) in DRAWN.items()
        if files
    ]
