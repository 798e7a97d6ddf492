"""What the processes of recordings need, made once: they are forked from one that has imported this module.

Threads do not survive a fork, so nothing here may start any; and no code of other packages' plug-ins is run, since that
would fail for all recordings at once.
"""

import pwd  # noqa: F401 - the standard library and NumPy import these two when they are first needed

import numpy.ma  # noqa: F401

from auditor.measurement.checks.found import measuring_digest
from auditor.model.rig_kind import ComparedTo
from auditor.pipeline.measure import library_versions  # with all that it imports
from auditor.recordings.decoding.ros import known_types
from auditor.resources import plug_ins
from auditor.store.export import leave_pandas_out, table_of
from auditor.store.schema import TABLES, table_schema

known_types()
plug_ins()
leave_pandas_out()
table_of([{"frame": 0}])
for table in TABLES:  # to read their descriptions takes a fifth of what a recording of one frame costs
    table_schema(table)
for compared_to in ComparedTo:
    measuring_digest(compared_to)
library_versions()
