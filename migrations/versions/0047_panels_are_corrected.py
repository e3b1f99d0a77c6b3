"""a panel's figures can be corrected until a version used them; its row is still never deleted"""

from alembic import op

revision = "0047"
down_revision = "0046"
branch_labels = None
depends_on = None


def upgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        op.execute("DROP TRIGGER panel_never_changes")
    else:
        _hold("panel_never_goes", "DELETE", instead_of="panel_never_changes")


def downgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        op.execute(
            "CREATE TRIGGER panel_never_changes BEFORE UPDATE ON panel "
            "BEGIN SELECT RAISE(ABORT, 'panel rows never change'); END"
        )
    else:
        _hold("panel_never_changes", "UPDATE OR DELETE", instead_of="panel_never_goes")


def _hold(name: str, what: str, *, instead_of: str) -> None:
    op.execute(f"DROP TRIGGER {instead_of} ON panel")
    op.execute(f"CREATE TRIGGER {name} BEFORE {what} ON panel FOR EACH ROW EXECUTE FUNCTION refuse_change()")
