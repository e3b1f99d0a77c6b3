"""indexes for the totals of /metrics: frames that are not extracted, publications in force"""

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None

_INDEXES = {
    "ix_frame_not_extracted": ("frame", ["state", "refusal_code"], "state <> 'extracted'"),
    "ix_publication_in_force": (
        "publication",
        ["calibration_id"],
        "known_to IS NULL AND superseded_by IS NULL",
    ),
}


def upgrade() -> None:
    for name, (table, columns, where) in _INDEXES.items():
        op.create_index(name, table, columns, sqlite_where=sa.text(where), postgresql_where=sa.text(where))


def downgrade() -> None:
    for name, (table, *_) in _INDEXES.items():
        op.drop_index(name, table)
