"""coefficients as rows of a series; store.migrate writes all ready rows again"""

import sqlalchemy as sa
from alembic import op

revision = "0036"
down_revision = "0035"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "ready_cells",
        sa.Column("publication_id", sa.String(), nullable=False),
        sa.Column("cells", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["publication_id"], ["ready.publication_id"], name="fk_ready_cells_publication_id"
        ),
        sa.PrimaryKeyConstraint("publication_id", name="pk_ready_cells"),
    )
    for table in ("ready_answer", "ready", "measured"):
        op.execute(sa.table(table).delete())


def downgrade() -> None:
    op.drop_table("ready_cells")
