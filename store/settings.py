"""The settings that every process of stilb reads once, in its main, from the environment."""

from pathlib import Path
from typing import Literal

from pydantic import Field, SecretStr
from pydantic_settings import BaseSettings, SettingsConfigDict

from store.pulse import HANG_S


class Settings(BaseSettings):
    """One field a setting: ``STILB_<FIELD>`` in the environment, its meaning in docs/settings.md.

    An address left empty stands for the embedded part: SQLite, the bundled Valkey, blobs in a folder.
    """

    model_config = SettingsConfigDict(env_prefix="STILB_", extra="forbid", frozen=True)

    data: Path = Path("stilb-data")
    host: str = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535)
    key: SecretStr = SecretStr("")
    session_secret: SecretStr = SecretStr("")
    cors_origins: str = ""
    allowed_hosts: str = ""
    database_url: str = ""
    database_timeout_s: float = Field(default=30.0, gt=0)
    broker_url: str = ""
    blobs_url: str = ""
    max_upload_bytes: int = Field(default=2 * 1024**3, gt=0)
    headers_within_s: float = Field(default=15.0, gt=0)
    connections_per_peer: int = Field(default=512, ge=0)
    quota_bytes: int = Field(default=0, ge=0)
    quota_frames: int = Field(default=0, ge=0)
    quota_jobs_waiting: int = Field(default=50_000, ge=0)
    quota_requests_per_minute: int = Field(default=30_000, ge=0)
    stop_grace_s: float = Field(default=15.0, ge=0)
    stop_notice_s: float = Field(default=0.0, ge=0)
    worker_threads: int = Field(default=2, ge=1, le=64)
    lease_s: float = Field(default=30.0, gt=0)
    sweep_interval_s: float = Field(default=2.0, gt=0)
    scrub_days: float = Field(default=30.0, ge=0)
    stall_s: float = Field(default=60.0, gt=0)
    hang_s: float = Field(default=HANG_S, gt=0)
    pulse: str = ""
    decoder_memory_bytes: int = Field(default=3 * 1024**3, ge=256 * 1024**2)
    decoder_cpu_s: int = Field(default=60, ge=1)
    decoder_wall_s: float = Field(default=120.0, gt=0)
    decoder_sandbox: Literal["auto", "require"] = "auto"

    @property
    def effective_database_url(self) -> str:
        return self.database_url or f"sqlite:///{self.data.absolute() / 'stilb.sqlite'}"

    @property
    def effective_broker_url(self) -> str:
        return self.broker_url or f"redis+socket://{self.data.absolute() / 'valkey.sock'}"

    @property
    def effective_blobs_url(self) -> str:
        return self.blobs_url or str(self.data.absolute() / "blobs")
