"""what proves a stored file, when it last was proven, and whether it is damaged"""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

_DAMAGED = sa.text("damage IS NOT NULL")


def upgrade() -> None:
    op.add_column("blob", sa.Column("digests", sa.LargeBinary(), nullable=True))
    proven_at = sa.Column(
        "proven_at", sa.DateTime(timezone=True), nullable=False, server_default="1970-01-01"
    )
    op.add_column("blob", proven_at)
    # its upload hashed all of it
    op.execute("UPDATE blob SET proven_at = created_at")
    # in one statement: SQLite takes a constraint only together with its column
    op.execute(
        "ALTER TABLE blob ADD COLUMN damage VARCHAR "
        "CONSTRAINT ck_blob_damage_known CHECK (damage IN ('damaged', 'missing'))"
    )
    op.create_index("ix_blob_proven_at", "blob", ["proven_at"])
    op.create_index("ix_blob_damage", "blob", ["damage"], sqlite_where=_DAMAGED, postgresql_where=_DAMAGED)


def downgrade() -> None:
    op.drop_index("ix_blob_damage", "blob")
    op.drop_index("ix_blob_proven_at", "blob")
    for column in ("damage", "proven_at", "digests"):
        op.drop_column("blob", column)
