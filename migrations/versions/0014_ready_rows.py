"""ready rows: what look-ups and series read; store.migrate writes them for what is already there"""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None

NOW = sa.text("known_to IS NULL")


def upgrade() -> None:
    op.create_table(
        "ready",
        *_texts("publication_id"),
        sa.Column("slot_id", sa.Integer(), nullable=False),
        *_texts("organisation_id", "camera_id", "campaign_id", "method", "calibration_id"),
        sa.Column("version", sa.Integer(), nullable=False),
        _instant("computed_at"),
        _instant("valid_from"),
        _instant("valid_to", nullable=True),
        _instant("known_from"),
        _instant("known_to", nullable=True),
        sa.Column("coefficients", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["publication_id"], ["publication.id"], name="fk_ready_publication_id"),
        sa.ForeignKeyConstraint(["slot_id"], ["slot.id"], name="fk_ready_slot_id"),
        sa.PrimaryKeyConstraint("publication_id", name="pk_ready"),
    )
    op.create_index("ix_ready_slot_id_valid_from", "ready", ["slot_id", "valid_from"])
    op.create_index(
        "ix_ready_slot_id_now", "ready", ["slot_id", "valid_from"], sqlite_where=NOW, postgresql_where=NOW
    )
    op.create_index(
        "ix_ready_series", "ready", ["organisation_id", "camera_id", "valid_from", "method", "publication_id"]
    )
    op.create_table(
        "ready_answer",
        *_texts("publication_id", "etag"),
        sa.Column("whole", sa.Boolean(), nullable=False),
        sa.Column("foreseen", sa.String(), nullable=True),
        sa.Column("items", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["publication_id"], ["ready.publication_id"], name="fk_ready_answer_publication_id"
        ),
        sa.PrimaryKeyConstraint("publication_id", name="pk_ready_answer"),
    )
    op.create_table(
        "measured",
        *_texts("measurement_id", "organisation_id", "camera_id", "campaign_id", "calibration_id"),
        sa.Column("corrector_id", sa.String(), nullable=True),
        _instant("taken_from"),
        _instant("taken_to", nullable=True),
        _instant("created_at"),
        sa.Column("cells", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["measurement_id"], ["measurement.id"], name="fk_measured_measurement_id"),
        sa.PrimaryKeyConstraint("measurement_id", name="pk_measured"),
    )
    for whose in ("organisation_id", "camera_id", "campaign_id"):
        op.create_index(f"ix_measured_{whose}", "measured", [whose, "taken_from", "measurement_id"])


def downgrade() -> None:
    for table in ("measured", "ready_answer", "ready"):
        op.drop_table(table)


def _texts(*names: str) -> list[sa.Column[str]]:
    return [sa.Column(name, sa.String(), nullable=False) for name in names]


def _instant(name: str, *, nullable: bool = False) -> "sa.Column[sa.DateTime]":
    return sa.Column(name, sa.DateTime(timezone=True), nullable=nullable)
