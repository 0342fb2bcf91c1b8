"""Every setting of the service, read from environment variables with the prefix ``GCVEC_``."""

from __future__ import annotations

import hashlib
import re
from datetime import timedelta
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Final, Literal
from urllib.parse import SplitResult, urlsplit

from pydantic import Field, ValidationError, field_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from gcvec.errors import InputError
from gcvec.hex_color import HEX_COLOR
from gcvec.io import Limits
from gcvec.photo import MOST_PIXELS

_SHORTEST_KEY: Final = 16
_DATABASE: Final = re.compile(r"/?\d*")


class Settings(BaseSettings):
    """Settings shared by the API and the workers; the field names in capitals are the variables' names."""

    model_config = SettingsConfigDict(env_prefix="GCVEC_", frozen=True, hide_input_in_errors=True)

    broker_url: str = Field(
        default="redis://127.0.0.1:6379/0", description="Redis or Valkey server: queue, records, events"
    )
    storage_url: str = Field(
        default="", description="where files are kept: file:///folder or s3://bucket/prefix"
    )
    redirect_seconds: int = Field(
        default=0, ge=0, description="downloads from S3: by a redirect valid for so long; 0: through the API"
    )
    data_dir: Path = Field(default=Path("gcvec-data"), description="folder of a single-machine installation")
    api_keys: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="comma-separated keys, each plain or as sha256:HEX; empty: open, on loopback only",
    )
    metrics_open: bool = Field(default=False, description="whether /metrics needs no key")
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(), description="comma-separated origins whose pages may use the service"
    )
    retention: timedelta = Field(
        default=timedelta(days=7),
        gt=timedelta(0),
        description="how long a finished job is kept (ISO 8601: P7D)",
    )
    orphan_age: timedelta = Field(
        default=timedelta(days=1),
        gt=timedelta(0),
        description="age at which files that belong to no job are removed",
    )
    webhook_private: bool = Field(
        default=False, description="whether webhooks may use plain HTTP and addresses of our own network"
    )
    webhook_pauses: Annotated[tuple[Annotated[float, Field(ge=0)], ...], NoDecode] = Field(
        default=(5, 300, 1_800, 7_200, 18_000, 36_000),
        description="seconds before each further call of a webhook that fails, comma-separated",
    )

    log_format: Literal["text", "json"] = Field(
        default="text", description="log lines for people, or for programs: JSON with the job's id"
    )

    requests_per_minute: int = Field(default=6_000, ge=0, description="of one key; 0: no limit")
    max_unfinished_jobs: int = Field(default=1_000, ge=0, description="of one key; 0: no limit")
    max_stored_bytes: int = Field(default=20_000_000_000, ge=0, description="of one key; 0: no limit")

    max_upload_bytes: int = Field(
        default=Limits.annotation_bytes, gt=0, description="largest picture or annotation file"
    )
    max_pixels: int = Field(
        default=Limits.max_pixels,
        gt=0,
        le=MOST_PIXELS,
        description="most pixels of a picture; no file holds more than 2^26",
    )
    max_side: int = Field(default=Limits.max_side, gt=0, description="longest side of a picture, pixels")
    max_polygons: int = Field(default=Limits.max_polygons, gt=0, description="most polygons of a picture")
    max_polygon_vertices: int = Field(
        default=Limits.max_vertices_per_polygon, gt=0, description="most vertices of one polygon"
    )
    max_vertices: int = Field(
        default=Limits.max_vertices, gt=0, description="most vertices of all polygons together"
    )

    matte: str = Field(
        default="#ffffff",
        pattern=f"^{HEX_COLOR}$",
        description="what transparent pixels are laid over, unless a job says otherwise",
    )

    job_seconds: float = Field(default=900, gt=0, description="longest run of one job")
    job_memory_bytes: int = Field(
        default=4_000_000_000, gt=0, description="most memory of one worker process"
    )
    job_attempts: int = Field(default=3, gt=0, description="how often a job is started before it is given up")
    fan_out_megapixels: float = Field(
        default=8, ge=0, description="larger pictures are shared out over workers by region; 0: none are"
    )
    fan_out_parts: int = Field(default=4, ge=2, le=64, description="parts of a picture that is shared out")
    job_threads: int = Field(default=1, gt=0, description="most threads one job may use")

    @field_validator("broker_url")
    @classmethod
    def _redis(cls, url: str) -> str:
        parts = _parts(url)
        if parts is None or parts.scheme not in ("redis", "rediss") or not _DATABASE.fullmatch(parts.path):
            raise ValueError("must be like redis://host:6379/0, or rediss:// for TLS")
        return url

    @field_validator("storage_url")
    @classmethod
    def _folder_or_bucket(cls, url: str) -> str:
        parts = _parts(url)
        folder = parts is not None and parts[:2] == ("file", "") and parts.path.startswith("/")
        bucket = parts is not None and parts.scheme == "s3" and parts.netloc
        if url and not folder and not bucket:
            raise ValueError("must be like file:///folder or s3://bucket/prefix")
        return url

    @field_validator("api_keys", "cors_origins", "webhook_pauses", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        if not isinstance(value, str):
            return value
        parts = tuple(part.strip() for part in value.split(",") if part.strip())
        if value and not parts:  # as of a secret that is not there, which must not open the service
            raise ValueError("must not be blank; for none leave it empty")
        return parts

    @field_validator("api_keys")
    @classmethod
    def _digested(cls, keys: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(map(_digest, keys))

    @field_validator("retention", "orphan_age", mode="before")
    @classmethod
    def _seconds(cls, value: object) -> object:
        return float(value) if isinstance(value, str) and value.replace(".", "", 1).isdigit() else value

    @property
    def storage(self) -> str:
        """The storage URL in force: the one set, else a folder under `data_dir`."""
        return self.storage_url or (self.data_dir.absolute() / "storage").as_uri()


def listing() -> str:
    """The settings for people to read: a line each with variable, default and meaning."""
    defaults = Settings.model_construct().model_dump(mode="json")
    return "\n".join(
        f"GCVEC_{name.upper()} ({_shown(defaults[name])}): {field.description}"
        for name, field in Settings.model_fields.items()
    )


def _shown(default: object) -> str:
    """A default as it would stand in the environment."""
    parts = default if isinstance(default, list) else [default]
    return ",".join(f"{part:g}" if isinstance(part, float) else str(part) for part in parts) or "empty"


def _parts(url: str) -> SplitResult | None:
    """The parts of an address; None if it is none. What Python says of such a one could repeat a password."""
    try:
        parts = urlsplit(url)
        _ = parts.port
    except ValueError:
        return None
    return parts


def _digest(key: str) -> str:
    """``sha256:HEX`` of a key given so or plain. Raises ValueError, which does not repeat the key."""
    if key.startswith("sha256:"):
        if not re.fullmatch("sha256:[0-9a-f]{64}", key.lower()):
            raise ValueError("an API key given as sha256: needs 64 hexadecimal digits")
        return key.lower()
    if len(key) < _SHORTEST_KEY:
        raise ValueError(f"an API key needs at least {_SHORTEST_KEY} characters")
    return f"sha256:{hashlib.sha256(key.encode()).hexdigest()}"


@lru_cache
def get_settings() -> Settings:
    """The settings of this process. Raises gcvec.InputError naming the variable that is wrong."""
    try:
        return Settings()
    except ValidationError as error:
        first = error.errors()[0]
        name = f"GCVEC_{first['loc'][0]}".upper()
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{name}: {message}", code="bad-option") from None


def limits(settings: Settings) -> Limits:
    """The bounds on a picture and its annotations that these settings mean."""
    return Limits(
        max_pixels=settings.max_pixels,
        max_side=settings.max_side,
        max_polygons=settings.max_polygons,
        max_vertices_per_polygon=settings.max_polygon_vertices,
        max_vertices=settings.max_vertices,
        annotation_bytes=settings.max_upload_bytes,
    )
