# Runs of the model: baselines in chunks, designs in rounds.  All share one store, which is no output
# of any rule: a job that is killed leaves there what it has done.


rule mcm_chunk:
    input:
        config="<results>/{case}/config/runs.yaml",
        profile=PROFILE,
    output:
        "<results>/{case}/mcm/chunk_{chunk}.nc",
    log:
        "<logs>/{case}/mcm/chunk_{chunk}.log",
    benchmark:
        "<benchmarks>/{case}/mcm/chunk_{chunk}.tsv"
    wildcard_constraints:
        chunk="[0-9]+",
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.runs"),
        store=STORE,
        start=lambda wildcards: int(wildcards.chunk) * CHUNK,
        stop=lambda wildcards: min(
            (int(wildcards.chunk) + 1) * CHUNK, n_samples(wildcards.case)
        ),
    message:
        "Run samples {params.start} to {params.stop} of the baseline of '{wildcards.case}'"
    shell:
        "maglev runs --config {input.config} --case {wildcards.case} "
        "--start {params.start} --stop {params.stop} --store {params.store} "
        "--threads {threads} --out {output} 2> {log}"


rule mcm:
    input:
        config="<results>/{case}/config/runs.yaml",
        points="<results>/{case}/points/baseline.nc",
        chunks=chunks,
    output:
        "<results>/{case}/mcm.nc",
    log:
        "<logs>/{case}/mcm.log",
    benchmark:
        "<benchmarks>/{case}/mcm.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.runs"),
    message:
        "Put the baseline of '{wildcards.case}' together"
    shell:
        "maglev gather --config {input.config} --case {wildcards.case} "
        "--points {input.points} {input.chunks} --out {output} 2> {log}"


rule track_runs:
    input:
        config="<results>/{case}/config/runs.track.yaml",
        profile=PROFILE,
    output:
        "<results>/{case}/track/{part}.nc",
    log:
        "<logs>/{case}/track/{part}.log",
    benchmark:
        "<benchmarks>/{case}/track/{part}.tsv"
    wildcard_constraints:
        part="|".join(TRACK_PARTS),
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.runs"),
        store=STORE,
    message:
        "Run '{wildcards.part}' of '{wildcards.case}' to split gains from track"
    shell:
        "maglev track-runs --config {input.config} --case {wildcards.case} "
        "--part {wildcards.part} --store {params.store} --threads {threads} --out {output} 2> {log}"


rule design:
    input:
        config="<results>/{case}/{method}/config/design.yaml",
        initial=initial,
        candidates=candidates,
        baseline=baseline,
        profile=PROFILE,
    output:
        "<results>/{case}/{method}/design.nc",
    log:
        "<logs>/{case}/{method}/design.log",
    benchmark:
        "<benchmarks>/{case}/{method}/design.tsv"
    wildcard_constraints:
        method="osm|asm_paper|asm",
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.design"),
        store=STORE,
        options=lambda wildcards, input: " ".join(
            f"--{role} {input[role]}"
            for role in ("candidates", "baseline")
            if input[role]
        ),
    message:
        "Make the design '{wildcards.method}' of '{wildcards.case}'"
    shell:
        "NUMBA_NUM_THREADS={threads} maglev design --config {input.config} --case {wildcards.case} "
        "--method {wildcards.method} --initial {input.initial} {params.options} "
        "--store {params.store} --threads {threads} --out {output} 2> {log}"


rule purge:
    log:
        "<logs>/purge.log",
    conda:
        "../envs/maglev.yaml"
    params:
        store=STORE,
    message:
        "Throw away all runs and rounds that are kept for '{config[run]}'"
    shell:
        "rm -rf {params.store} 2> {log}"
