"""no bound of the jobs of each organisation: they are counted"""

import sqlalchemy as sa
from alembic import op

revision = "0047"
down_revision = "0046"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.drop_column("usage", "jobs_most")


def downgrade() -> None:
    op.add_column("usage", sa.Column("jobs_most", sa.Integer(), nullable=False, server_default="0"))
