# From runs to statements: surrogates, densities, limits, tables, and whether they mean something.


rule surrogate:
    input:
        config="<results>/config/surrogate.yaml",
        design="<results>/{case}/{method}/design.nc",
    output:
        "<results>/{case}/{method}/surrogate.nc",
    log:
        "<logs>/{case}/{method}/surrogate.log",
    benchmark:
        "<benchmarks>/{case}/{method}/surrogate.tsv"
    wildcard_constraints:
        method="|".join(DESIGNED),
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.surrogate"),
    message:
        "Fit the surrogate '{wildcards.method}' of '{wildcards.case}'"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev surrogate --config {input.config} "
        "--case {wildcards.case} --method {wildcards.method} --design {input.design} "
        "--out {output} 2> {log}"


rule eev:
    input:
        config="<results>/config/eev.yaml",
        design="<results>/{case}/{method}/design.nc",
        surrogate="<results>/{case}/{method}/surrogate.nc",
        points="<results>/{case}/points/representative.nc",
    output:
        "<results>/{case}/{method}/eev.nc",
    log:
        "<logs>/{case}/{method}/eev.log",
    benchmark:
        "<benchmarks>/{case}/{method}/eev.tsv"
    wildcard_constraints:
        method="|".join(DESIGNED),
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.eev"),
    message:
        "Predict the extremes at the representative points of '{wildcards.case}', "
        "{wildcards.method}"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev eev --config {input.config} "
        "--case {wildcards.case} --method {wildcards.method} --design {input.design} "
        "--surrogate {input.surrogate} --points {input.points} --out {output} 2> {log}"


rule density:
    input:
        config="<results>/config/density.yaml",
        design="<results>/{case}/{method}/design.nc",
        surrogate="<results>/{case}/{method}/surrogate.nc",
        eev="<results>/{case}/{method}/eev.nc",
    output:
        "<results>/{case}/{method}/density.nc",
    log:
        "<logs>/{case}/{method}/density.log",
    benchmark:
        "<benchmarks>/{case}/{method}/density.tsv"
    wildcard_constraints:
        method="|".join(DESIGNED),
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.density"),
    message:
        "Evolve the densities of '{wildcards.case}', {wildcards.method}"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev density --config {input.config} "
        "--case {wildcards.case} --method {wildcards.method} --design {input.design} "
        "--surrogate {input.surrogate} --eev {input.eev} --out {output} 2> {log}"


rule density_mcm:
    input:
        config="<results>/config/density.yaml",
        runs="<results>/{case}/mcm.nc",
    output:
        "<results>/{case}/mcm/density.nc",
    log:
        "<logs>/{case}/mcm/density.log",
    benchmark:
        "<benchmarks>/{case}/mcm/density.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.density"),
    message:
        "Take the densities of the baseline of '{wildcards.case}'"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev density --config {input.config} --case {wildcards.case} --method mcm "
        "--runs {input.runs} --out {output} 2> {log}"


rule limits:
    input:
        config="<results>/config/limits.yaml",
        design="<results>/{case}/{method}/design.nc",
        surrogate="<results>/{case}/{method}/surrogate.nc",
    output:
        "<results>/{case}/{method}/limits.nc",
    log:
        "<logs>/{case}/{method}/limits.log",
    benchmark:
        "<benchmarks>/{case}/{method}/limits.tsv"
    wildcard_constraints:
        method="|".join(DESIGNED),
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.limits"),
    message:
        "Read the limits of '{wildcards.case}' off the surrogate '{wildcards.method}'"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev limits --config {input.config} "
        "--case {wildcards.case} --method {wildcards.method} --design {input.design} "
        "--surrogate {input.surrogate} --out {output} 2> {log}"


rule limits_mcm:
    input:
        config="<results>/config/limits.yaml",
        runs="<results>/{case}/mcm.nc",
    output:
        "<results>/{case}/mcm/limits.nc",
    log:
        "<logs>/{case}/mcm/limits.log",
    benchmark:
        "<benchmarks>/{case}/mcm/limits.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.limits"),
    message:
        "Read the limits of '{wildcards.case}' off its baseline"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev limits --config {input.config} --case {wildcards.case} --method mcm "
        "--runs {input.runs} --out {output} 2> {log}"


rule accuracy:
    input:
        config="<results>/config/accuracy.yaml",
        baseline="<results>/{case}/mcm.nc",
        designs=lambda wildcards: files_of_case("design", wildcards.case, designed=True),
    output:
        "<results>/{case}/accuracy.nc",
    log:
        "<logs>/{case}/accuracy.log",
    benchmark:
        "<benchmarks>/{case}/accuracy.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.accuracy"),
        designs=lambda wildcards, input: named(
            "design", methods_of(wildcards.case, designed=True), input.designs
        ),
    message:
        "Judge the methods of '{wildcards.case}' by its baseline"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev accuracy --config {input.config} "
        "--case {wildcards.case} --baseline {input.baseline} {params.designs} "
        "--out {output} 2> {log}"


