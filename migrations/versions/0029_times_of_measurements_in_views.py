"""when its frame was taken, in the view of measurements"""

from alembic import op

revision = "0029"
down_revision = "0028"
branch_labels = None
depends_on = None

VIEW = """
    SELECT o.name AS organisation, m.id AS measurement_id, c.camera_id, m.campaign_id, m.frame_id, f.filename,
           m.method, m.calibration_id, c.version AS calibration_version, {value} AS value,
           {uncertainty} AS standard_uncertainty, {unit} AS unit, m.created_at{times}
    FROM measurement m
    JOIN calibration c ON c.id = m.calibration_id
    JOIN frame f ON f.id = m.frame_id
    JOIN organisation o ON o.id = m.organisation_id
"""
TIMES = ", {taken_at} AS taken_at, t.taken_from, t.taken_to"
JOIN = "    LEFT JOIN measured t ON t.measurement_id = m.id"


def upgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        op.execute("DROP VIEW api_v1_measurements")
    _create(TIMES, JOIN)


def downgrade() -> None:
    # PostgreSQL takes no column from a view: who may read it is granted again
    of_sqlite = op.get_bind().dialect.name == "sqlite"
    op.execute(f"DROP VIEW api_v1{'_' if of_sqlite else '.'}measurements")
    _create("", "")
    if not of_sqlite:
        op.execute(
            """
            DO $$ BEGIN
                GRANT SELECT ON api_v1.measurements TO stilb_read;
            EXCEPTION WHEN insufficient_privilege OR undefined_object THEN
                RAISE NOTICE 'grant SELECT on api_v1.measurements to stilb_read by hand';
            END $$
            """
        )


def _create(times: str, join: str) -> None:
    of_sqlite = op.get_bind().dialect.name == "sqlite"

    def member(name: str) -> str:
        if of_sqlite:
            return (
                f"coalesce(json_extract(m.result, '$.mean.{name}'), json_extract(m.result, '$.value.{name}'))"
            )
        return f"coalesce(m.result->'mean', m.result->'value')->>'{name}'"

    text = VIEW.format(
        value=f"CAST({member('value')} AS double precision)",
        uncertainty=f"CAST({member('standard_uncertainty')} AS double precision)",
        unit=member("unit"),
        times=times.format(
            taken_at="json_extract(f.header, '$.taken_at')" if of_sqlite else "f.header->>'taken_at'"
        ),
    )
    create = "CREATE VIEW api_v1_measurements" if of_sqlite else "CREATE OR REPLACE VIEW api_v1.measurements"
    op.execute(f"{create} AS {text}{join}")
