"""panels that are found in a frame by themselves"""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("frame", sa.Column("found", sa.JSON(), nullable=True))


def downgrade() -> None:
    op.drop_column("frame", "found")
