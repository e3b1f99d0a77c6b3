"""frames left out and withdrawn, archived campaigns, gaps of a plan, and what a signature signed"""

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None

_COLUMNS = [
    ("frame", "left_out", sa.JSON),
    ("frame", "withdrawn_at", lambda: sa.DateTime(timezone=True)),
    ("campaign", "archived_at", lambda: sa.DateTime(timezone=True)),
    ("campaign_review", "gaps", sa.JSON),
    ("checklist_signature", "state_sha256", lambda: sa.String(64)),
]


def upgrade() -> None:
    for table, name, kind in _COLUMNS:
        op.add_column(table, sa.Column(name, kind(), nullable=True))


def downgrade() -> None:
    for table, name, _ in reversed(_COLUMNS):
        op.drop_column(table, name)
