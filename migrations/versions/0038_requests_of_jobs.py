"""the request that queued a job"""

import sqlalchemy as sa
from alembic import op

revision = "0038"
down_revision = "0037"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("job", sa.Column("request_id", sa.String(), nullable=True))


def downgrade() -> None:
    op.drop_column("job", "request_id")
