"""Batch studies: many cases of one problem, solved over processes or a cluster, kept in a store that loses nothing.

    report = run.run(plan.load("study.toml"), Path("out"))

plan, overrides: the cases of a study file · answer: one case solved, JSON to JSON · pool, cluster: where it is ·
store: what is kept · rows, export, picture: what is written · run: the loop · command, progress, summary: the words.
"""
