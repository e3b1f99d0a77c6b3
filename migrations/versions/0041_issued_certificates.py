"""certificates as they were issued, and the persons behind keys"""

import sqlalchemy as sa
from alembic import op

revision = "0041"
down_revision = "0040"
branch_labels = None
depends_on = None

_TABLE = "issued_certificate"


def upgrade() -> None:
    op.add_column("api_key", sa.Column("person", sa.String(), nullable=True))
    op.add_column("api_key", sa.Column("role", sa.String(), nullable=True))
    op.create_table(
        _TABLE,
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("amendment", sa.Integer(), nullable=False),
        sa.Column("number", sa.String(), nullable=False),
        sa.Column("publication_id", sa.String(), nullable=False),
        sa.Column("json_sha256", sa.String(length=64), nullable=False),
        sa.Column("pdf_sha256", sa.String(length=64), nullable=False),
        sa.Column("fitted_by", sa.JSON(), nullable=True),
        sa.Column("approved_by", sa.JSON(), nullable=True),
        sa.Column("at_upgrade", sa.Boolean(), nullable=False),
        sa.Column("issued_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["calibration_id"], ["calibration.id"], name="fk_issued_certificate_calibration_id"
        ),
        sa.ForeignKeyConstraint(
            ["publication_id"], ["publication.id"], name="fk_issued_certificate_publication_id"
        ),
        sa.ForeignKeyConstraint(["json_sha256"], ["blob.sha256"], name="fk_issued_certificate_json_sha256"),
        sa.ForeignKeyConstraint(["pdf_sha256"], ["blob.sha256"], name="fk_issued_certificate_pdf_sha256"),
        sa.PrimaryKeyConstraint("calibration_id", "amendment", name="pk_issued_certificate"),
    )
    if op.get_bind().dialect.name == "sqlite":
        for name, act, words in (
            ("never_changes", "UPDATE", "never change"),
            ("never_goes", "DELETE", "are never deleted"),
        ):
            op.execute(
                f"CREATE TRIGGER {_TABLE}_{name} BEFORE {act} ON {_TABLE} "
                f"BEGIN SELECT RAISE(ABORT, '{_TABLE} rows {words}'); END"
            )
    else:
        op.execute(
            f"CREATE TRIGGER {_TABLE}_never_changes BEFORE UPDATE OR DELETE ON {_TABLE} "
            "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
        )


def downgrade() -> None:
    op.drop_table(_TABLE)
    op.drop_column("api_key", "role")
    op.drop_column("api_key", "person")