rule prediction:
    input:
        config="<results>/config/prediction.yaml",
        baseline="<results>/{case}/mcm.nc",
        designs=lambda wildcards: files_of_case("design", wildcards.case, designed=True),
        surrogates=lambda wildcards: files_of_case(
            "surrogate", wildcards.case, designed=True
        ),
    output:
        "<results>/{case}/prediction.nc",
    log:
        "<logs>/{case}/prediction.log",
    benchmark:
        "<benchmarks>/{case}/prediction.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.prediction"),
        designs=lambda wildcards, input: named(
            "design", methods_of(wildcards.case, designed=True), input.designs
        ),
        surrogates=lambda wildcards, input: named(
            "surrogate", methods_of(wildcards.case, designed=True), input.surrogates
        ),
    message:
        "Predict the baseline of '{wildcards.case}' by every method"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev prediction --config {input.config} "
        "--case {wildcards.case} --baseline {input.baseline} {params.designs} "
        "{params.surrogates} --out {output} 2> {log}"


rule stability:
    input:
        config="<results>/config/stability.yaml",
    output:
        "<results>/stability.nc",
    log:
        "<logs>/stability.log",
    benchmark:
        "<benchmarks>/stability.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.stability"),
    message:
        "Map which gains of the suspension hold the train"
    shell:
        "maglev stability --config {input.config} --out {output} 2> {log}"


rule track_split:
    input:
        config="<results>/config/track_split.yaml",
        baseline="<results>/{case}/mcm.nc",
        parts=expand("<results>/{{case}}/track/{part}.nc", part=TRACK_PARTS),
    output:
        "<results>/{case}/track_split.nc",
    log:
        "<logs>/{case}/track_split.log",
    benchmark:
        "<benchmarks>/{case}/track_split.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.track_split"),
        parts=lambda wildcards, input: named("part", TRACK_PARTS, input.parts),
    message:
        "Split gains from track in '{wildcards.case}'"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev track-split --config {input.config} --case {wildcards.case} "
        "--baseline {input.baseline} {params.parts} --out {output} 2> {log}"


rule table1:
    input:
        config="<results>/config/table1.yaml",
        limits=files_of_case("limits", TABLE_CASE),
    output:
        multiext("<results>/tables/table1", ".nc", ".csv", ".md"),
    log:
        "<logs>/table1.log",
    benchmark:
        "<benchmarks>/table1.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".nc"),
        code=code_of("stages.table1"),
        limits=lambda wildcards, input: named(
            "limits", methods_of(TABLE_CASE), input.limits
        ),
        case=TABLE_CASE,
    message:
        "Put the limits of all methods into Table 1"
    shell:
        "maglev table1 --config {input.config} --case {params.case} {params.limits} "
        "--out {params.out} 2> {log}"


rule paper_and_ours:
    input:
        config="<results>/config/paper_and_ours.yaml",
        densities=files_of_case("density", TABLE_CASE),
        designs=files_of_case("design", TABLE_CASE, designed=True),
        accuracy=f"<results>/{TABLE_CASE}/accuracy.nc",
    output:
        multiext("<results>/tables/paper_and_ours", ".nc", ".csv", ".md"),
    log:
        "<logs>/paper_and_ours.log",
    benchmark:
        "<benchmarks>/paper_and_ours.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".nc"),
        code=code_of("stages.paper_and_ours"),
        densities=lambda wildcards, input: named(
            "density", methods_of(TABLE_CASE), input.densities
        ),
        designs=lambda wildcards, input: named(
            "design", methods_of(TABLE_CASE, designed=True), input.designs
        ),
        case=TABLE_CASE,
    message:
        "Set our numbers beside the paper's"
    shell:
        "maglev paper-and-ours --config {input.config} --case {params.case} "
        "{params.densities} {params.designs} --accuracy {input.accuracy} "
        "--out {params.out} 2> {log}"


rule statistics:
    input:
        config="<results>/config/statistics_check.yaml",
        baselines=[f"<results>/{case}/mcm.nc" for case in checked_cases(every=False)],
        limits=[
            f"<results>/{case}/{method}/limits.nc"
            for case, method in checked_pairs(every=False)
        ],
    output:
        "<results>/checks/statistics.nc",
    log:
        "<logs>/statistics.log",
    benchmark:
        "<benchmarks>/statistics.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.statistics_check"),
        baselines=lambda wildcards, input: named(
            "baseline", checked_cases(every=False), input.baselines
        ),
        limits=lambda wildcards, input: named(
            "limits",
            [f"{case} {method}" for case, method in checked_pairs(every=False)],
            input.limits,
        ),
    message:
        "Check that the statistics mean something"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev statistics-check --config {input.config} {params.baselines} "
        "{params.limits} --out {output} 2> {log}"


# the same for all cases, with the baselines of the target `truth`
use rule statistics as statistics_truth with:
    input:
        config="<results>/config/statistics_check.yaml",
        baselines=[f"<results>/{case}/mcm.nc" for case in checked_cases(every=True)],
        limits=[
            f"<results>/{case}/{method}/limits.nc"
            for case, method in checked_pairs(every=True)
        ],
    output:
        "<results>/checks/statistics_truth.nc",
    log:
        "<logs>/statistics_truth.log",
    benchmark:
        "<benchmarks>/statistics_truth.tsv"
    params:
        code=code_of("stages.statistics_check"),
        baselines=lambda wildcards, input: named(
            "baseline", checked_cases(every=True), input.baselines
        ),
        limits=lambda wildcards, input: named(
            "limits",
            [f"{case} {method}" for case, method in checked_pairs(every=True)],
            input.limits,
        ),
    message:
        "Check the statistics of all cases against their baselines"
