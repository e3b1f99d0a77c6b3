"""what the database itself holds: rows that never change, and one version in force at a time"""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None

IMMUTABLE = (
    "audit_entry",
    "calibration",
    "coefficient",
    "revocation",
    "roi",
    "extraction",
    "channel_statistics",
    "measurement",
)

OVERLAP = """
    EXISTS (
        SELECT 1 FROM publication other
        WHERE other.slot_id = NEW.slot_id AND other.id <> NEW.id
          AND (NEW.valid_to IS NULL OR other.valid_from < NEW.valid_to)
          AND (other.valid_to IS NULL OR other.valid_to > NEW.valid_from)
          AND (NEW.known_to IS NULL OR other.known_from < NEW.known_to)
          AND (other.known_to IS NULL OR other.known_to > NEW.known_from)
    )
"""


def upgrade() -> None:
    head = sa.table("audit_head", sa.column("id"), sa.column("seq"), sa.column("sha256"))
    op.execute(head.insert().values(id=1, seq=0, sha256="0" * 64))
    if op.get_bind().dialect.name == "sqlite":
        _hold_on_sqlite()
    else:
        _hold_on_postgresql()


def downgrade() -> None:
    op.execute("DELETE FROM audit_head")
    if op.get_bind().dialect.name == "sqlite":
        for table in IMMUTABLE:
            op.execute(f"DROP TRIGGER {table}_never_changes")
            op.execute(f"DROP TRIGGER {table}_never_goes")
        for trigger in ("publication_no_overlap", "publication_only_closed", "publication_never_goes"):
            op.execute(f"DROP TRIGGER {trigger}")
        return
    for table in IMMUTABLE:
        op.execute(f"DROP TRIGGER {table}_never_changes ON {table}")
    op.execute("DROP TRIGGER publication_only_closed ON publication")
    op.execute("DROP TRIGGER publication_never_goes ON publication")
    op.execute("DROP FUNCTION refuse_change()")
    op.execute("ALTER TABLE publication DROP CONSTRAINT ex_publication_overlap")


def _hold_on_sqlite() -> None:
    for table in IMMUTABLE:
        op.execute(
            f"CREATE TRIGGER {table}_never_changes BEFORE UPDATE ON {table} "
            f"BEGIN SELECT RAISE(ABORT, '{table} rows never change'); END"
        )
        op.execute(
            f"CREATE TRIGGER {table}_never_goes BEFORE DELETE ON {table} "
            f"BEGIN SELECT RAISE(ABORT, '{table} rows are never deleted'); END"
        )
    op.execute(
        f"CREATE TRIGGER publication_no_overlap BEFORE INSERT ON publication WHEN {OVERLAP} "
        "BEGIN SELECT RAISE(ABORT, 'ex_publication_overlap'); END"
    )
    op.execute(
        "CREATE TRIGGER publication_only_closed BEFORE UPDATE ON publication "
        "WHEN OLD.known_to IS NOT NULL OR NEW.known_to IS NULL OR NEW.valid_from <> OLD.valid_from "
        "OR NEW.valid_to IS NOT OLD.valid_to OR NEW.known_from <> OLD.known_from "
        "OR NEW.calibration_id <> OLD.calibration_id OR NEW.slot_id <> OLD.slot_id "
        "BEGIN SELECT RAISE(ABORT, 'publication rows are only ever closed'); END"
    )
    op.execute(
        "CREATE TRIGGER publication_never_goes BEFORE DELETE ON publication "
        "BEGIN SELECT RAISE(ABORT, 'publication rows are never deleted'); END"
    )


def _hold_on_postgresql() -> None:
    op.execute(
        "CREATE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN RAISE EXCEPTION '% rows never change', TG_TABLE_NAME; END $$"
    )
    for table in IMMUTABLE:
        op.execute(
            f"CREATE TRIGGER {table}_never_changes BEFORE UPDATE OR DELETE ON {table} "
            "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
        )
    # the slot's number as a range of one: plain gist has no equality for numbers, ranges it has
    op.execute(
        "ALTER TABLE publication ADD CONSTRAINT ex_publication_overlap EXCLUDE USING gist ("
        "int8range(slot_id, slot_id, '[]') WITH &&, "
        "tstzrange(valid_from, valid_to) WITH &&, "
        "tstzrange(known_from, known_to) WITH &&)"
    )
    op.execute(
        "CREATE TRIGGER publication_only_closed BEFORE UPDATE ON publication FOR EACH ROW "
        "WHEN (OLD.known_to IS NOT NULL OR NEW.known_to IS NULL OR NEW.valid_from <> OLD.valid_from "
        "OR NEW.valid_to IS DISTINCT FROM OLD.valid_to OR NEW.known_from <> OLD.known_from "
        "OR NEW.calibration_id <> OLD.calibration_id OR NEW.slot_id <> OLD.slot_id) "
        "EXECUTE FUNCTION refuse_change()"
    )
    op.execute(
        "CREATE TRIGGER publication_never_goes BEFORE DELETE ON publication "
        "FOR EACH ROW EXECUTE FUNCTION refuse_change()"
    )
