"""frames, and jobs that wait for a dependency, are counted by their indexes alone"""

import sqlalchemy as sa
from alembic import op

revision = "0026"
down_revision = "0025"
branch_labels = None
depends_on = None

_WAITS = sa.text("waits_for IS NOT NULL")


def upgrade() -> None:
    op.drop_index("ix_frame_campaign_id_state", table_name="frame")
    op.create_index("ix_frame_counted", "frame", ["campaign_id", "state", "withdrawn_at"])
    op.create_index("ix_job_waits_for", "job", ["waits_for"], sqlite_where=_WAITS, postgresql_where=_WAITS)


def downgrade() -> None:
    op.drop_index("ix_job_waits_for", table_name="job")
    op.drop_index("ix_frame_counted", table_name="frame")
    op.create_index("ix_frame_campaign_id_state", "frame", ["campaign_id", "state"])
