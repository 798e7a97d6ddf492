"""KEEP: measurements and verdicts as Parquet, and the SQL that reads them.

Names are imported when they are first used: a question needs neither what writes nor the types of what is kept.
"""

from typing import TYPE_CHECKING

import pyarrow

from auditor.model.lazy_names import imported_when_used

if TYPE_CHECKING:
    from auditor.store.calibrations import (
        Content,
        content_of,
        make_calibration,
        read_calibration,
        write_calibration,
        writing_calibration,
    )
    from auditor.store.connection import Connection, plain_connection
    from auditor.store.export import leave_pandas_out, rows_of, table_of
    from auditor.store.folder import StoreFolder
    from auditor.store.frames_writer import FramesWriter
    from auditor.store.queries import (
        Description,
        describe,
        list_queries,
        list_views,
        query,
        run_query,
        run_sql,
        run_sqls,
    )
    from auditor.store.records import (
        FrameErrors,
        FrameStatistics,
        JudgementRecord,
        JudgingRules,
        MeasurementRecord,
        RecordingRecord,
        Sighting,
        StoredJudgement,
        StoredMeasurement,
        measurement_id,
    )
    from auditor.store.sandbox.limits import SqlLimits
    from auditor.store.sandbox.process import run_sandboxed
    from auditor.store.store import Store
    from auditor.store.views import views_script

# Arrow would take Ctrl-C for itself while it reads or writes, and kill the process with it.
pyarrow.enable_signal_handlers(False)  # noqa: FBT003 - Arrow's signature

__all__ = [
    "Connection",
    "Content",
    "Description",
    "FrameErrors",
    "FrameStatistics",
    "FramesWriter",
    "JudgementRecord",
    "JudgingRules",
    "MeasurementRecord",
    "RecordingRecord",
    "Sighting",
    "SqlLimits",
    "Store",
    "StoreFolder",
    "StoredJudgement",
    "StoredMeasurement",
    "content_of",
    "describe",
    "leave_pandas_out",
    "list_queries",
    "list_views",
    "make_calibration",
    "measurement_id",
    "plain_connection",
    "query",
    "read_calibration",
    "rows_of",
    "run_query",
    "run_sandboxed",
    "run_sql",
    "run_sqls",
    "table_of",
    "views_script",
    "write_calibration",
    "writing_calibration",
]

_HOMES = {
    "calibrations": "Content content_of make_calibration read_calibration write_calibration writing_calibration",
    "connection": "Connection plain_connection",
    "export": "leave_pandas_out rows_of table_of",
    "folder": "StoreFolder",
    "frames_writer": "FramesWriter",
    "queries": "Description describe list_queries list_views query run_query run_sql run_sqls",
    "records": "FrameErrors FrameStatistics JudgementRecord JudgingRules MeasurementRecord RecordingRecord Sighting "
    "StoredJudgement StoredMeasurement measurement_id",
    "sandbox.limits": "SqlLimits",
    "sandbox.process": "run_sandboxed",
    "store": "Store",
    "views": "views_script",
}
"""The module of each name."""

__getattr__ = imported_when_used(__name__, _HOMES)
