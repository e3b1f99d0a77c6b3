"""time zones of organisations and campaigns"""

import sqlalchemy as sa
from alembic import op

revision = "0037"
down_revision = "0036"
branch_labels = None
depends_on = None

_TABLES = ("organisation", "campaign")


def upgrade() -> None:
    for table in _TABLES:
        op.add_column(table, sa.Column("time_zone", sa.String(), nullable=True))


def downgrade() -> None:
    for table in _TABLES:
        op.drop_column(table, "time_zone")
