"""campaigns of measurements, apart from those of calibrations"""

import sqlalchemy as sa
from alembic import op

revision = "0025"
down_revision = "0024"
branch_labels = None
depends_on = None


def upgrade() -> None:
    kind = sa.Column("kind", sa.String(), nullable=False, server_default="calibration")
    op.add_column("campaign", kind)


def downgrade() -> None:
    op.drop_column("campaign", "kind")
