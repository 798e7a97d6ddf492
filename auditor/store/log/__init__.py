"""The log of a store: who did what to it, when and with what, in chains of hashes that nobody can change unseen.

    with run(store.folder, ["auditor", "judge"]) as entry:
        entry.used("recording", recording_id, name)
        with entry.writing([output]):
            ...  # put the file in its place

`log/<host>-<id>.jsonl` is the chain of one writer. Each line is an entry with the hash of the one before it. A run
takes a chain that no process holds, or begins one, so machines need no coordination; its first and last entries have
the heads of all other chains that it saw.
"""
