"""an upper bound of the jobs of each organisation"""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("usage", sa.Column("jobs_most", sa.Integer(), nullable=False, server_default="0"))
    op.execute(
        "UPDATE usage SET jobs_most = (SELECT count(*) FROM job "
        "WHERE job.organisation_id = usage.organisation_id AND job.state IN ('queued', 'running'))"
    )


def downgrade() -> None:
    op.drop_column("usage", "jobs_most")
