"""queued jobs are counted, and frames that wait to be read are found, by narrow indexes"""

import sqlalchemy as sa
from alembic import op

revision = "0027"
down_revision = "0026"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.drop_index("ix_job_waits_for", table_name="job")
    _create("ix_job_state_waits_for", ["state", "waits_for"], "state = 'queued'")
    reading = "kind = 'extract' AND state IN ('queued', 'running')"
    _create("ix_job_reading", ["organisation_id", "subject_id"], reading)


def downgrade() -> None:
    op.drop_index("ix_job_reading", table_name="job")
    op.drop_index("ix_job_state_waits_for", table_name="job")
    _create("ix_job_waits_for", ["waits_for"], "waits_for IS NOT NULL")


def _create(name: str, columns: list[str], where: str) -> None:
    op.create_index(name, "job", columns, sqlite_where=sa.text(where), postgresql_where=sa.text(where))
