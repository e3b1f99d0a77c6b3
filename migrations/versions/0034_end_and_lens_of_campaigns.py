"""when a campaign ended, and the lens that it was taken with"""

import sqlalchemy as sa
from alembic import op

revision = "0034"
down_revision = "0033"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("campaign", sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True))
    op.add_column("campaign", sa.Column("lens", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("campaign", "lens")
    op.drop_column("campaign", "ended_at")
