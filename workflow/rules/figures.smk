# One rule per figure: PNG, PDF, and the numbers in it as NetCDF, from files already computed.


rule fig7:
    input:
        "<results>/track/irregularity.nc",
    output:
        multiext("<results>/figures/fig7", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig7.log",
    benchmark:
        "<benchmarks>/fig7.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.irregularity"),
    message:
        "Draw Fig. 7: track irregularity and its spectra"
    shell:
        "maglev figure irregularity {input} --out {params.out} 2> {log}"


rule fig8:
    input:
        "<results>/validation/deflection.nc",
        "<results>/validation/dynamic_factor.nc",
    output:
        multiext("<results>/figures/fig8", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig8.log",
    benchmark:
        "<benchmarks>/fig8.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.deflection"),
    message:
        "Draw Fig. 8: midspan deflection and dynamic coefficient"
    shell:
        "maglev figure deflection {input} --out {params.out} 2> {log}"


rule histories:
    input:
        "<results>/validation/passage.nc",
    output:
        multiext("<results>/figures/histories", ".png", ".pdf", ".nc"),
    log:
        "<logs>/histories.log",
    benchmark:
        "<benchmarks>/histories.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.histories"),
    message:
        "Draw the histories of the six responses"
    shell:
        "maglev figure histories {input} --out {params.out} 2> {log}"


rule gaps:
    input:
        "<results>/validation/passage.nc",
    output:
        multiext("<results>/figures/gaps", ".png", ".pdf", ".nc"),
    log:
        "<logs>/gaps.log",
    benchmark:
        "<benchmarks>/gaps.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.gaps"),
    message:
        "Draw the gaps and currents of the magnets"
    shell:
        "maglev figure gaps {input} --out {params.out} 2> {log}"


rule modes:
    input:
        "<results>/guideway/modes.nc",
    output:
        multiext("<results>/figures/modes", ".png", ".pdf", ".nc"),
    log:
        "<logs>/modes.log",
    benchmark:
        "<benchmarks>/modes.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.modes"),
    message:
        "Draw the guideway's modes and frequencies"
    shell:
        "maglev figure modes {input} --out {params.out} 2> {log}"


rule fig_train_modes:
    input:
        "<results>/train/modes.nc",
    output:
        multiext("<results>/figures/fig_train_modes", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_train_modes.log",
    benchmark:
        "<benchmarks>/fig_train_modes.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.train_modes"),
    message:
        "Draw the train's modes by frequency and damping"
    shell:
        "maglev figure train_modes {input} --out {params.out} 2> {log}"
