# One rule per figure of the study: PNG, PDF, and the numbers in it, from files already computed.


rule fig9:
    input:
        f"<results>/{TABLE_CASE}/accuracy.nc",
        files_of_case("design", TABLE_CASE, designed=True),
    output:
        multiext("<results>/figures/fig9", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig9.log",
    benchmark:
        "<benchmarks>/fig9.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.training"),
    message:
        "Draw Fig. 9: errors against the number of training runs"
    shell:
        "maglev figure training {input} --out {params.out} 2> {log}"


rule fig10:
    input:
        f"<results>/{TABLE_CASE}/prediction.nc",
    output:
        multiext("<results>/figures/fig10", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig10.log",
    benchmark:
        "<benchmarks>/fig10.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.prediction"),
    message:
        "Draw Fig. 10: predicted against computed extremes"
    shell:
        "maglev figure prediction {input} --out {params.out} 2> {log}"


rule fig11:
    input:
        files_of_case("density", TABLE_CASE),
    output:
        multiext("<results>/figures/fig11", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig11.log",
    benchmark:
        "<benchmarks>/fig11.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.density_by_method"),
    message:
        "Draw Fig. 11: densities by every method"
    shell:
        "maglev figure density_by_method {input} --out {params.out} 2> {log}"


rule fig12:
    input:
        files_of_case("density", TABLE_CASE),
    output:
        multiext("<results>/figures/fig12", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig12.log",
    benchmark:
        "<benchmarks>/fig12.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.exceedance_by_method"),
    message:
        "Draw Fig. 12: probabilities of exceedance by every method"
    shell:
        "maglev figure exceedance_by_method {input} --out {params.out} 2> {log}"


rule fig13:
    input:
        shown("density", GAIN_CASES),
        shown("design", GAIN_CASES),
    output:
        multiext("<results>/figures/fig13", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig13.log",
    benchmark:
        "<benchmarks>/fig13.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.density_by_gain"),
    message:
        "Draw Fig. 13: densities with each gain random alone, and with all"
    shell:
        "maglev figure density_by_gain {input} --out {params.out} 2> {log}"


rule fig14:
    input:
        shown("limits", GAIN_CASES),
        shown("design", GAIN_CASES),
    output:
        multiext("<results>/figures/fig14", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig14.log",
    benchmark:
        "<benchmarks>/fig14.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.limits_by_gain"),
    message:
        "Draw Fig. 14: limits with each gain random alone, and with all"
    shell:
        "maglev figure limits_by_gain {input} --out {params.out} 2> {log}"


rule fig15:
    input:
        shown("density", VARIATION_CASES),
        shown("design", VARIATION_CASES),
    output:
        multiext("<results>/figures/fig15", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig15.log",
    benchmark:
        "<benchmarks>/fig15.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.density_by_variation"),
    message:
        "Draw Fig. 15: densities for gains that vary ever more"
    shell:
        "maglev figure density_by_variation {input} --out {params.out} 2> {log}"


rule fig16:
    input:
        shown("limits", VARIATION_CASES),
        shown("design", VARIATION_CASES),
    output:
        multiext("<results>/figures/fig16", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig16.log",
    benchmark:
        "<benchmarks>/fig16.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.limits_by_variation"),
    message:
        "Draw Fig. 16: limits for gains that vary ever more"
    shell:
        "maglev figure limits_by_variation {input} --out {params.out} 2> {log}"


rule fig_sobol:
    input:
        shown("surrogate", [TABLE_CASE]),
    output:
        multiext("<results>/figures/fig_sobol", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_sobol.log",
    benchmark:
        "<benchmarks>/fig_sobol.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.sobol"),
    message:
        "Draw which gain matters for which response"
    shell:
        "maglev figure sobol {input} --out {params.out} 2> {log}"


rule fig_stability:
    input:
        "<results>/stability.nc",
        f"<results>/{TABLE_CASE}/mcm.nc",
    output:
        multiext("<results>/figures/fig_stability", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_stability.log",
    benchmark:
        "<benchmarks>/fig_stability.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.stability"),
    message:
        "Draw which gains of the suspension hold the train"
    shell:
        "maglev figure stability {input} --out {params.out} 2> {log}"


rule fig_accuracy:
    input:
        f"<results>/{TABLE_CASE}/accuracy.nc",
    output:
        multiext("<results>/figures/fig_accuracy", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_accuracy.log",
    benchmark:
        "<benchmarks>/fig_accuracy.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.accuracy"),
    message:
        "Draw the accuracy that a number of runs buys"
    shell:
        "maglev figure accuracy {input} --out {params.out} 2> {log}"


rule fig_scatter:
    input:
        f"<results>/{TABLE_CASE}/mcm.nc",
    output:
        multiext("<results>/figures/fig_scatter", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_scatter.log",
    benchmark:
        "<benchmarks>/fig_scatter.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.scatter"),
    message:
        "Draw how the six responses go together"
    shell:
        "maglev figure scatter {input} --out {params.out} 2> {log}"


rule fig_track_split:
    input:
        [f"<results>/{case}/track_split.nc" for case in SPLIT_CASES[:1]],
    output:
        multiext("<results>/figures/fig_track_split", ".png", ".pdf", ".nc"),
    log:
        "<logs>/fig_track_split.log",
    benchmark:
        "<benchmarks>/fig_track_split.tsv"
    conda:
        "../envs/maglev.yaml"
    params:
        out=subpath(output[0], strip_suffix=".png"),
        code=code_of("figures", "figures.track_split"),
    message:
        "Draw what random gains and a random track contribute"
    shell:
        "maglev figure track_split {input} --out {params.out} 2> {log}"
