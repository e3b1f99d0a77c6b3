"""why a reading is right that its frames speak against"""

import sqlalchemy as sa
from alembic import op

revision = "0044"
down_revision = "0043"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("reading", sa.Column("reason", sa.String(), nullable=True))


def downgrade() -> None:
    op.drop_column("reading", "reason")
