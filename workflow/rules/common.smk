# What the rules of the stages need to know: which cases and methods there are, where files lie, and
# what the command of a stage is given.


STORE = f"results/.store/{config['run']}"
TABLE_CASE = parameters.figures.compared


# a case with a sweep stands for those that the sweep makes
SWEEPS = [case for case in parameters.cases if parameters.cases[case].sweep]
CASES = [case for case in parameters.cases if case not in SWEEPS]


for case in CASES:
    refused = [
        method
        for method in parameters.cases[case].methods
        if method not in parameters.cases[case].possible_methods
    ]
    if refused:
        logger.warning(f"cases.{case}: without {', '.join(refused)}: {WHY_NO_DESIGN}")
    if words := cost_words(parameters, case):
        logger.warning(f"cases.{case}.random: {words}")


def methods_of(case: str, among: tuple[str, ...] = METHODS) -> list[str]:
    """Methods that a case names, of some."""
    named = parameters.cases[case].possible_methods if case in CASES else ()
    return [one for one in among if one in named]


def swept_cases(case: str) -> list[str]:
    """Cases that the sweep of a case makes, in its order."""
    return [f"{case}_{number}" for number in parameters.cases[case].settings()]


def checked_cases(every: bool) -> list[str]:
    """Cases whose statistics can be checked: with a baseline of their own, or all."""
    return [
        case
        for case in CASES
        if parameters.cases[case].track == "fixed"
        and (every or BASELINE in methods_of(case))
    ]


def named_cases(names: tuple[str, ...]) -> list[str]:
    """Those of some cases that there are."""
    return [case for case in names if case in CASES]


CONTROL_CASES = [
    case
    for case in named_cases(parameters.figures.by_control)
    if methods_of(case, DESIGNED)
]


def file_of(stage: str, **names: str) -> str:
    """Path of the file of a stage, for such names of its wildcards."""
    return f"<results>/{FILES[stage]}".format(**names)


def case_of(wildcards) -> str:
    """The case that a job is about; tables are about one case."""
    return wildcards.get("case", TABLE_CASE)


def config_of(stage, case: str, method: str | None) -> str:
    """File of the part of the configuration that a stage reads."""
    folder = {"run": "", "case": f"{case}/", "method": f"{case}/{method}/"}
    return f"<results>/{folder[stage.reads_of]}config/{stage.name}.yaml"


def stages_reading(of: str) -> str:
    """Pattern of the stages that read the same in a run, in each case or for each method."""
    return "|".join(name for name, stage in STAGES.items() if stage.reads_of == of)


def chunks(case: str) -> list[dict[str, str]]:
    """First sample and sample after the last of the chunks of a baseline."""
    n, size = n_samples(parameters, case), parameters.study.mcm.chunk_size
    return [
        {"start": str(start), "stop": str(min(start + size, n))}
        for start in range(0, n, size)
    ]


def names_of(stage, role: str, by: tuple[str, ...], wildcards) -> list[dict[str, str]]:
    """Names of the files of a role that has many."""
    case, every = case_of(wildcards), wildcards.get("scope") == "statistics_truth"
    if stage.name == "density_in_time":  # barriers are the limits of the best method
        return [{"method": methods_of(case, DESIGNED)[-1]}]
    if stage.name == "control_study":
        return [
            {"case": one, "method": method} if "method" in by else {"case": one}
            for one in CONTROL_CASES
            for method in (
                [*methods_of(one, (BASELINE,)), *methods_of(one, DESIGNED)[-1:]]
                if "method" in by
                else methods_of(one, (BASELINE,))
            )
        ]
    if stage.name in ("limits_table", "limit_state_table"):
        return [
            {"case": one, "method": method}
            for one in CASES
            for method in methods_of(one)
        ]
    if stage.name == "sweep":
        return [
            (
                {"case": one, "method": methods_of(one)[-1]}
                if "method" in by
                else {"case": one}
            )
            for one in swept_cases(case)
        ]
    return {
        ("method",): lambda: [
            {"method": method} for method in methods_of(case, STAGES[role].methods)
        ],
        ("part",): lambda: [{"part": part} for part in TRACK_PARTS],
        ("start", "stop"): lambda: chunks(case),
        ("case",): lambda: [{"case": case} for case in checked_cases(every)],
        ("case", "method"): lambda: [
            {"case": case, "method": method}
            for case in checked_cases(every)
            for method in methods_of(case, DESIGNED)
        ],
    }[by]()


def files_of(stage, wildcards) -> dict[str, list[tuple[dict[str, str], str]]]:
    """Files of every role of a stage, each with its names."""
    found = {}
    own = {"case": case_of(wildcards), "method": wildcards.get("method")}
    for role, one in stage.roles(own["method"]).items():
        if one.by:
            names = names_of(stage, role, one.by, wildcards)
        elif one.optional and not methods_of(own["case"], STAGES[role].methods):
            continue
        else:
            names = [{}]
        found[role] = [(each, file_of(role, **{**own, **each})) for each in names]
    return found


def inputs_of(stage):
    """Function that finds the inputs of a stage: configuration, what it names, and every role."""

    def found(wildcards) -> dict[str, str | list[str]]:
        of = {"case": case_of(wildcards), "method": wildcards.get("method")}
        files = {
            role: [path for _, path in paths]
            for role, paths in files_of(stage, wildcards).items()
        }
        named = stage.files(parameters, **of)
        return {"config": config_of(stage, **of), **named, **files}

    return found


def options_of(stage):
    """Function that writes the options of the command of a stage, but for threads and output."""

    def written(wildcards, input) -> str:
        given = {"case": case_of(wildcards), "store": STORE, **dict(wildcards.items())}
        files = files_of(stage, wildcards)
        words = []
        for option in stage.options:
            if option == "config":
                words += [flag(option), input.config]
            elif option in files:
                for (names, _), path in zip(files[option], input[option], strict=True):
                    words += [flag(option), *names.values(), path]
            elif option in given:
                words += [flag(option), given[option]]
        return " ".join(words)

    return written


def tables_of(stage) -> list[str]:
    """The table of a stage as text beside its file, if it has one."""
    stem = f"<results>/{FILES[stage.name].removesuffix('.nc')}"
    return [f"{stem}{end}" for end in (".csv", ".md")] if stage.table else []


def message_of(stage) -> str:
    """What a job of a stage does, and for which names."""
    names = re.findall(r"{(\w+)}", FILES[stage.name])
    return f"{SUMMARIES[stage.name]} {' '.join(f'{{wildcards.{n}}}' for n in names)}"
