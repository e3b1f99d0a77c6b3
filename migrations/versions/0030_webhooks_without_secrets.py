"""of a webhook's secret the database keeps the hash alone"""

import hashlib
import json

import sqlalchemy as sa
from alembic import op

revision = "0030"
down_revision = "0029"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("webhook", sa.Column("secret_sha256", sa.String(), nullable=False, server_default=""))
    hooks = sa.table("webhook", sa.column("id"), sa.column("secret"), sa.column("secret_sha256"))
    found = op.get_bind().execute(sa.select(hooks.c.id, hooks.c.secret)).all()
    for hook_id, secret in found:
        # as the audit trail has it
        digest = hashlib.sha256(json.dumps(secret).encode()).hexdigest()
        op.execute(hooks.update().where(hooks.c.id == hook_id).values(secret_sha256=digest))
    with op.batch_alter_table("webhook") as batch:
        batch.alter_column("secret_sha256", server_default=None)
        batch.drop_column("secret")


def downgrade() -> None:
    op.add_column("webhook", sa.Column("secret", sa.String(), nullable=False, server_default=""))
    with op.batch_alter_table("webhook") as batch:
        batch.alter_column("secret", server_default=None)
        batch.drop_column("secret_sha256")
