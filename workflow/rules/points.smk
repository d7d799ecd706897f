# The points of the random gains that the methods of a case start from.


rule points:
    input:
        config="<results>/{case}/config/points.{set}.yaml",
    output:
        "<results>/{case}/points/{set}.nc",
    log:
        "<logs>/{case}/points/{set}.log",
    benchmark:
        "<benchmarks>/{case}/points/{set}.tsv"
    wildcard_constraints:
        set="baseline|representative|osm",
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.points"),
    message:
        "Draw the points '{wildcards.set}' of '{wildcards.case}'"
    shell:
        "maglev points --config {input.config} --case {wildcards.case} "
        "--set {wildcards.set} {output} 2> {log}"


rule adaptive_points:
    input:
        config="<results>/{case}/config/points.{method}.yaml",
    output:
        initial="<results>/{case}/points/initial_{method}.nc",
        candidates="<results>/{case}/points/candidates_{method}.nc",
    log:
        "<logs>/{case}/points/{method}.log",
    benchmark:
        "<benchmarks>/{case}/points/{method}.tsv"
    wildcard_constraints:
        method="asm_paper|asm",
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.points"),
    message:
        "Draw the first points and the candidates of '{wildcards.method}' of '{wildcards.case}'"
    shell:
        "maglev points --config {input.config} --case {wildcards.case} "
        "--set initial_{wildcards.method} {output.initial} "
        "--set candidates_{wildcards.method} {output.candidates} 2> {log}"
