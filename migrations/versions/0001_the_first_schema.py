"""the first schema"""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "audit_entry",
        sa.Column("seq", sa.BigInteger(), autoincrement=False, nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=True),
        sa.Column("at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("actor", sa.String(), nullable=False),
        sa.Column("action", sa.String(), nullable=False),
        sa.Column("subject_type", sa.String(), nullable=False),
        sa.Column("subject_id", sa.String(), nullable=False),
        sa.Column("before", sa.JSON(), nullable=False),
        sa.Column("after", sa.JSON(), nullable=False),
        sa.Column("previous_sha256", sa.String(length=64), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.PrimaryKeyConstraint("seq", name="pk_audit_entry"),
    )
    op.create_index("ix_audit_entry_subject", "audit_entry", ["subject_id", "seq"])
    op.create_index("ix_audit_entry_organisation", "audit_entry", ["organisation_id", "seq"])

    op.create_table(
        "audit_head",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("seq", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.CheckConstraint("id = 1", name="ck_audit_head_one_row"),
        sa.PrimaryKeyConstraint("id", name="pk_audit_head"),
    )
    op.create_table(
        "blob",
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("size_bytes", sa.BigInteger(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("size_bytes >= 0", name="ck_blob_size_not_negative"),
        sa.PrimaryKeyConstraint("sha256", name="pk_blob"),
    )
    op.create_table(
        "organisation",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("address", sa.String(), nullable=True),
        sa.Column("operator", sa.Boolean(), nullable=False),
        sa.Column("refuses_incomplete_certificates", sa.Boolean(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_organisation"),
        sa.UniqueConstraint("name", name="uq_organisation_name"),
    )
    op.create_table(
        "api_key",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("scopes", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revoked_at", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_api_key_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_api_key"),
        sa.UniqueConstraint("sha256", name="uq_api_key_sha256"),
    )
    op.create_index("ix_api_key_organisation_id", "api_key", ["organisation_id"])

    op.create_table(
        "camera",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("make", sa.String(), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("serial", sa.String(), nullable=False),
        sa.Column("lens_make", sa.String(), nullable=True),
        sa.Column("lens_model", sa.String(), nullable=True),
        sa.Column("lens_serial", sa.String(), nullable=True),
        sa.Column("pixel_pitch_um", sa.Double(), nullable=True),
        sa.Column("sensor_width_mm", sa.Double(), nullable=True),
        sa.Column("note", sa.String(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("pixel_pitch_um > 0", name="ck_camera_pixel_pitch_positive"),
        sa.CheckConstraint("sensor_width_mm > 0", name="ck_camera_sensor_width_positive"),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_camera_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_camera"),
        sa.UniqueConstraint(
            "organisation_id", "make", "model", "serial", name="uq_camera_organisation_id_make_model_serial"
        ),
    )
    op.create_table(
        "idempotent_answer",
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("fingerprint", sa.String(length=64), nullable=False),
        sa.Column("status", sa.Integer(), nullable=False),
        sa.Column("headers", sa.JSON(), nullable=False),
        sa.Column("body", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["organisation_id"], ["organisation.id"], name="fk_idempotent_answer_organisation_id"
        ),
        sa.PrimaryKeyConstraint("organisation_id", "key", name="pk_idempotent_answer"),
    )
    op.create_table(
        "job",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("subject_id", sa.String(), nullable=False),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("progress", sa.Double(), nullable=False),
        sa.Column("attempt", sa.Integer(), nullable=False),
        sa.Column("lost", sa.Integer(), nullable=False),
        sa.Column("fence", sa.Integer(), nullable=False),
        sa.Column("lease_until", sa.DateTime(timezone=True), nullable=True),
        sa.Column("due_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("hinted_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("error", sa.JSON(), nullable=True),
        sa.Column("result", sa.JSON(), nullable=True),
        sa.Column("traceback", sa.String(), nullable=True),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("finished_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint(
            "(state = 'running') = (lease_until IS NOT NULL)", name="ck_job_running_has_lease"
        ),
        sa.CheckConstraint("kind IN ('extract', 'fit', 'measure')", name="ck_job_kind_known"),
        sa.CheckConstraint(
            "state IN ('queued', 'running', 'succeeded', 'failed', 'quarantined')", name="ck_job_state_known"
        ),
        sa.CheckConstraint("progress BETWEEN 0 AND 1", name="ck_job_progress_share"),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_job_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_job"),
    )
    op.create_index("ix_job_organisation_id_id", "job", ["organisation_id", "id"])
    op.create_index("ix_job_state_created_at", "job", ["state", "created_at"])
    op.create_index("ix_job_subject_id", "job", ["subject_id"])

    op.create_table(
        "meter",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("make", sa.String(), nullable=False),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("serial", sa.String(), nullable=False),
        sa.Column("certificate_number", sa.String(), nullable=True),
        sa.Column("certificate_laboratory", sa.String(), nullable=True),
        sa.Column("certificate_issued_on", sa.Date(), nullable=True),
        sa.Column("certificate_due_on", sa.Date(), nullable=True),
        sa.Column("certificate_expanded_uncertainty_rel", sa.Double(), nullable=True),
        sa.Column("certificate_coverage_factor", sa.Double(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("kind IN ('luminance', 'illuminance', 'sunshine')", name="ck_meter_kind_known"),
        sa.CheckConstraint("certificate_coverage_factor >= 1", name="ck_meter_certificate_coverage_factor"),
        sa.CheckConstraint("certificate_due_on >= certificate_issued_on", name="ck_meter_certificate_dates"),
        sa.CheckConstraint(
            "certificate_expanded_uncertainty_rel > 0 AND certificate_expanded_uncertainty_rel < 1",
            name="ck_meter_certificate_uncertainty_relative",
        ),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_meter_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_meter"),
        sa.UniqueConstraint(
            "organisation_id",
            "kind",
            "make",
            "model",
            "serial",
            name="uq_meter_organisation_id_kind_make_model_serial",
        ),
    )
    op.create_table(
        "purge",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("cause", sa.JSON(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("calibration_ids", sa.JSON(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("confirmed_by", sa.String(), nullable=True),
        sa.Column("confirmed_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint("(confirmed_by IS NULL) = (confirmed_at IS NULL)", name="ck_purge_who_and_when"),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_purge_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_purge"),
    )
    op.create_index("ix_purge_organisation_id", "purge", ["organisation_id"])

    op.create_table(
        "roi",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("points", sa.JSON(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_roi_organisation_id"),
        sa.PrimaryKeyConstraint("id", name="pk_roi"),
        sa.UniqueConstraint("organisation_id", "sha256", name="uq_roi_organisation_id_sha256"),
    )
    op.create_table(
        "campaign",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("camera_id", sa.String(), nullable=False),
        sa.Column("method", sa.String(), nullable=False),
        sa.Column("project_number", sa.String(), nullable=True),
        sa.Column("recorder", sa.String(), nullable=True),
        sa.Column("customer", sa.String(), nullable=True),
        sa.Column("place", sa.String(), nullable=True),
        sa.Column("conditions", sa.String(), nullable=True),
        sa.Column("started_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("comments", sa.String(), nullable=True),
        sa.Column("surface_reflectance", sa.Double(), nullable=True),
        sa.Column("roi_id", sa.String(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(
            "surface_reflectance > 0 AND surface_reflectance <= 1",
            name="ck_campaign_surface_reflectance_share",
        ),
        sa.ForeignKeyConstraint(["camera_id"], ["camera.id"], name="fk_campaign_camera_id"),
        sa.ForeignKeyConstraint(["organisation_id"], ["organisation.id"], name="fk_campaign_organisation_id"),
        sa.ForeignKeyConstraint(["roi_id"], ["roi.id"], name="fk_campaign_roi_id"),
        sa.PrimaryKeyConstraint("id", name="pk_campaign"),
    )
    op.create_index("ix_campaign_camera_id", "campaign", ["camera_id"])
    op.create_index("ix_campaign_organisation_id", "campaign", ["organisation_id"])

    op.create_table(
        "slot",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("camera_id", sa.String(), nullable=False),
        sa.Column("method", sa.String(), nullable=False),
        sa.Column("configuration", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(["camera_id"], ["camera.id"], name="fk_slot_camera_id"),
        sa.PrimaryKeyConstraint("id", name="pk_slot"),
        sa.UniqueConstraint(
            "camera_id", "method", "configuration", name="uq_slot_camera_id_method_configuration"
        ),
    )
    op.create_table(
        "calibration",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("camera_id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("method", sa.String(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("configuration", sa.JSON(), nullable=False),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("inputs", sa.JSON(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=False),
        sa.Column("result_schema", sa.Integer(), nullable=False),
        sa.Column("software", sa.JSON(), nullable=False),
        sa.Column("content_sha256", sa.String(length=64), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint("version >= 1", name="ck_calibration_version_counts_from_1"),
        sa.ForeignKeyConstraint(["camera_id"], ["camera.id"], name="fk_calibration_camera_id"),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_calibration_campaign_id"),
        sa.ForeignKeyConstraint(
            ["organisation_id"], ["organisation.id"], name="fk_calibration_organisation_id"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_calibration"),
        sa.UniqueConstraint("camera_id", "method", "version", name="uq_calibration_camera_id_method_version"),
        sa.UniqueConstraint(
            "campaign_id", "content_sha256", name="uq_calibration_campaign_id_content_sha256"
        ),
    )
    op.create_index("ix_calibration_organisation_id", "calibration", ["organisation_id"])

    op.create_table(
        "checklist_signature",
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("signed_by", sa.String(), nullable=False),
        sa.Column("signed_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_checklist_signature_campaign_id"),
        sa.PrimaryKeyConstraint("campaign_id", name="pk_checklist_signature"),
    )
    op.create_table(
        "checklist_tick",
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("done_by", sa.String(), nullable=True),
        sa.Column("done_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("note", sa.String(), nullable=True),
        sa.CheckConstraint("(done_by IS NULL) = (done_at IS NULL)", name="ck_checklist_tick_who_and_when"),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_checklist_tick_campaign_id"),
        sa.PrimaryKeyConstraint("campaign_id", "key", name="pk_checklist_tick"),
    )
    op.create_table(
        "frame",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("filename", sa.String(), nullable=False),
        sa.Column("role", sa.String(), nullable=False),
        sa.Column("scene", sa.String(), nullable=True),
        sa.Column("roi_id", sa.String(), nullable=True),
        sa.Column("supplied", sa.JSON(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.Column("header", sa.JSON(), nullable=True),
        sa.Column("exposure", sa.JSON(), nullable=True),
        sa.Column("exposure_time_s", sa.Double(), nullable=True),
        sa.Column("f_number", sa.Double(), nullable=True),
        sa.Column("iso", sa.Double(), nullable=True),
        sa.Column("warnings", sa.JSON(), nullable=False),
        sa.Column("refusal_code", sa.String(), nullable=True),
        sa.Column("refusal_detail", sa.String(), nullable=True),
        sa.Column("preview_sha256", sa.String(length=64), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.CheckConstraint(
            "(state = 'refused') = (refusal_code IS NOT NULL)", name="ck_frame_refused_says_why"
        ),
        sa.CheckConstraint(
            "role IN ('light', 'dark', 'flat', 'panel', 'chart', 'field')", name="ck_frame_role_known"
        ),
        sa.CheckConstraint(
            "state IN ('received', 'read', 'extracted', 'refused')", name="ck_frame_state_known"
        ),
        sa.CheckConstraint(
            "exposure_time_s > 0 AND f_number > 0 AND iso > 0", name="ck_frame_exposure_positive"
        ),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_frame_campaign_id"),
        sa.ForeignKeyConstraint(["preview_sha256"], ["blob.sha256"], name="fk_frame_preview_sha256"),
        sa.ForeignKeyConstraint(["roi_id"], ["roi.id"], name="fk_frame_roi_id"),
        sa.ForeignKeyConstraint(["sha256"], ["blob.sha256"], name="fk_frame_sha256"),
        sa.PrimaryKeyConstraint("id", name="pk_frame"),
        sa.UniqueConstraint("campaign_id", "sha256", name="uq_frame_campaign_id_sha256"),
    )
    op.create_index("ix_frame_sha256", "frame", ["sha256"])

    op.create_table(
        "reading",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("scene", sa.String(), nullable=False),
        sa.Column("quantity", sa.String(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("entered_value", sa.Double(), nullable=False),
        sa.Column("entered_unit", sa.String(), nullable=False),
        sa.Column("meter_id", sa.String(), nullable=True),
        sa.Column("taken_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("withdrawn_at", sa.DateTime(timezone=True), nullable=True),
        sa.CheckConstraint("quantity IN ('luminance', 'illuminance')", name="ck_reading_quantity_known"),
        sa.CheckConstraint("value > 0", name="ck_reading_value_positive"),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_reading_campaign_id"),
        sa.ForeignKeyConstraint(["meter_id"], ["meter.id"], name="fk_reading_meter_id"),
        sa.PrimaryKeyConstraint("id", name="pk_reading"),
    )
    op.create_index("ix_reading_campaign_id", "reading", ["campaign_id"])

    op.create_table(
        "coefficient",
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("position", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("value", sa.Double(), nullable=False),
        sa.Column("standard_uncertainty", sa.Double(), nullable=False),
        sa.Column("unit", sa.String(), nullable=False),
        sa.Column("iso", sa.Double(), nullable=True),
        sa.Column("f_number", sa.Double(), nullable=True),
        sa.Column("band", sa.String(), nullable=True),
        sa.Column("channel", sa.String(), nullable=True),
        sa.Column("model", sa.String(), nullable=False),
        sa.Column("flags", sa.JSON(), nullable=False),
        sa.CheckConstraint("standard_uncertainty >= 0", name="ck_coefficient_uncertainty_not_negative"),
        sa.ForeignKeyConstraint(["calibration_id"], ["calibration.id"], name="fk_coefficient_calibration_id"),
        sa.PrimaryKeyConstraint("calibration_id", "position", name="pk_coefficient"),
    )
    op.create_table(
        "extraction",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("frame_id", sa.String(), nullable=False),
        sa.Column("roi_id", sa.String(), nullable=False),
        sa.Column("extractor", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["frame_id"], ["frame.id"], name="fk_extraction_frame_id"),
        sa.ForeignKeyConstraint(["roi_id"], ["roi.id"], name="fk_extraction_roi_id"),
        sa.PrimaryKeyConstraint("id", name="pk_extraction"),
        sa.UniqueConstraint(
            "frame_id", "roi_id", "extractor", name="uq_extraction_frame_id_roi_id_extractor"
        ),
    )
    op.create_table(
        "measurement",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("organisation_id", sa.String(), nullable=False),
        sa.Column("campaign_id", sa.String(), nullable=False),
        sa.Column("frame_id", sa.String(), nullable=False),
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("method", sa.String(), nullable=False),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("result", sa.JSON(), nullable=False),
        sa.Column("result_schema", sa.Integer(), nullable=False),
        sa.Column("software", sa.JSON(), nullable=False),
        sa.Column("content_sha256", sa.String(length=64), nullable=False),
        sa.Column("map_tif_sha256", sa.String(length=64), nullable=True),
        sa.Column("map_png_sha256", sa.String(length=64), nullable=True),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["calibration_id"], ["calibration.id"], name="fk_measurement_calibration_id"),
        sa.ForeignKeyConstraint(["campaign_id"], ["campaign.id"], name="fk_measurement_campaign_id"),
        sa.ForeignKeyConstraint(["frame_id"], ["frame.id"], name="fk_measurement_frame_id"),
        sa.ForeignKeyConstraint(["map_png_sha256"], ["blob.sha256"], name="fk_measurement_map_png_sha256"),
        sa.ForeignKeyConstraint(["map_tif_sha256"], ["blob.sha256"], name="fk_measurement_map_tif_sha256"),
        sa.ForeignKeyConstraint(
            ["organisation_id"], ["organisation.id"], name="fk_measurement_organisation_id"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_measurement"),
        sa.UniqueConstraint("frame_id", "content_sha256", name="uq_measurement_frame_id_content_sha256"),
    )
    op.create_index("ix_measurement_calibration_id", "measurement", ["calibration_id"])
    op.create_index("ix_measurement_campaign_id", "measurement", ["campaign_id"])
    op.create_index("ix_measurement_organisation_id_id", "measurement", ["organisation_id", "id"])

    op.create_table(
        "publication",
        sa.Column("id", sa.String(), nullable=False),
        sa.Column("slot_id", sa.Integer(), nullable=False),
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("valid_from", sa.DateTime(timezone=True), nullable=False),
        sa.Column("valid_to", sa.DateTime(timezone=True), nullable=True),
        sa.Column("known_from", sa.DateTime(timezone=True), nullable=False),
        sa.Column("known_to", sa.DateTime(timezone=True), nullable=True),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("superseded_by", sa.String(), nullable=True),
        sa.CheckConstraint(
            "known_to IS NULL OR known_from <= known_to", name="ck_publication_knowledge_ordered"
        ),
        sa.CheckConstraint(
            "valid_to IS NULL OR valid_from < valid_to", name="ck_publication_validity_not_empty"
        ),
        sa.ForeignKeyConstraint(["calibration_id"], ["calibration.id"], name="fk_publication_calibration_id"),
        sa.ForeignKeyConstraint(["slot_id"], ["slot.id"], name="fk_publication_slot_id"),
        sa.ForeignKeyConstraint(["superseded_by"], ["calibration.id"], name="fk_publication_superseded_by"),
        sa.PrimaryKeyConstraint("id", name="pk_publication"),
    )
    op.create_index("ix_publication_calibration_id", "publication", ["calibration_id"])
    op.create_index("ix_publication_slot_id", "publication", ["slot_id"])

    op.create_table(
        "revocation",
        sa.Column("calibration_id", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("revoked_by", sa.String(), nullable=False),
        sa.Column("revoked_at", sa.DateTime(timezone=True), nullable=False),
        sa.ForeignKeyConstraint(["calibration_id"], ["calibration.id"], name="fk_revocation_calibration_id"),
        sa.PrimaryKeyConstraint("calibration_id", name="pk_revocation"),
    )
    op.create_table(
        "channel_statistics",
        sa.Column("extraction_id", sa.String(), nullable=False),
        sa.Column("channel", sa.String(), nullable=False),
        sa.Column("n", sa.Integer(), nullable=False),
        sa.Column("min_dn", sa.Integer(), nullable=False),
        sa.Column("max_dn", sa.Integer(), nullable=False),
        sa.Column("mean_dn", sa.Double(), nullable=False),
        sa.Column("median_dn", sa.Double(), nullable=False),
        sa.Column("std_dn", sa.Double(), nullable=False),
        sa.Column("saturated_share", sa.Double(), nullable=False),
        sa.Column("zero_share", sa.Double(), nullable=False),
        sa.Column("black_level_dn", sa.Double(), nullable=False),
        sa.Column("white_level_dn", sa.Double(), nullable=False),
        sa.CheckConstraint("min_dn <= max_dn", name="ck_channel_statistics_range_ordered"),
        sa.CheckConstraint("n > 0", name="ck_channel_statistics_n_positive"),
        sa.CheckConstraint(
            "saturated_share BETWEEN 0 AND 1 AND zero_share BETWEEN 0 AND 1",
            name="ck_channel_statistics_shares",
        ),
        sa.ForeignKeyConstraint(
            ["extraction_id"], ["extraction.id"], name="fk_channel_statistics_extraction_id"
        ),
        sa.PrimaryKeyConstraint("extraction_id", "channel", name="pk_channel_statistics"),
    )


def downgrade() -> None:
    op.drop_table("channel_statistics")
    op.drop_table("revocation")
    op.drop_table("publication")
    op.drop_table("measurement")
    op.drop_table("extraction")
    op.drop_table("coefficient")
    op.drop_table("reading")
    op.drop_table("frame")
    op.drop_table("checklist_tick")
    op.drop_table("checklist_signature")
    op.drop_table("calibration")
    op.drop_table("slot")
    op.drop_table("campaign")
    op.drop_table("roi")
    op.drop_table("purge")
    op.drop_table("meter")
    op.drop_table("job")
    op.drop_table("idempotent_answer")
    op.drop_table("camera")
    op.drop_table("api_key")
    op.drop_table("organisation")
    op.drop_table("blob")
    op.drop_table("audit_head")
    op.drop_table("audit_entry")
