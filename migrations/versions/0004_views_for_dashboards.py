"""views that a dashboard reads with SQL, and the role that reads nothing else"""

from collections.abc import Callable

from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

ROLE = "stilb_read"

COEFFICIENTS = """
    SELECT o.name AS organisation, m.id AS camera_id, m.make, m.model AS model_name, m.serial, c.method,
           c.version, c.id AS calibration_id, k.name, k.value, k.standard_uncertainty, k.unit, k.iso,
           k.f_number, k.band, k.channel, k.model, p.valid_from, p.valid_to, p.reason
    FROM coefficient k
    JOIN calibration c ON c.id = k.calibration_id
    JOIN camera m ON m.id = c.camera_id
    JOIN organisation o ON o.id = c.organisation_id
    JOIN publication p ON p.calibration_id = c.id AND p.known_to IS NULL
"""

MEASUREMENTS = """
    SELECT o.name AS organisation, m.id AS measurement_id, c.camera_id, m.campaign_id, m.frame_id, f.filename,
           m.method, m.calibration_id, c.version AS calibration_version, {value} AS value,
           {uncertainty} AS standard_uncertainty, {unit} AS unit, m.created_at
    FROM measurement m
    JOIN calibration c ON c.id = m.calibration_id
    JOIN frame f ON f.id = m.frame_id
    JOIN organisation o ON o.id = m.organisation_id
"""

CAMERAS = """
    SELECT o.name AS organisation, m.id AS camera_id, m.make, m.model AS model_name, m.serial, m.lens_make,
           m.lens_model, m.lens_serial, m.pixel_pitch_um, m.created_at
    FROM camera m JOIN organisation o ON o.id = m.organisation_id
"""

JOBS = """
    SELECT o.name AS organisation, j.id AS job_id, j.kind, j.state, j.attempt, j.created_at, j.finished_at
    FROM job j JOIN organisation o ON o.id = j.organisation_id
"""


def _of_postgresql(name: str) -> str:
    # a region's mean; of an index its value, which stands under another name
    return f"coalesce(m.result->'mean', m.result->'value')->>'{name}'"


def _of_sqlite(name: str) -> str:
    return f"coalesce(json_extract(m.result, '$.mean.{name}'), json_extract(m.result, '$.value.{name}'))"


def upgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        # SQLite has neither schemas nor roles: the same views under one name
        for name, text in _views(_of_sqlite):
            op.execute(f"CREATE VIEW api_v1_{name} AS {text}")
        return
    op.execute("CREATE SCHEMA api_v1")
    for name, text in _views(_of_postgresql):
        op.execute(f"CREATE VIEW api_v1.{name} AS {text}")
    # whoever migrates may not be allowed to make roles: then the operator makes it, and grants the same
    op.execute(
        f"""
        DO $$ BEGIN
            IF NOT EXISTS (SELECT FROM pg_roles WHERE rolname = '{ROLE}') THEN
                CREATE ROLE {ROLE} NOLOGIN;
            END IF;
            GRANT USAGE ON SCHEMA api_v1 TO {ROLE};
            GRANT SELECT ON ALL TABLES IN SCHEMA api_v1 TO {ROLE};
        EXCEPTION WHEN insufficient_privilege OR duplicate_object OR unique_violation THEN
            RAISE NOTICE 'the role {ROLE} was not made: grant USAGE and SELECT on schema api_v1 by hand';
        END $$
        """
    )


def downgrade() -> None:
    if op.get_bind().dialect.name == "sqlite":
        for name, _ in _views(_of_sqlite):
            op.execute(f"DROP VIEW api_v1_{name}")
        return
    # the role belongs to the server, not to this database: it stays
    op.execute("DROP SCHEMA api_v1 CASCADE")


def _views(member: Callable[[str], str]) -> list[tuple[str, str]]:
    measurements = MEASUREMENTS.format(
        value=f"CAST({member('value')} AS double precision)",
        uncertainty=f"CAST({member('standard_uncertainty')} AS double precision)",
        unit=member("unit"),
    )
    return [
        ("coefficients", COEFFICIENTS),
        ("measurements", measurements),
        ("cameras", CAMERAS),
        ("jobs", JOBS),
    ]
