"""what vouches for a frame's pixels"""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("frame", sa.Column("proof", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("frame", "proof")
