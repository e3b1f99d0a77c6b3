"""a chain of audit entries for each organisation, from the head of the common one"""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "audit_chain",
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.PrimaryKeyConstraint("name", name="pk_audit_chain"),
    )
    op.execute("INSERT INTO audit_chain (name, seq, sha256) SELECT '', seq, sha256 FROM audit_head")
    op.execute(
        "INSERT INTO audit_chain (name, seq, sha256) "
        "SELECT organisation.id, audit_head.seq, audit_head.sha256 FROM organisation CROSS JOIN audit_head"
    )
    if op.get_bind().dialect.name != "sqlite":
        last = op.get_bind().scalar(sa.text("SELECT seq FROM audit_head"))
        op.execute(f"CREATE SEQUENCE audit_entry_number START {last + 1}")


def downgrade() -> None:
    op.drop_table("audit_chain")
    if op.get_bind().dialect.name != "sqlite":
        op.execute("DROP SEQUENCE audit_entry_number")
