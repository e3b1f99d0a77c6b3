"""k and U in the rows of measurements; store.migrate writes all of them again"""

import sqlalchemy as sa
from alembic import op

revision = "0045"
down_revision = "0044"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.execute(sa.table("measured").delete())


def downgrade() -> None:
    op.execute(sa.table("measured").delete())
