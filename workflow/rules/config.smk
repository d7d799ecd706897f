# The configuration as used: whole, and for each stage the part that it reads.  A stage depends on
# the file with its part, which is rewritten only when one of its values changes.


rule run_config:
    output:
        "<results>/run_config.yaml",
    log:
        "<logs>/run_config.log",
    conda:
        "../envs/maglev.yaml"
    params:
        text=config_text(config, f"results/{config['run']}"),
    message:
        "Write the configuration as used"
    shell:
        "printf %s {params.text:q} > {output} 2> {log}"


rule stage_config:
    output:
        "<results>/config/{stage}.yaml",
    log:
        "<logs>/config/{stage}.log",
    wildcard_constraints:
        stage=stages_reading("run"),
    conda:
        "../envs/maglev.yaml"
    params:
        text=lambda wildcards: config_text(
            STAGES[wildcards.stage].slice(parameters),
            f"results/{config['run']}/config",
        ),
    message:
        "Write what the stage '{wildcards.stage}' reads of the configuration"
    shell:
        "printf %s {params.text:q} > {output} 2> {log}"


rule case_config:
    output:
        "<results>/{case}/config/{stage}.yaml",
    log:
        "<logs>/{case}/config/{stage}.log",
    wildcard_constraints:
        stage=stages_reading("case"),
    conda:
        "../envs/maglev.yaml"
    params:
        text=lambda wildcards: config_text(
            STAGES[wildcards.stage].slice(parameters, wildcards.case),
            f"results/{config['run']}/{wildcards.case}/config",
        ),
    message:
        "Write what the stage '{wildcards.stage}' of '{wildcards.case}' reads"
    shell:
        "printf %s {params.text:q} > {output} 2> {log}"


rule method_config:
    output:
        "<results>/{case}/{method}/config/{stage}.yaml",
    log:
        "<logs>/{case}/{method}/config/{stage}.log",
    wildcard_constraints:
        stage=stages_reading("method"),
    conda:
        "../envs/maglev.yaml"
    params:
        text=lambda wildcards: config_text(
            STAGES[wildcards.stage].slice(
                parameters, wildcards.case, wildcards.method
            ),
            f"results/{config['run']}/{wildcards.case}/{wildcards.method}/config",
        ),
    message:
        "Write what the stage '{wildcards.stage}' of '{wildcards.case}', {wildcards.method}, reads"
    shell:
        "printf %s {params.text:q} > {output} 2> {log}"
