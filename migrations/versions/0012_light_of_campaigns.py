"""lamp, camera response, distance, mains and decision rule of a campaign"""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None

_COLUMNS = {
    "lamp": sa.String,
    "camera_response": sa.String,
    "focus_distance_m": sa.Float,
    "focal_length_mm": sa.Float,
    "mains_frequency_hz": sa.Float,
    "lamp_modulation": sa.Float,
    "acceptance": sa.String,
}


def upgrade() -> None:
    for name, kind in _COLUMNS.items():
        op.add_column("campaign", sa.Column(name, kind(), nullable=True))


def downgrade() -> None:
    with op.batch_alter_table("campaign") as table:
        for name in _COLUMNS:
            table.drop_column(name)
