"""The chain above the rooms: a recording is measured into a store, and what the store holds is judged.

`measure` and `judge` do this for one recording and one measurement, `many` for all that a command names, `workers` in
processes of their own. `library` is what `import auditor` gives.
"""
