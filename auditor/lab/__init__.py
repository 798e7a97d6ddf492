"""PROVE: the audit is tried on data that are known to be attacked. Nothing of the product imports this room.

`attacks` and `simulation` make the data: attacks and faults on real frames, and synthetic drives. `evaluation` puts
them through the audit, `training` trains a matcher on them, `demo` makes the recordings of `auditor demo`.
"""
