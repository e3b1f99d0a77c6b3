"""reflectance panels, what a campaign photographs, regions in parts, and a method's own features"""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "panel",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("serial", sa.String(), nullable=False),
        sa.Column("measured_on", sa.Date(), nullable=False),
        sa.Column("bands", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_panel_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_panel"),
        sa.UniqueConstraint(
            "organisation_id", "serial", "measured_on", name="uq_panel_organisation_id_serial_measured_on"
        ),
    )
    # in one statement: SQLite cannot add a constraint later, a copied table would lose its references
    op.execute(
        "ALTER TABLE campaign ADD COLUMN panel_id VARCHAR "
        "CONSTRAINT fk_campaign_panel_id REFERENCES panel (id)"
    )
    op.add_column("campaign", sa.Column("target", sa.JSON(), nullable=True))
    op.add_column("roi", sa.Column("parts", sa.JSON(), nullable=True))
    op.add_column("extraction", sa.Column("features", sa.JSON(), nullable=True))
    if op.get_bind().dialect.name == "sqlite":
        op.execute(
            "CREATE TRIGGER panel_never_changes BEFORE UPDATE ON panel "
            "BEGIN SELECT RAISE(ABORT, 'panel rows never change'); END"
        )
        op.execute(
            "CREATE TRIGGER panel_never_goes BEFORE DELETE ON panel "
            "BEGIN SELECT RAISE(ABORT, 'panel rows are never deleted'); END"
        )
    else:
        op.execute(
            "CREATE TRIGGER panel_never_changes BEFORE UPDATE OR DELETE ON panel "
            "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
        )


def downgrade() -> None:
    op.drop_column("extraction", "features")
    op.drop_column("roi", "parts")
    op.drop_column("campaign", "target")
    op.drop_column("campaign", "panel_id")
    op.drop_table("panel")
