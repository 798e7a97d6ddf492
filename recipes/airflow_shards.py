"""A scan in shards, one mapped task each, as a DAG of Airflow 3: put this file into Airflow's folder of DAGs.

The store is a folder that all workers reach, or an address such as s3://bucket/audit.
A shard that fails is tried again, and goes on where it was; the last task judges what was measured.
Findings (exit code 1) fail it, so that somebody is told.
"""

from datetime import datetime

from airflow.providers.standard.operators.bash import BashOperator
from airflow.sdk import DAG

SHARDS = 8
SCAN = "auditor scan 's3://bucket/fleet/{{ ds }}/**/*.mcap' --store /shared/audit"

with DAG("auditor_shards", schedule="30 2 * * *", start_date=datetime(2026, 1, 1), catchup=False, max_active_runs=1):
    shards = BashOperator.partial(task_id="shard", retries=3).expand(
        bash_command=[f"{SCAN} --shard {number}/{SHARDS}" for number in range(SHARDS)]
    )
    verdicts = BashOperator(task_id="verdicts", bash_command=SCAN, trigger_rule="all_done")
    shards >> verdicts
