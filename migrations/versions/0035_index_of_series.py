"""the state of a series is read by an index"""

import sqlalchemy as sa
from alembic import op

revision = "0035"
down_revision = "0034"
branch_labels = None
depends_on = None

_IN_SERIES = sa.text("subject_type IN ('camera', 'measurement', 'publication', 'revocation')")


def upgrade() -> None:
    op.create_index(
        "ix_audit_entry_series",
        "audit_entry",
        ["organisation_id", "subject_type", "seq"],
        sqlite_where=_IN_SERIES,
        postgresql_where=_IN_SERIES,
    )


def downgrade() -> None:
    op.drop_index("ix_audit_entry_series", table_name="audit_entry")
