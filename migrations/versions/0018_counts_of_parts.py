"""what the processes of one kind count together"""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("part", sa.Column("counts", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("part", "counts")
