"""Batch studies: many cases of one problem, solved over processes or a cluster, kept in a store that loses nothing.

    plan = plan.load("study.toml");  run.run(plan, Path("out"))

plan: the cases of a study file · answer: one case solved, JSON to JSON · pool, cluster: where · store: what is kept ·
rows, export: the table · run: the loop.
"""
