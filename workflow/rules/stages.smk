# One rule per stage, from its declaration: what it reads, is given and makes.

# where the file of each stage lies
FILES = {
    "irregularity": "track/irregularity.nc",
    "guideway_modes": "guideway/modes.nc",
    "passage": "validation/passage.nc",
    "deflection": "validation/deflection.nc",
    "dynamic_factor": "validation/dynamic_factor.nc",
    "stiffness_check": "validation/stiffness_check.nc",
    "stability": "stability.nc",
    "train_modes": "train/modes.nc",
    "baseline_points": "{case}/points/baseline.nc",
    "representative_points": "{case}/points/representative.nc",
    "initial_points": "{case}/points/initial_{method}.nc",
    "candidate_points": "{case}/points/candidates_{method}.nc",
    "baseline_chunk": "{case}/mcm/samples_{start}_{stop}.nc",
    "baseline": "{case}/mcm.nc",
    "track_runs": "{case}/track/{part}.nc",
    "track_split": "{case}/track_split.nc",
    "design": "{case}/{method}/design.nc",
    "surrogate": "{case}/{method}/surrogate.nc",
    "eev": "{case}/{method}/eev.nc",
    "density": "{case}/{method}/density.nc",
    "limits": "{case}/{method}/limits.nc",
    "density_in_time": "{case}/in_time/density.nc",
    "limit_states": "{case}/{method}/limit_states.nc",
    "mean_run": "{case}/mean_run.nc",
    "sweep": "{case}/sweep.nc",
    "accuracy": "{case}/accuracy.nc",
    "prediction": "{case}/prediction.nc",
    "tracks": "track/tracks.nc",
    "line": "tables/line.nc",
    "control_study": "tables/control_study.nc",
    "table1": "tables/table1.nc",
    "limits_table": "tables/limits.nc",
    "limit_state_table": "tables/limit_states.nc",
    "paper_and_ours": "tables/paper_and_ours.nc",
    "statistics_check": "checks/{scope}.nc",
}

# jobs that run passages at the same time
THREADS = {"density_in_time": 2, "dynamic_factor": 2, "tracks": 2}


for stage in STAGES.values():

    rule:
        name:
            stage.name
        input:
            unpack(inputs_of(stage)),
        output:
            file=f"<results>/{FILES[stage.name]}",
            table=tables_of(stage),
        log:
            f"<logs>/{FILES[stage.name].removesuffix('.nc')}.log",
        benchmark:
            f"<benchmarks>/{FILES[stage.name].removesuffix('.nc')}.tsv"
        wildcard_constraints:
            method="|".join(stage.methods),
            start="[0-9]+",
            stop="[0-9]+",
            part="|".join(TRACK_PARTS),
            scope="statistics|statistics_truth",
        conda:
            "../envs/maglev.yaml"
        threads: THREADS.get(stage.name, 1)
        params:
            code=stage.code,
            command=stage.command,
            options=options_of(stage),
        message:
            message_of(stage)
        shell:
            "NUMBA_NUM_THREADS={threads} MAGLEV_THREADS={threads} maglev {params.command} "
            "{params.options} --out {output.file} 2> {log}"


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
