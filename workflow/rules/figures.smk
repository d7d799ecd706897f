# One rule per figure: PNG, PDF, and the numbers in it as NetCDF, from files already computed.

# figure: the module that draws it, what it shows, and the files it is drawn from
DRAWN = {
    "fig7": (
        "irregularity",
        "track irregularity and its spectra",
        [file_of("irregularity")],
    ),
    "fig8": (
        "deflection",
        "midspan deflection and dynamic coefficient",
        [file_of("deflection"), file_of("dynamic_factor")],
    ),
    "histories": ("histories", "histories of the six responses", [file_of("passage")]),
    "gaps": ("gaps", "gaps and currents of the magnets", [file_of("passage")]),
    "modes": (
        "modes",
        "modes and frequencies of the guideway",
        [file_of("guideway_modes")],
    ),
    "fig_stiffness": (
        "stiffness_check",
        "static deflection against frequency, whatever the stiffness",
        [file_of("stiffness_check")],
    ),
    "fig_train_modes": (
        "train_modes",
        "frequencies and damping of the train's modes",
        [file_of("train_modes")],
    ),
    "fig9": (
        "training",
        "errors against the number of training runs",
        of_judged("accuracy")
        and [
            *of_judged("accuracy"),
            *of_methods("design", TABLE_CASE),
        ],
    ),
    "fig10": (
        "prediction",
        "predicted against computed extremes",
        of_judged("prediction"),
    ),
    "fig11": (
        "density_by_method",
        "densities by every method",
        of_baseline("density") and of_methods("density", TABLE_CASE),
    ),
    "fig12": (
        "exceedance_by_method",
        "probabilities of exceedance by every method",
        of_baseline("density") and of_methods("density", TABLE_CASE),
    ),
    "fig13": (
        "density_by_gain",
        "densities with each gain random alone, and with all",
        of_last_method(GAIN_CASES, "density", "design"),
    ),
    "fig14": (
        "limits_by_gain",
        "limits with each gain random alone, and with all",
        of_last_method(GAIN_CASES, "limits", "design"),
    ),
    "fig15": (
        "density_by_variation",
        "densities for gains that vary ever more",
        of_last_method(VARIATION_CASES, "density", "design"),
    ),
    "fig16": (
        "limits_by_variation",
        "limits for gains that vary ever more",
        of_last_method(VARIATION_CASES, "limits", "design"),
    ),
    "fig_control_density": (
        "density_by_control",
        "densities for each sharing of circuits, and with lag",
        of_last_method(CONTROL_CASES, "density", "design"),
    ),
    "fig_control_limits": (
        "limits_by_control",
        "limits for each sharing of circuits, and with lag",
        of_last_method(CONTROL_CASES, "limits", "design"),
    ),
    "fig_sobol": (
        "sobol",
        "which gain matters for which response",
        of_last_method([TABLE_CASE], "surrogate"),
    ),
    "fig_stability": (
        "stability",
        "which gains of the suspension hold the train",
        of_baseline("baseline") and [file_of("stability"), *of_baseline("baseline")],
    ),
    "fig_accuracy": (
        "accuracy",
        "accuracy that a number of runs buys",
        of_judged("accuracy"),
    ),
    "fig_scatter": (
        "scatter",
        "how the six responses go together",
        of_baseline("baseline"),
    ),
    "fig_tracks": (
        "tracks",
        "densities on each of many tracks, and of the line",
        of_line(),
    ),
    "fig_track_limits": (
        "track_limits",
        "limits on each of many tracks, and of the line",
        of_line(),
    ),
    "fig_track_split": (
        "track_split",
        "what random gains and a random track contribute",
        of_first_split(),
    ),
    "fig_in_time": (
        "in_time",
        "densities over the time of a passage",
        [file_of("density_in_time", case=case) for case in followed_cases()[:1]],
    ),
}


for figure, (module, words, files) in DRAWN.items():
    if not files:
        continue

    rule:
        name:
            figure
        input:
            files,
        output:
            multiext(f"<results>/figures/{figure}", ".png", ".pdf", ".nc"),
        log:
            f"<logs>/{figure}.log",
        benchmark:
            f"<benchmarks>/{figure}.tsv"
        conda:
            "../envs/maglev.yaml"
        params:
            out=subpath(output[0], strip_suffix=".png"),
            code=code_of("figures", f"figures.{module}"),
            module=module,
        message:
            f"Draw {words}"
        shell:
            "maglev figure {params.module} {input} --out {params.out} 2> {log}"


# all figures of a case in one job, whichever of them is asked for: most of its time is spent once
for case in parameters.cases:
    if not figures_of_case(case):
        continue

    rule:
        name:
            f"figures_{case}"
        input:
            unpack(drawn_from(case)),
        output:
            [
                f"<results>/figures/{case}/{name}.{ending}"
                for name in figures_of_case(case)
                for ending in ("png", "pdf", "nc")
            ],
        log:
            f"<logs>/figures/{case}.log",
        benchmark:
            f"<benchmarks>/figures/{case}.tsv"
        conda:
            "../envs/maglev.yaml"
        params:
            code=[
                code_of("figures", f"figures.{module}")
                for module, _ in figures_of_case(case).values()
            ],
            words=words_of(case),
        message:
            f"Draw the figures of {case}"
        shell:
            "maglev figures {params.words} 2> {log}"
