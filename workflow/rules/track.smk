# The track that the train meets: its irregularity, and the guideway under it.


rule irregularity:
    input:
        config="<results>/config/irregularity.yaml",
        profile=config["irregularity"]["profile_file"] or [],
    output:
        "<results>/track/irregularity.nc",
    log:
        "<logs>/irregularity.log",
    benchmark:
        "<benchmarks>/irregularity.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.irregularity"),
    message:
        "Draw or read the track irregularity and estimate its spectra"
    shell:
        "maglev irregularity --config {input.config} --out {output} 2> {log}"


rule guideway_modes:
    input:
        config="<results>/config/modes.yaml",
        measurements=config["validation"]["measurements"],
    output:
        "<results>/guideway/modes.nc",
    log:
        "<logs>/guideway_modes.log",
    benchmark:
        "<benchmarks>/guideway_modes.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.modes"),
    message:
        "Compute the natural modes of the guideway"
    shell:
        "maglev modes --config {input.config} --out {output} 2> {log}"
