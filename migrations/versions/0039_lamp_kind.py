"""kind of lamp of a campaign"""

import sqlalchemy as sa
from alembic import op

revision = "0039"
down_revision = "0038"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("campaign", sa.Column("lamp_kind", sa.String(), nullable=True))


def downgrade() -> None:
    op.drop_column("campaign", "lamp_kind")
