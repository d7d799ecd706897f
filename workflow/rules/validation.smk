# The train on the guideway, beside what was measured and what a closed form says.


rule passage:
    input:
        config="<results>/config/passage.yaml",
        profile=config["irregularity"]["profile_file"] or [],
    output:
        "<results>/validation/passage.nc",
    log:
        "<logs>/passage.log",
    benchmark:
        "<benchmarks>/passage.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.passage"),
    message:
        "Run the train over the guideway at the configured speed"
    shell:
        "maglev passage --config {input.config} --out {output} 2> {log}"


rule train_modes:
    input:
        config="<results>/config/train_modes.yaml",
    output:
        "<results>/train/modes.nc",
    log:
        "<logs>/train_modes.log",
    benchmark:
        "<benchmarks>/train_modes.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.train_modes"),
    message:
        "Compute the modes of one levitated car"
    shell:
        "maglev train-modes --config {input.config} --out {output} 2> {log}"


rule deflection:
    input:
        config="<results>/config/deflection.yaml",
        passage="<results>/validation/passage.nc",
    output:
        "<results>/validation/deflection.nc",
    log:
        "<logs>/deflection.log",
    benchmark:
        "<benchmarks>/deflection.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        code=code_of("stages.deflection"),
    message:
        "Set the midspan deflection beside that under a moving load"
    shell:
        "maglev deflection --config {input.config} --passage {input.passage} "
        "--out {output} 2> {log}"


rule dynamic_factor:
    input:
        config="<results>/config/dynamic_factor.yaml",
        measurements=config["validation"]["measurements"],
        profile=config["irregularity"]["profile_file"] or [],
    output:
        "<results>/validation/dynamic_factor.nc",
    log:
        "<logs>/dynamic_factor.log",
    benchmark:
        "<benchmarks>/dynamic_factor.tsv"
    conda:
        "../envs/maglev.yaml"
    threads: 2
    params:
        code=code_of("stages.dynamic_factor"),
        store=f"results/.store/{config['run']}/passages",
    message:
        "Sweep the speed for the dynamic coefficient"
    shell:
        "maglev dynamic-factor --config {input.config} --store {params.store} "
        "--threads {threads} --out {output} 2> {log}"
