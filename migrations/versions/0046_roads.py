"""roads and their evaluations"""

import sqlalchemy as sa
from alembic import op

revision = "0046"
down_revision = "0045"
branch_labels = None
depends_on = None

_TABLE = "road_result"


def upgrade() -> None:
    op.create_table(
        "road",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("site", sa.JSON(), nullable=False),
        sa.Column("requirement", sa.JSON(), nullable=False),
        sa.Column("conditions", sa.JSON(), nullable=False),
        sa.Column("frames", sa.JSON(), nullable=False),
        sa.Column("points", sa.JSON(), nullable=False),
        sa.Column("hidden", sa.JSON(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_road_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_road"),
    )
    op.create_index("ix_road_organisation_id_id", "road", ["organisation_id", "id"])
    op.create_table(
        _TABLE,
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("road_id", sa.String(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("inputs", sa.JSON(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=False),
        sa.Column("result_schema", sa.Integer(), nullable=False),
        sa.Column("software", sa.JSON(), nullable=False),
        sa.Column("content_sha256", sa.String(length=64), nullable=False),
        sa.Column("map_png_sha256", sa.String(length=64), nullable=True),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["organisation_id"], ["organisation.id"], name="fk_road_result_organisation_id"
        ),
        sa.ForeignKeyConstraint(["road_id"], ["road.id"], name="fk_road_result_road_id"),
        sa.ForeignKeyConstraint(["map_png_sha256"], ["blob.sha256"], name="fk_road_result_map_png_sha256"),
        sa.PrimaryKeyConstraint("id", name="pk_road_result"),
        sa.UniqueConstraint("road_id", "number", name="uq_road_result_road_id_number"),
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
    op.drop_table("road")
