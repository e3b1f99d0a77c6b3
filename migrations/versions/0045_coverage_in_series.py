"""k and U in the rows of series and in ready answers; store.migrate writes all of them again"""

import sqlalchemy as sa
from alembic import op

revision = "0045"
down_revision = "0044"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for table in ("ready_cells", "ready_answer", "ready", "measured"):
        op.execute(sa.table(table).delete())


def downgrade() -> None:
    upgrade()
