"""a campaign's kind is one of the known ones"""

from alembic import op

revision = "0032"
down_revision = "0031"
branch_labels = None
depends_on = None

_NAMED_CHECK = "CONSTRAINT ck_campaign_kind_known CHECK (kind IN ('calibration', 'measurement'))"


def upgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        _replace_column(f" {_NAMED_CHECK}")
    else:
        op.execute(f"ALTER TABLE campaign ADD {_NAMED_CHECK}")


def downgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        _replace_column("")
    else:
        op.execute("ALTER TABLE campaign DROP CONSTRAINT ck_campaign_kind_known")


def _replace_column(check: str) -> None:
    # SQLite takes a constraint only together with its column
    op.execute("ALTER TABLE campaign RENAME COLUMN kind TO kind_before")
    op.execute(f"ALTER TABLE campaign ADD COLUMN kind VARCHAR NOT NULL DEFAULT 'calibration'{check}")
    op.execute("UPDATE campaign SET kind = kind_before")
    op.execute("ALTER TABLE campaign DROP COLUMN kind_before")
