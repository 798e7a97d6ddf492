"""The refresh at night, and what drifts, as a DAG of Airflow 3: put this file into Airflow's folder of DAGs.

A refresh that is held for a person (exit code 1) is shown as skipped; one that is refused (4), or could not run (2),
fails. The second task fails where a sensor drifts or has changed, so that somebody is told.
"""

from datetime import datetime

from airflow.providers.standard.operators.bash import BashOperator
from airflow.sdk import DAG

with DAG("auditor_refresh", schedule="30 2 * * *", start_date=datetime(2026, 1, 1), catchup=False, max_active_runs=1):
    refresh = BashOperator(
        task_id="refresh",
        bash_command="auditor refresh /logs/today --store /srv/fleet --metrics /var/lib/node_exporter/auditor.prom",
        skip_on_exit_code=1,
    )
    drift = BashOperator(
        task_id="drift",
        bash_command="auditor drift --store /srv/fleet --page /srv/fleet/reports/drift.html",
        skip_on_exit_code=3,  # no vehicle has enough days yet
        trigger_rule="all_done",
    )
    refresh >> drift
