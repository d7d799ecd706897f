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
        set="[a-z_]+",
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.points"),
    message:
        "Draw the points '{wildcards.set}' of '{wildcards.case}'"
    shell:
        "maglev points --config {input.config} --case {wildcards.case} --set {wildcards.set} "
        "--out {output} 2> {log}"
