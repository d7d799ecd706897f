# Which files the cases of the configuration and their methods have, for the rules that take many.


DESIGNED = [method for method in METHODS if method != "mcm"]
TABLE_CASE = "validation"
GAIN_CASES = [
    case for case in parameters.cases if case.startswith("only_") or case == "all_gains"
]
VARIATION_CASES = [case for case in parameters.cases if case.startswith("cov_")]
SPLIT_CASES = [case for case in parameters.cases if parameters.cases[case].random_track]


def methods_of(case: str, designed: bool = False) -> list[str]:
    """Methods that a case names, all or only those with a surrogate."""
    named = parameters.cases[case].methods if case in parameters.cases else ()
    return [one for one in METHODS if one in named and not (designed and one == "mcm")]


def files_of_case(name: str, case: str, designed: bool = False) -> list[str]:
    """A file of each method of a case."""
    return [f"<results>/{case}/{one}/{name}.nc" for one in methods_of(case, designed)]


def of_all_cases(name: str) -> list[str]:
    """A file of each method of each case."""
    return [file for case in parameters.cases for file in files_of_case(name, case)]


def named(option: str, names: list[str], files: list[str]) -> str:
    """The same option for several files, each with its name before it."""
    return " ".join(
        f"--{option} {name} {file}" for name, file in zip(names, files, strict=True)
    )


def checked_cases(every: bool) -> list[str]:
    """Cases whose statistics can be checked: with a baseline of their own, or all."""
    return [
        case
        for case in parameters.cases
        if not parameters.cases[case].random_track
        and (every or "mcm" in methods_of(case))
    ]


def checked_pairs(every: bool) -> list[tuple[str, str]]:
    """Cases and methods with a surrogate that are checked."""
    return [
        (case, method)
        for case in checked_cases(every)
        for method in methods_of(case, designed=True)
    ]


def judged_cases() -> list[str]:
    """Cases that have a baseline and something to judge by it."""
    return [
        case for case in checked_cases(every=False) if methods_of(case, designed=True)
    ]


def statistics_of_all_cases() -> list[str]:
    """Every file of this page for all cases and methods that are named."""
    split = [case for case in parameters.cases if parameters.cases[case].random_track]
    tables = []
    if TABLE_CASE in judged_cases():
        tables = ["table1", "paper_and_ours"]
    return [
        *of_all_cases("density"),
        *of_all_cases("limits"),
        *(f"<results>/{case}/accuracy.nc" for case in judged_cases()),
        *(f"<results>/{case}/track_split.nc" for case in split),
        *(f"<results>/tables/{table}.nc" for table in tables),
        *(["<results>/checks/statistics.nc"] if checked_cases(every=False) else []),
    ]


def shown(name: str, cases: list[str]) -> list[str]:
    """A file of each case by the method it is shown by: the last that has a surrogate."""
    return [
        f"<results>/{case}/{methods_of(case, designed=True)[-1]}/{name}.nc"
        for case in cases
        if methods_of(case, designed=True)
    ]


def figures_of_study() -> list[str]:
    """Figures that the cases and methods named in the configuration allow."""
    figures = []
    if TABLE_CASE in parameters.cases and "mcm" in methods_of(TABLE_CASE):
        figures += ["fig11", "fig12", "fig_stability", "fig_scatter"]
        if methods_of(TABLE_CASE, designed=True):
            figures += ["fig9", "fig10", "fig_accuracy"]
    if TABLE_CASE in parameters.cases and methods_of(TABLE_CASE, designed=True):
        figures.append("fig_sobol")
    for cases, names in (
        (GAIN_CASES, ["fig13", "fig14"]),
        (VARIATION_CASES, ["fig15", "fig16"]),
    ):
        if cases and all(methods_of(case, designed=True) for case in cases):
            figures += names
    if SPLIT_CASES:
        figures.append("fig_track_split")
    return [f"<results>/figures/{figure}.png" for figure in sorted(figures)]
