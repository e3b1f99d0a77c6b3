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
    "focus_distance_m": sa.Double,
    "focal_length_mm": sa.Double,
    "mains_frequency_hz": sa.Double,
    "lamp_modulation": sa.Double,
    "acceptance": sa.String,
}


def upgrade() -> None:
    for name, kind in _COLUMNS.items():
        op.add_column("campaign", sa.Column(name, kind(), nullable=True))


def downgrade() -> None:
    for name in reversed(_COLUMNS):
        op.drop_column("campaign", name)
